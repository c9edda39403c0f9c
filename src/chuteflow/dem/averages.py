"""Averages over time and layers: the fields of a simulation, each with a standard error.

# notation: nu volume fraction, u velocity, c velocity relative to u, P pressure tensor, q heat flux, gamma dissipation,
# F the force of a contact on its upper grain, p overburden.

Everything follows from sums that add over time (:class:`Sums`). The velocities of all grains are sampled in bins of
height 0.1; fluctuations c are relative to the mean of their bin over the whole time. Of contacts, the forces F that
cross a horizontal plane give P_xz and P_zz there, and F . (v_i + v_j)/2 less F . u the collisional heat flux: momentum
and energy balance whatever the bins are. Dissipation and the other stresses of a contact lie at its middle. Fields are
smoothed with a Gaussian whose standard deviation is the kernel's width, cut at four of them; the shear rate is the
exact derivative of the smoothed velocity.

The standard errors follow from what each value becomes without one block of time: a series of influences, one for each
block, whose correlation from block to block counts (:mod:`chuteflow.dem.correlation`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from chuteflow.dem.contacts import MASS, PAIR_MASS
from chuteflow.dem.correlation import long_run_variance
from chuteflow.dem.output import Array, Frame, Layers
from chuteflow.dem.scene import Scene
from chuteflow.dem.script import BIN, MOMENTS

#: Width of the kernel, and the distance of the heights at which fields are given.
KERNEL, SPACING = 0.25, 0.25
#: An error that is a smaller fraction than this is rounding.
_ROUNDING = 1e-12
#: The kernel ends at so many of its widths.
_CUT = 4.0
#: Fields are given where this fraction of the hold-up lies above, at least.
_SMALLEST_FRACTION = 1e-3


@dataclass(frozen=True, eq=False)
class Sums:
    """Time averages over blocks of equal length, one row each, per unit area of the base.

    Over bins (b, k): ``mass``, ``moments`` (b, k, 9) times mass, ``dissipation``, ``across`` (b, k, 2) the contact
    parts of P_xx and P_yy times the bin's height, and ``touching``, contacts. At the lower ends of bins (b, k):
    ``force``
    (b, k, 2), of x and z, and ``work``. Of the base (b,): ``base_loss``, the dissipation in its contacts. ``overlap``
    (b, 2) is the sum over the contacts and the largest.
    """

    mass: Array
    moments: Array
    dissipation: Array
    across: Array
    touching: Array
    force: Array
    work: Array
    base_loss: Array
    overlap: Array

    def mean(self) -> Sums:
        """The mean over all blocks, as one block."""
        return self._map(lambda values: values.mean(axis=0, keepdims=True))

    def without_each(self) -> Iterator[Sums]:
        """The means over all blocks but one, each block left out once, in their order."""
        count = len(self.mass)
        whole = self._map(lambda values: values.sum(axis=0))
        for block in range(count):
            parts = {
                field.name: ((getattr(whole, field.name) - getattr(self, field.name)[block]) / (count - 1))[None]
                for field in fields(self)
            }
            yield Sums(**parts)

    def _map(self, change: Callable[[Array], Array]) -> Sums:
        return Sums(**{field.name: change(getattr(self, field.name)) for field in fields(self)})


def sums_of(scene: Scene, layers: Layers, frames: Iterable[Frame]) -> Sums:
    """The sums of the blocks of ``layers``, with the frames that fall in them."""
    bins = layers.count.shape[1]
    mass = layers.count * MASS / scene.area
    contacts = _ContactSums(scene, layers.steps, bins)
    for frame in frames:
        contacts.add(frame)
    return Sums(mass=mass, moments=layers.moments * mass[:, :, None], **contacts.found())


class _ContactSums:
    """Sums over the contacts of frames, block by block."""

    def __init__(self, scene: Scene, ends: Array, bins: int) -> None:
        self._scene, self._ends, self._bins = scene, ends, bins
        blocks = len(ends)
        self._frames = np.zeros(blocks)
        # Planes are crossed from one bin's lower end to another's: differences, summed up in the end.
        self._crossing = np.zeros((blocks, bins + 1, 3))
        self._at = np.zeros((blocks, bins, 4))
        self._base = np.zeros(blocks)
        self._overlap = np.zeros((blocks, 2))

    def add(self, frame: Frame) -> None:
        """Add the contacts of one frame."""
        block = int(np.searchsorted(self._ends, frame.step))
        if block >= len(self._ends):
            return
        self._frames[block] += 1
        for contact in (pair_contacts(self._scene, frame), plane_contacts(self._scene, frame)):
            self._add(block, contact)

    def _add(self, block: int, contact: Contact) -> None:
        # A plane is numbered by the bin above it.
        first = np.clip(np.ceil(contact.low / BIN), 0, self._bins).astype(int)
        last = np.clip(np.ceil(contact.high / BIN), 0, self._bins).astype(int)
        crossing = np.column_stack([contact.force[:, 0], contact.force[:, 2], contact.work])
        np.add.at(self._crossing[block], first, crossing)
        np.subtract.at(self._crossing[block], last, crossing)
        middle = np.clip(0.5 * (contact.low + contact.high) / BIN, 0, self._bins - 1).astype(int)
        own = np.column_stack(
            [contact.loss * ~contact.is_base, contact.force[:, :2] * contact.apart[:, :2], np.ones_like(contact.low)]
        )
        np.add.at(self._at[block], middle, own)
        self._base[block] += contact.loss[contact.is_base].sum()
        self._overlap[block, 0] += contact.overlap.sum()
        self._overlap[block, 1] = max(self._overlap[block, 1], contact.overlap.max(initial=0.0))

    def found(self) -> dict[str, Array]:
        """The sums by their names in :class:`Sums`."""
        per_frame = 1.0 / (np.maximum(self._frames, 1.0) * self._scene.area)
        crossing = np.cumsum(self._crossing[:, :-1], axis=1) * per_frame[:, None, None]
        at = self._at * per_frame[:, None, None]
        overlap = self._overlap * np.column_stack([per_frame, np.ones_like(per_frame)])
        return {
            "force": crossing[:, :, :2],
            "work": crossing[:, :, 2],
            "dissipation": at[:, :, 0],
            "across": at[:, :, 1:3],
            "touching": at[:, :, 3],
            "base_loss": self._base * per_frame,
            "overlap": overlap,
        }


@dataclass(frozen=True, eq=False)
class Contact:
    """Contacts of one frame: ``force`` (n, 3) on the upper grain, ``apart`` (n, 3) from the lower to it, their
    heights, ``work`` of the lower on the upper per time, ``loss`` of energy per time, overlaps, and whether the lower
    is the base."""

    force: Array
    apart: Array
    low: Array
    high: Array
    work: Array
    loss: Array
    overlap: Array
    is_base: Array


def pair_contacts(scene: Scene, frame: Frame) -> Contact:
    """The contacts of grains with one another and with bumps."""
    from scipy.spatial import cKDTree

    size = np.array([*scene.size, 0.0])
    place = frame.position.copy()
    place[:, :2] = np.mod(place[:, :2], size[:2])
    # The remainder of a tiny negative number is rounded to the whole length.
    place[:, :2][place[:, :2] >= size[:2]] = 0.0
    widest = max(1.0, 0.5 * (1.0 + scene.bump_diameter))
    pairs = cKDTree(place, boxsize=size).query_pairs(widest, output_type="ndarray")
    pairs = pairs[~(frame.is_bump[pairs].all(axis=1))]
    # The upper one last; a bump is always the lower.
    swap = (place[pairs[:, 0], 2] > place[pairs[:, 1], 2]) & ~frame.is_bump[pairs[:, 0]] | frame.is_bump[pairs[:, 1]]
    lower, upper = np.where(swap, pairs[:, 1], pairs[:, 0]), np.where(swap, pairs[:, 0], pairs[:, 1])
    apart = place[upper] - place[lower]
    apart[:, :2] -= size[:2] * np.round(apart[:, :2] / size[:2])
    reach = np.where(frame.is_bump[lower], 0.5 * (1.0 + scene.bump_diameter), 1.0)
    distance = np.sqrt(np.einsum("ij,ij->i", apart, apart))
    touching = distance < reach
    lower, upper, apart = lower[touching], upper[touching], apart[touching]
    normal = apart / distance[touching, None]
    radius = np.where(frame.is_bump[lower], 0.5 * scene.bump_diameter, 0.5)
    return _contacts(
        scene,
        frame,
        lower,
        upper,
        apart,
        normal,
        (reach - distance)[touching],
        arms=(radius, np.full(len(upper), 0.5)),
    )


def plane_contacts(scene: Scene, frame: Frame) -> Contact:
    """The contacts of grains with the plane below the bumps."""
    (upper,) = np.nonzero(~frame.is_bump & (frame.position[:, 2] < 0.5))
    apart = np.zeros((upper.size, 3))
    apart[:, 2] = frame.position[upper, 2]
    normal = np.tile([0.0, 0.0, 1.0], (upper.size, 1))
    overlap = 0.5 - apart[:, 2]
    return _contacts(scene, frame, None, upper, apart, normal, overlap, arms=(None, np.full(upper.size, 0.5)))


def _contacts(
    scene: Scene,
    frame: Frame,
    lower: Array | None,
    upper: Array,
    apart: Array,
    normal: Array,
    overlap: Array,
    arms: tuple[Array | None, Array],
) -> Contact:
    """Forces and losses of contacts, from the state alone; ``lower`` is None for the plane."""
    law = scene.contacts
    velocity = frame.velocity[upper]
    below = np.zeros_like(velocity) if lower is None else frame.velocity[lower]
    is_base = np.ones(len(upper), dtype=bool) if lower is None else frame.is_bump[lower]
    damping = np.where(is_base, law.damping(law.wall_restitution, MASS), law.damping(law.restitution, PAIR_MASS))
    relative = velocity - below
    separation_speed = np.einsum("ij,ij->i", relative, normal)
    normal_force = law.stiffness * overlap - damping * separation_speed
    force = normal_force[:, None] * normal
    loss = damping * separation_speed**2
    if law.friction > 0.0 and frame.spin is not None:
        slip = relative - separation_speed[:, None] * normal
        turning = arms[1][:, None] * frame.spin[upper]
        if lower is not None and arms[0] is not None:
            turning += arms[0][:, None] * frame.spin[lower]
        slip -= np.cross(turning, normal)
        speed = np.sqrt(np.einsum("ij,ij->i", slip, slip))
        ratio = np.where(is_base, law.tangential_ratio(law.wall_restitution), law.tangential_ratio(law.restitution))
        # The limit is mu times the elastic and damped parts, as in LAMMPS.
        limit = law.friction * np.abs(normal_force)
        wall_shear = np.minimum(ratio * damping * speed, limit)
        force = force - np.where(speed > 0.0, wall_shear / np.maximum(speed, 1e-300), 0.0)[:, None] * slip
        loss = loss + wall_shear * speed
    height = frame.position[upper, 2]
    return Contact(
        force=force,
        apart=apart,
        low=height - apart[:, 2],
        high=height,
        work=np.einsum("ij,ij->i", force, 0.5 * (velocity + below)),
        loss=loss,
        overlap=overlap,
        is_base=is_base,
    )


#: Where the numbers of the base are extrapolated from: straight lines in the overburden over these fractions of M.
BULK = (0.5, 0.9)


def heights_of(sums: Sums, kernel: float) -> Array:
    """Heights (m,) at which fields are given: up to where a thousandth of the hold-up lies above."""
    mass = sums.mean().mass[0]
    fraction = np.cumsum(mass[::-1])[::-1] / mass.sum()
    # The last bin has all that is higher.
    top = (
        min(int(np.count_nonzero(fraction > _SMALLEST_FRACTION)), len(mass) - 1 - math.ceil(_CUT * kernel / BIN)) * BIN
    )
    return np.arange(SPACING, max(top, 2.0 * SPACING) + 1e-9, SPACING)


def fields_of(sums: Sums, heights: Array, kernel: float) -> dict[str, Array]:
    """The fields (m,) at ``heights``, of sums of one block; NaN where there were no grains."""
    mass, moment = sums.mass[0], dict(zip(MOMENTS, sums.moments[0].T, strict=True))
    bins = len(mass)
    centres, planes = (np.arange(bins) + 0.5) * BIN, np.arange(bins) * BIN
    at_centres, slope = _smoothing(heights, centres, kernel)
    at_planes = _smoothing(heights, planes, kernel)[0]
    at_planes /= at_planes.sum(axis=1, keepdims=True)

    # Densities: what a bin holds, spread by the kernel.
    nu = at_centres @ mass
    with np.errstate(invalid="ignore", divide="ignore"):
        u = at_centres @ moment["vx"] / nu
        shear_rate = (slope @ moment["vx"] - u * (slope @ mass)) / nu
        mean = {name: np.where(mass > 0.0, moment[name] / mass, 0.0) for name in MOMENTS}
        ux, uy, uz = mean["vx"], mean["vy"], mean["vz"]
        square = {"xx": mean["xx"] - ux**2, "yy": mean["yy"] - uy**2, "zz": mean["zz"] - uz**2}
        square["xz"] = mean["xz"] - ux * uz
        kinetic = {name: at_centres @ (mass * value) for name, value in square.items()}
        spread = {name: value / nu for name, value in kinetic.items()}
        T = (spread["xx"] + spread["yy"] + spread["zz"]) / 3.0
    half = 0.5 * (mean["xx"] + mean["yy"] + mean["zz"])
    # <c_z c^2/2> from the products of velocities; y and z have no mean but by chance.
    flux = mean["ez"] - ux * mean["xz"] - uz * mean["zz"] + uz * (ux**2 + uz**2) - uz * (half - 0.5 * (ux**2 + uz**2))
    flux -= 0.5 * uz * (ux**2 + uz**2)
    kinetic_heat = at_centres @ (mass * flux)
    force, work = at_planes @ sums.force[0], at_planes @ sums.work[0]
    above = np.cumsum(mass[::-1])[::-1]
    across = at_centres @ sums.across[0]
    heat = kinetic_heat + work - force[:, 0] * u
    normal, shear = kinetic["zz"] + force[:, 1], kinetic["xz"] + force[:, 0]
    dissipation = at_centres @ sums.dissipation[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = at_centres @ sums.touching[0]
        return {
            "volume_fraction": nu,
            "velocity": u,
            "granular_temperature": T,
            "temperature_x": spread["xx"],
            "temperature_y": spread["yy"],
            "temperature_z": spread["zz"],
            "overburden": at_planes @ above,
            "normal_stress": normal,
            "shear_stress": -shear,
            "contact_normal_stress": force[:, 1],
            "contact_shear_stress": -force[:, 0],
            "normal_stress_x": kinetic["xx"] + across[:, 0],
            "normal_stress_y": kinetic["yy"] + across[:, 1],
            "shear_rate": shear_rate,
            "heat_flux": heat,
            "kinetic_heat_flux": kinetic_heat,
            "dissipation": dissipation,
            "contacts": rate,
            "production": -shear * shear_rate,
            "g1": normal / T,
            "g2": -shear / (np.sqrt(T) * shear_rate),
            "g5": dissipation / T**1.5,
        }


def _smoothing(heights: Array, centres: Array, kernel: float) -> tuple[Array, Array]:
    """The kernel (m, k) from ``centres`` to ``heights``, per unit height, and its derivative."""
    away = (heights[:, None] - centres[None, :]) / kernel
    weight = np.where(np.abs(away) <= _CUT, np.exp(-0.5 * away**2), 0.0) / (kernel * math.sqrt(2.0 * math.pi))
    return weight, -away / kernel * weight


def numbers_of(sums: Sums, found: dict[str, Array], scene: Scene) -> dict[str, float]:
    """The numbers of the flow, of sums of one block and the fields that they give."""
    mass, moment = sums.mass[0], dict(zip(MOMENTS, sums.moments[0].T, strict=True))
    M = float(mass.sum())
    Q = float(moment["vx"].sum())
    fraction = found["overburden"] / M
    good = np.isfinite(found["granular_temperature"])
    bulk = good & (fraction >= BULK[0]) & (fraction <= BULK[1])

    def at_base(name: str) -> float:
        if np.count_nonzero(bulk) < 3:
            return math.nan
        return float(np.polyval(np.polyfit(fraction[bulk], found[name][bulk], 1), 1.0))

    slip, base_T = at_base("velocity"), at_base("granular_temperature")
    traction = scene.chute.slope * M
    slip_work = traction * slip
    # Mean temperature of the grains, by their own layers.
    mean_T = float(np.nansum(found["volume_fraction"] * found["granular_temperature"]))
    mean_T /= float(np.nansum(found["volume_fraction"][good]))
    return {
        "mass_flux": Q,
        "mass_holdup": M,
        "centre_of_mass": float(((np.arange(len(mass)) + 0.5) * BIN) @ mass) / M,
        "mean_temperature": mean_T,
        "share_above": float(mass[-1]) / M,
        "slip_velocity": slip,
        "base_temperature": base_T,
        "base_volume_fraction": at_base("volume_fraction"),
        "slip_ratio": slip / math.sqrt(base_T) if base_T > 0.0 else math.nan,
        "base_normal_stress": float(sums.force[0, 0, 1]),
        "base_shear_stress": -float(sums.force[0, 0, 0]),
        "slip_work": slip_work,
        "base_loss": float(sums.base_loss[0]),
        "heat_from_base": slip_work - float(sums.base_loss[0]),
        "gravity_work": scene.chute.slope * Q,
        "whole_dissipation": float(sums.dissipation[0].sum() + sums.base_loss[0]),
        "contact_share": float(sums.touching[0].sum()) * 2.0 / (M / MASS),
        "mean_overlap": float(sums.overlap[0, 0] / max(sums.touching[0].sum(), 1e-300)),
    }


#: Fields whose means over tenths of the overburden are given, beside the measured functions.
_TENTHS = (
    "volume_fraction",
    "granular_temperature",
    "temperature_z",
    "velocity",
    "normal_stress",
    "shear_stress",
    "dissipation",
)
#: Points that a mean over a tenth is taken at.
_WITHIN = (np.arange(8) + 0.5) / 80.0


def fields_at_overburden(
    height: Array, found: Mapping[str, Array], holdup: float, names: Iterable[str], fraction: Array
) -> Array:
    """Fields, one row each, where ``fraction`` (k,) of the hold-up lies above, linear between heights; NaN outside."""
    known = found["overburden"] / holdup
    good = np.isfinite(found["granular_temperature"]) & np.isfinite(known)
    x = known[good][::-1]
    columns = {"height": height, **found}
    return np.array([np.interp(fraction, x, columns[name][good][::-1], left=np.nan, right=np.nan) for name in names])


def tenths_of(height: Array, found: Mapping[str, Array], holdup: float) -> dict[str, Array]:
    """Means over height in the tenths of the overburden from p/M = 0.1 to 1, (9,) each, as far as the fields are known.

    g1 = <P_zz>/<T>, g2 = <-P_xz/sqrt(T)> dz/du and g5 = <gamma>/<T^(3/2)>, with the changes dz and du over the tenth.
    """
    names = [name for name in _TENTHS if name in found]
    edges = np.append(np.arange(1, 10), 9.99) / 10.0
    z, u = fields_at_overburden(height, found, holdup, ("height", "velocity"), edges)
    fraction = (np.arange(1, 10) / 10.0)[:, None] + _WITHIN
    inner = dict(
        zip(
            names,
            fields_at_overburden(height, found, holdup, names, fraction.ravel()).reshape(-1, *fraction.shape),
            strict=True,
        )
    )
    # dz = -dp/nu
    weight = 1.0 / inner["volume_fraction"]
    weight /= weight.sum(axis=1, keepdims=True)

    def mean(values: Array) -> Array:
        return (weight * values).sum(axis=1)

    T = inner["granular_temperature"]
    out = {name: mean(values) for name, values in inner.items()}
    with np.errstate(invalid="ignore", divide="ignore"):
        if "normal_stress" in inner:
            out["g1"] = out["normal_stress"] / out["granular_temperature"]
        if "shear_stress" in inner:
            out["g2"] = mean(inner["shear_stress"] / np.sqrt(T)) * np.diff(z) / np.diff(u)
        if "dissipation" in inner:
            out["g5"] = out["dissipation"] / mean(T**1.5)
    return out


def with_errors(sums: Sums, values: Callable[[Sums], Mapping[str, Any]]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Values of the mean of all blocks, and their standard errors.

    Where a block is left out a value changes by its influence over n - 1; the mean of the influences has the error of
    the value, whose blocks are correlated.
    """
    whole = values(sums.mean())
    count = len(sums.mass)
    without = [values(one) for one in sums.without_each()]
    errors = {}
    for name in whole:
        parts = np.array([one[name] for one in without], dtype=float)
        influence = (count - 1) * (parts.mean(axis=0) - parts)
        error = np.sqrt(long_run_variance(influence) / count)
        # What is the same in all blocks, as the hold-up, has no error but rounding.
        errors[name] = np.where(error < _ROUNDING * np.abs(whole[name]), 0.0, error)
    return {name: np.asarray(value) for name, value in whole.items()}, errors
