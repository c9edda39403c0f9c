"""Measured flows: fields over height and numbers, each with a standard error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from chuteflow.dem import averages, script
from chuteflow.dem.correlation import correlation_time
from chuteflow.dem.output import Array, Layers, read_frames, read_layers, read_totals
from chuteflow.dem.run import Run
from chuteflow.dem.scene import Scene
from chuteflow.dem.steadiness import Drift, drift, overall_steadiness
from chuteflow.errors import InputError
from chuteflow.steady.chute import Chute

#: The fields: symbol and description. Heights are above the plane of the bumps' centres.
FIELDS = {
    "volume_fraction": ("nu", "volume fraction"),
    "velocity": ("u", "mean velocity down the slope"),
    "granular_temperature": ("T", "granular temperature, a third of the mean square of the fluctuating velocity"),
    "temperature_x": ("T_x", "mean square of the fluctuating velocity down the slope"),
    "temperature_y": ("T_y", "mean square of the fluctuating velocity across the slope"),
    "temperature_z": ("T_z", "mean square of the fluctuating velocity normal to the slope"),
    "overburden": ("p", "mass above, per unit area"),
    "normal_stress": ("P_zz", "normal stress"),
    "shear_stress": ("-P_xz", "shear stress that drags the grains below down the slope"),
    "contact_normal_stress": ("P_zz,c", "normal stress of contacts"),
    "contact_shear_stress": ("-P_xz,c", "shear stress of contacts"),
    "normal_stress_x": ("P_xx", "normal stress down the slope"),
    "normal_stress_y": ("P_yy", "normal stress across the slope"),
    "shear_rate": ("du/dz", "shear rate"),
    "heat_flux": ("q", "flux of fluctuation energy upward"),
    "kinetic_heat_flux": ("q_k", "flux of fluctuation energy that grains carry"),
    "dissipation": ("gamma", "energy lost in collisions of grains, per volume and time"),
    "contacts": ("n_c", "contacts per volume at one moment"),
    "production": ("-P_xz du/dz", "shear work, per volume and time"),
    "g1": ("g1", "P_zz/T"),
    "g2": ("g2", "-P_xz/(sqrt(T) du/dz)"),
    "g5": ("g5", "gamma/T^(3/2)"),
}
#: The numbers, in the same way.
NUMBERS = {
    "mass_flux": ("Q", "mass flux per unit width"),
    "mass_holdup": ("M", "mass per unit area of the base"),
    "centre_of_mass": ("h", "height of the centre of mass above the bumps' centres"),
    "mean_temperature": ("T_mean", "granular temperature, mean over the grains"),
    "share_above": (
        "",
        "fraction of the grains above the highest layer: they are in no profile, height or temperature",
    ),
    "slip_velocity": ("u_b", "velocity at the base: a line in p over p/M from 0.5 to 0.9, at p = M"),
    "base_temperature": ("T_b", "granular temperature at the base, by the same line"),
    "base_volume_fraction": ("nu_b", "volume fraction at the base, by the same line"),
    "slip_ratio": ("u_b/sqrt(T_b)", "slip over thermal speed"),
    "base_normal_stress": ("P_zz(0)", "normal stress of the contacts with the base"),
    "base_shear_stress": ("-P_xz(0)", "shear stress of the contacts with the base"),
    "slip_work": ("W_s", "work of the slip, tan(theta) M u_b"),
    "base_loss": ("D", "energy lost in collisions with the base, per area and time"),
    "heat_from_base": ("q(0)", "W_s - D"),
    "gravity_work": ("W_g", "work of gravity, tan(theta) Q"),
    "whole_dissipation": ("D_all", "energy lost in all collisions, per area and time"),
    "contact_share": ("", "mean number of contacts of a grain with others at one moment"),
    "mean_overlap": ("", "mean overlap of contacts"),
}
#: Prefixes of the names of values, by kind.
_FIELD, _NUMBER, _TENTH = "field ", "number ", "tenth "
#: Numbers whose drifts decide whether a run is steady.
_WATCHED = ("mass_flux", "centre_of_mass", "mean_temperature")


@dataclass(frozen=True, eq=False)
class Measured:
    """A measured flow.

    Args:
        slope, restitution, wall_restitution: of the grains and the chute; NaN where not known.
        roughness: r by (2.8); NaN where not known.
        roughness_by_area: r from the area of a bump; NaN where not known.
        height: heights (m,) above the bumps' centres, ascending.
        fields: arrays (m,) by the names of :data:`FIELDS`; those that are not known are left out.
        errors: their standard errors, for all or some of them.
        numbers: numbers by the names of :data:`NUMBERS`, all or some of them.
        number_errors: their standard errors, for all or some of them.
        tenths: means over the tenths of the overburden from p/M = 0.1 to 1, (9,) each, see
            :func:`chuteflow.dem.averages.tenths_of`.
        tenth_errors: their standard errors, for all or some of them.
        drifts: drifts by the names of numbers; none where no time series is known.
        notes: what else is known of the run, texts and numbers by name.
    """

    slope: float
    restitution: float
    wall_restitution: float
    roughness: float
    roughness_by_area: float
    height: Array
    fields: Mapping[str, Array]
    errors: Mapping[str, Array]
    numbers: Mapping[str, float]
    number_errors: Mapping[str, float]
    tenths: Mapping[str, Array]
    tenth_errors: Mapping[str, Array]
    drifts: Mapping[str, Drift] = field(default_factory=dict)
    notes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def steadiness(self) -> str:
        """ "steady", "not steady" or "undecided"."""
        return overall_steadiness(dict(self.drifts)) if self.drifts else "undecided"

    @property
    def holdup(self) -> float:
        """M."""
        return self.numbers["mass_holdup"]

    @property
    def fraction_above(self) -> Array:
        """p/M at the heights."""
        return self.fields["overburden"] / self.holdup

    def chute(self, roughness: float, closure: str = "lun") -> Chute:
        """The chute of the theory with one of the two values of the roughness.

        Raises:
            InputError: for parameters that are not known or out of range.
        """
        given = {"slope": self.slope, "e": self.restitution, "ew": self.wall_restitution, "roughness": roughness}
        missing = [f"--{name}" for name, value in given.items() if not math.isfinite(value)]
        if missing:
            raise InputError(f"the run does not define {', '.join(missing)}: give what is missing")
        return Chute(self.slope, self.restitution, self.wall_restitution, roughness, closure=closure)


def measure(run: Run, kernel: float = averages.KERNEL) -> Measured:
    """The averages of a run over all of its measured blocks that are written.

    Raises:
        InputError: for a run with less than four measured blocks, or damaged files.
    """
    scene, steps = run.scene, run.steps
    layers = read_layers(run.folder / script.LAYERS)
    kept = (layers.steps > steps.first) & (layers.steps <= steps.last)
    count = int(np.count_nonzero(kept))
    if count < 4:
        raise InputError(
            f"{run.folder} has {count} blocks after it has settled: at least 4 are needed; let the run go on"
        )
    layers = Layers(layers.steps[kept], layers.count[kept], layers.moments[kept])
    frames = read_frames(run.folder / script.CONTACTS, steps.first)
    sums = averages.sums_of(scene, layers, frames)
    heights = averages.heights_of(sums, kernel)
    values, errors = averages.with_errors(sums, lambda one: _values(one, heights, kernel, scene))
    drifts, correlation = _drifts(run)
    return Measured(
        slope=scene.chute.slope,
        restitution=scene.chute.restitution,
        wall_restitution=scene.chute.wall_restitution,
        roughness=scene.roughness_by_spacing,
        roughness_by_area=scene.roughness_by_area,
        height=heights,
        fields=_part(values, _FIELD),
        errors=_part(errors, _FIELD),
        numbers={name: float(value) for name, value in _part(values, _NUMBER).items()},
        number_errors={name: float(value) for name, value in _part(errors, _NUMBER).items()},
        tenths=_part(values, _TENTH),
        tenth_errors=_part(errors, _TENTH),
        drifts=drifts,
        notes=_notes(run, kernel, count, float(sums.overlap[:, 1].max())) | {"correlation_time": correlation},
    )


def _values(sums: averages.Sums, heights: Array, kernel: float, scene: Scene) -> dict[str, Any]:
    """All values that have errors, by kind and name."""
    fields = averages.fields_of(sums, heights, kernel)
    numbers = averages.numbers_of(sums, fields, scene)
    tenths = averages.tenths_of(heights, fields, numbers["mass_holdup"])
    kinds = {_FIELD: fields, _NUMBER: numbers, _TENTH: tenths}
    return {kind + name: value for kind, found in kinds.items() for name, value in found.items()}


def _part(values: Mapping[str, Array], kind: str) -> dict[str, Array]:
    return {name.removeprefix(kind): value for name, value in values.items() if name.startswith(kind)}


def _drifts(run: Run) -> tuple[dict[str, Drift], float]:
    """Drifts by the names of their numbers, and the longest of their correlation times."""
    steps, totals = read_totals(run.folder / script.TOTALS)
    kept = (steps > run.steps.first) & (steps <= run.steps.last)
    times, totals = steps[kept] * run.steps.step, totals[kept]
    # Fluctuations across the slope and upward have no mean to be taken off.
    series = (totals[:, 0], totals[:, 1], 0.5 * (totals[:, 2] + totals[:, 3]))
    step = float(np.diff(times).mean()) if len(times) > 1 else math.nan
    correlation = max((step * correlation_time(one) for one in series if len(one) > 1), default=math.nan)
    return {name: drift(times, values) for name, values in zip(_WATCHED, series, strict=True)}, correlation


def _notes(run: Run, kernel: float, blocks: int, largest_overlap: float) -> dict[str, Any]:
    scene, schedule = run.scene, run.schedule
    return {
        "grains": scene.grains,
        "box_length": scene.size[0],
        "box_width": scene.size[1],
        "base": scene.base,
        "bump_diameter": scene.bump_diameter,
        "bumps_per_area": scene.density_of_bumps,
        "friction": scene.friction,
        "start": scene.start,
        "start_temperature": scene.temperature or 0.0,
        "start_velocity": scene.velocity,
        "seed": scene.seed,
        "comes_to_rest": "yes" if run.is_at_rest else "no",
        "stiffness": scene.contacts.stiffness,
        "contact_time": scene.contacts.duration,
        "time_step": run.steps.step,
        "largest_overlap": largest_overlap,
        "kernel_width": kernel,
        "settle": schedule.settle,
        "measured_time": blocks * run.steps.block * run.steps.step,
        "blocks_of_errors": blocks,
    }
