"""Scenes: a chute, a hold-up and a box, with bumps on a plane and grains above it.

# notation: d_w diameter of the bumps, s_w their mean gap, r roughness (2.8), L distance of the bumps' centres,
# n bumps per unit area, dbar = (1 + d_w)/2.

The bumps are spheres whose centres lie in the plane z = 0, a flat wall. By (2.8) r = (s_w + d_w)/(1 + d_w), so that
bumps on a triangular lattice are L = s_w + d_w = r (1 + d_w) apart. In the derivation of the base the area of a bump is
pi (r dbar)^2; with n bumps per unit area that gives r = 1/(dbar sqrt(pi n)) instead, 5.0 % more on a lattice.
A scene has both, and a random base has the density of bumps that the lattice of its r has.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from chuteflow.checks import number, shorten, whole
from chuteflow.dem.contacts import MASS, Bounds, Contacts, contacts_for
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.steady.chute import Chute

BASES, STARTS = ("triangular", "random"), ("hot", "cold")
#: Smallest restitution: the dashpot of a smaller one keeps grains together for long.
SOFTEST = 0.05
#: Fraction of the plane covered by bumps up to which they are placed at random; discs order above 0.70.
MOST_COVERED = 0.68
#: Sweeps of Monte Carlo moves that make a lattice of bumps random.
_SWEEPS = 400
#: Distance of grains from one another at the start.
_APART = 1.05
#: Temperatures and volume fractions of the two starts.
_HOT, _COLD, _COLD_DENSITY = 3.0, 0.1, 0.45
#: The rate of collisions of a grain for which contacts are made stiff enough: Enskog's, 24 nu g0 sqrt(T/pi), at
#: nu = 0.3 and T = 1.
_COLLISION_RATE = 24.0 * 0.3 * 2.05 / math.sqrt(math.pi)
_MOST_GRAINS = 2_000_000


@dataclass(frozen=True)
class Scene:
    """The parameters of a simulation, all dimensionless.

    Args:
        chute: slope, restitutions and roughness; its base and surface are not asked.
        holdup: M, mass per unit area of the base.
        box: length along and width across the slope, rounded to whole cells of the lattice of bumps.
        base: "triangular", rows of bumps across the slope, or "random".
        bump_diameter: d_w.
        bumps: bumps per unit area of a random base instead of those that r gives.
        friction: coefficient of sliding friction, 0 for none.
        start: "hot", a dilute gas of the temperature ``temperature``, or "cold", a dense layer at rest.
        temperature: granular temperature at the start, and that at which overlaps are bounded.
        velocity: mean velocity down the slope at the start.
        seed: of all random numbers.
        bounds: of overlaps and contact times.
        stiffness: k instead of that of the bounds.

    Raises:
        InputError: for a value out of range, naming it, what was given and what is allowed.
    """

    chute: Chute
    holdup: float
    box: tuple[float, float] = (12.0, 12.0)
    base: str = "triangular"
    bump_diameter: float = 1.0
    bumps: float | None = None
    friction: float = 0.0
    start: str = "hot"
    temperature: float | None = None
    velocity: float = 0.0
    seed: int = 1
    bounds: Bounds = field(default_factory=Bounds)
    stiffness: float | None = None

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        put("holdup", number("hold-up M", self.holdup, 0.05, 100.0))
        put("box", _check_box(self.box))
        for name, low, high in (("bump_diameter", 0.3, 3.0), ("friction", 0.0, 2.0), ("velocity", -1e3, 1e3)):
            put(name, number(name.replace("_", " "), getattr(self, name), low, high))
        for name, allowed in (("base", BASES), ("start", STARTS)):
            if getattr(self, name) not in allowed:
                raise InputError(f"unknown {name} {shorten(getattr(self, name))}: choose one of {', '.join(allowed)}")
        default = _HOT if self.start == "hot" else _COLD
        given = default if self.temperature is None else self.temperature
        put("temperature", number("temperature", given, 1e-3, 1e3))
        for name in ("restitution", "wall_restitution"):
            if getattr(self.chute, name) < SOFTEST:
                label = name.replace("_", " ")
                raise InputError(f"{label} = {getattr(self.chute, name):g}: a simulation needs at least {SOFTEST:g}")
        put("seed", whole("seed", self.seed, 1, 2**31 - 1))
        if self.stiffness is not None:
            put("stiffness", number("stiffness", self.stiffness, 1.0, 1e9))
        self._check_bumps()
        if self.grains > _MOST_GRAINS:
            raise InputError(f"{self.grains} grains: at most {_MOST_GRAINS}; give a smaller box")

    def _check_bumps(self) -> None:
        if self.bumps is None:
            if self.spacing < self.bump_diameter * (1.0 - 1e-12):
                raise InputError(
                    f"roughness r = {self.chute.roughness:g} with bumps of diameter {self.bump_diameter:g}: they would "
                    f"overlap; r must be at least {self.bump_diameter / (1.0 + self.bump_diameter):.4f}"
                )
        elif self.base == "triangular":
            raise InputError("a density of bumps is for the random base: the triangular one follows from r")
        else:
            object.__setattr__(self, "bumps", number("bumps", self.bumps, 0.01, 20.0))
        covered = math.pi / 4.0 * self.bump_diameter**2 * self.density_of_bumps
        if self.base == "random" and covered > MOST_COVERED:
            most = MOST_COVERED / (math.pi / 4.0 * self.bump_diameter**2)
            raise InputError(
                f"{self.density_of_bumps:.4g} bumps per unit area: at most {most:.4g} of this diameter can be random, "
                f"which on a lattice is r = {_spacing(most) / (1.0 + self.bump_diameter):.4f}; take a larger r"
            )

    @property
    def spacing(self) -> float:
        """L, the distance of the bumps on a lattice of their density."""
        if self.bumps is None:
            return self.chute.roughness * (1.0 + self.bump_diameter)
        return _spacing(self.bumps)

    @property
    def density_of_bumps(self) -> float:
        """n, bumps per unit area."""
        return 2.0 / (math.sqrt(3.0) * self.spacing**2)

    @property
    def roughness_by_spacing(self) -> float:
        """r by (2.8), from the distance of the bumps."""
        return self.spacing / (1.0 + self.bump_diameter)

    @property
    def roughness_by_area(self) -> float:
        """r from the area of a bump."""
        return 2.0 / (1.0 + self.bump_diameter) / math.sqrt(math.pi * self.density_of_bumps)

    @property
    def cells(self) -> tuple[int, int]:
        """Cells of two bumps each along and across the slope, two at least."""
        along, across = self.box[0] / (math.sqrt(3.0) * self.spacing), self.box[1] / self.spacing
        return max(round(along), 2), max(round(across), 3)

    @property
    def size(self) -> tuple[float, float]:
        """Length along the slope and width of the box, whole cells."""
        return self.cells[0] * math.sqrt(3.0) * self.spacing, self.cells[1] * self.spacing

    @property
    def area(self) -> float:
        """Area of the base."""
        return self.size[0] * self.size[1]

    @property
    def grains(self) -> int:
        """How many grains have the hold-up."""
        return max(round(self.holdup * self.area / MASS), 1)

    @cached_property
    def contacts(self) -> Contacts:
        """The contacts: overlaps are bounded at the temperature of the start, or at T = 1 where that is colder, and
        contact times at nu = 0.3 and T = 1. The values in the run are measured."""
        chute = self.chute
        if self.stiffness is not None:
            e, e_w = chute.restitution, chute.wall_restitution
            return Contacts(self.stiffness, e, e_w, self.friction, self.bounds.restitution)
        return contacts_for(
            self.bounds,
            temperature=max(self.temperature or 0.0, 1.0),
            collision_rate=_COLLISION_RATE,
            restitution=chute.restitution,
            wall_restitution=chute.wall_restitution,
            friction=self.friction,
        )

    @property
    def top(self) -> float:
        """Height up to which layers are averaged; the last one takes all grains above."""
        return math.ceil(6.0 + 2.5 * self.holdup + 25.0 * max(self.temperature or 0.0, 1.0))

    def as_dict(self) -> dict[str, Any]:
        """All arguments by name, as JSON has them."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        chute = self.chute.as_dict()
        return values | {
            "chute": {name: chute[name] for name in ("slope", "restitution", "wall_restitution", "roughness")},
            "box": list(self.box),
            "bounds": asdict(self.bounds),
        }

    @classmethod
    def of(cls, values: dict[str, Any]) -> Scene:
        """The scene of :meth:`as_dict`.

        Raises:
            InputError: for names or values that no scene has.
        """
        try:
            given = dict(values)
            given["chute"] = Chute(**given["chute"])
            given["bounds"] = Bounds(**given["bounds"])
            given["box"] = tuple(given["box"])
            return cls(**given)
        except (TypeError, KeyError, AttributeError):
            raise InputError("this is no scene of chuteflow") from None


def _check_box(box: Any) -> tuple[float, float]:
    try:
        length, width = box
    except (TypeError, ValueError):
        raise InputError(f"box = {shorten(box)}: give length and width, such as 12x12") from None
    return number("length of the box", length, 3.0, 1e4), number("width of the box", width, 3.0, 1e4)


def _spacing(density: float) -> float:
    """L of a triangular lattice with so many bumps per unit area."""
    return math.sqrt(2.0 / (math.sqrt(3.0) * density))


def bump_positions(scene: Scene) -> Array:
    """Centres of the bumps in the plane, (bumps, 2)."""
    (along, across), spacing = scene.cells, scene.spacing
    i, j, k = np.meshgrid(np.arange(along), np.arange(across), np.arange(2), indexing="ij")
    x = (i + 0.25 + 0.5 * k) * math.sqrt(3.0) * spacing
    y = (j + 0.25 + 0.5 * k) * spacing
    lattice = np.column_stack([x.ravel(), y.ravel()])
    return lattice if scene.base == "triangular" else _shuffle(scene, lattice)


def _shuffle(scene: Scene, lattice: Array) -> Array:
    """Hard discs in random positions: Monte Carlo moves from a lattice, without overlap."""
    random = np.random.default_rng([scene.seed, 1])
    size, centres = np.array(scene.size), lattice.copy()
    reach = 0.7 * max(scene.spacing - scene.bump_diameter, 0.1 * scene.spacing)
    for _ in range(_SWEEPS):
        for i in random.permutation(len(centres)):
            moved = np.mod(centres[i] + random.uniform(-reach, reach, 2), size)
            away = centres - moved
            away -= size * np.round(away / size)
            squares = np.einsum("ij,ij->i", away, away)
            squares[i] = np.inf
            if squares.min() >= scene.bump_diameter**2:
                centres[i] = moved
    return centres


@dataclass(frozen=True, eq=False)
class Grains:
    """Positions and velocities, (grains, 3) each."""

    position: Array
    velocity: Array


def starting_grains(scene: Scene) -> Grains:
    """Grains at the start: sheets above the bumps, sites of a square lattice chosen at random in each, and random
    velocities of the temperature of the start, without mean across the slope and upward."""
    random = np.random.default_rng([scene.seed, 2])
    size = np.array(scene.size)
    sites = np.maximum((size / _APART).astype(int), 1)
    capacity = int(sites.prod())
    positions, left, sheet = [], scene.grains, 0
    while left > 0:
        count = min(left, capacity, max(_sheet_grains(scene, sheet), 1))
        chosen = random.permutation(capacity)[:count]
        place = (np.column_stack(np.divmod(chosen, sites[1])) + 0.5) * size / sites
        height = np.full((count, 1), 0.5 * scene.bump_diameter + 0.55 + _APART * sheet)
        positions.append(np.hstack([place, height]))
        left, sheet = left - count, sheet + 1
    velocity = random.normal(scale=math.sqrt(scene.temperature or 0.0), size=(scene.grains, 3))
    velocity -= velocity.mean(axis=0)
    return Grains(np.vstack(positions), velocity + np.array([scene.velocity, 0.0, 0.0]))


def _sheet_grains(scene: Scene, sheet: int) -> int:
    """Grains of a sheet at the start."""
    if scene.start == "cold":
        return round(_COLD_DENSITY * _APART * scene.area / MASS)
    # An isothermal gas: nu falls by e over a height T.
    scale = _APART / (scene.temperature or 1.0)
    return round(scene.grains * (math.exp(-sheet * scale) - math.exp(-(sheet + 1) * scale)))
