"""A steady flow: its numbers, its kind, and its fields as smooth functions of height."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from chuteflow import display
from chuteflow.checks import number, real_array, whole
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.numerics.roots import secants
from chuteflow.result import Result
from chuteflow.steady.chute import Chute
from chuteflow.steady.collocation import LOG_H, LOG_M, LOG_Q, LOG_T, State, stretch_map, stretch_position
from chuteflow.steady.kinds import density_kind, interior_kind
from chuteflow.steady.model import CONDUCTION, COUPLING, DENSITY, GAMMA, LOSS, WORK, Model
from chuteflow.steady.names import name_of
from chuteflow.steady.quantities import BY_SYMBOL, FIELDS, NUMBERS, PLACE
from chuteflow.steady.solver import Solution
from chuteflow.steady.validity import MEAN_FREE_PATH, Validity
from chuteflow.theory.constitutive import Law

if TYPE_CHECKING:
    from chuteflow.steady.sensitivity import Sensitivity

#: Fraction of the largest volume fraction that marks the depth in earlier studies (section 3.3).
CUTOFF = 0.01
#: Degree of the grid on which kinds (inverted, productive) are decided, if it is finer than the solution's.
_SAMPLES = 96
#: The density is taken to rise or fall where p dtheta/dp differs by so much from 1.
_LEVEL = 1e-8
#: Heights of a profile at most.
_MOST_POINTS = 1_000_000
#: Far above the base, what falls off exponentially becomes zero.
_vanishing = np.errstate(under="ignore")
#: Samples of an element, its ends among them.
_WITHIN_ELEMENT = np.linspace(0.0, 1.0, 7)[:-1]
#: Fraction P/M of the overburden above the highest point that is distinguished from the far field.
_SMALLEST_SHARE = 1e-260


@dataclass(frozen=True, eq=False)
class Profile(Result):
    """Fields at given heights, arrays of one shape; dimensionless, see chuteflow.steady.quantities.FIELDS.

    The normal stress is the weight of the grains above (3.2), (3.4), and the shear stress tan(theta) times that
    (3.1), (3.5); the heat flux has the two parts of (3.6), and the dissipation is (3.7).
    """

    height: Array
    volume_fraction: Array
    granular_temperature: Array
    velocity: Array
    heat_flux: Array
    conductive_heat_flux: Array
    density_heat_flux: Array
    normal_stress: Array
    shear_stress: Array
    shear_rate: Array
    production: Array
    dissipation: Array

    def __repr__(self) -> str:
        heights = np.ravel(self.height)
        return display.line("Profile", display.count_of(heights.size, "height"), display.span("z", heights))

    def _repr_html_(self) -> str:
        columns = [np.ravel(getattr(self, name)) for name in FIELDS]
        rows = [[display.number(value) for value in row] for row in zip(*columns, strict=True)]
        return display.html_table("Fields over height", [FIELDS[name].symbol for name in FIELDS], rows)


@dataclass(frozen=True)
class EnergyBudget:
    """Rates of fluctuation energy per unit area of the base, in rho_p (g d cos theta)^(3/2).

    Slip at the base works ``slip_work``, of which collisions with the base take ``base_loss``; the rest is
    ``heat_from_base``, negative where the base takes heat from the flow. With ``shear_work`` of the interior it
    balances ``dissipation`` in collisions of the grains (3.3) and ``heat_through_surface``, which is 0 on the
    half-line and negative at an interface, where the free grains bring heat.
    """

    slip_work: float
    base_loss: float
    shear_work: float
    dissipation: float
    heat_through_surface: float

    @property
    def heat_from_base(self) -> float:
        """Flux of heat from the base into the flow, (2.15)."""
        return self.slip_work - self.base_loss


@dataclass(frozen=True, eq=False)
class Flow(Result):
    """A steady, fully developed flow on ``chute``.

    All numbers are dimensionless (lengths in grain diameters d, velocities in sqrt(g d cos theta),
    temperatures in g d cos theta, stresses in rho_p g d cos theta). ``error`` is the estimated relative
    error, the largest of mass flux, centre of mass and hold-up.
    """

    chute: Chute
    solution: Solution

    def __repr__(self) -> str:
        numbers = {NUMBERS[name].symbol: getattr(self, name) for name in PLACE}
        said = self.name if self.law.known else f"closure {self.law} not registered here"
        return display.line("Flow", said, **numbers, error=self.error)

    def _repr_html_(self) -> str:
        rows = [(q.symbol, display.number(getattr(self, name)), q.description) for name, q in NUMBERS.items()]
        rows.append(("error", display.number(self.error), "estimated relative error of Q, h and M, the largest"))
        kinds = f"density {self.density}, interior {self.interior}; {self.validity.summary}"
        return display.html_table(f"Flow: {self.name}", ("", "", ""), rows, kinds)

    def _comparison_key(self) -> tuple[object, ...]:
        solution = self.solution
        return self.chute, solution.macroscopic, solution.error, solution.status.name

    def _mark(self) -> bytes:
        return self.solution.macroscopic.tobytes()

    def __getattr__(self, symbol: str) -> float:
        """A number by its symbol, such as Q, h, M and T_surface."""
        name = BY_SYMBOL.get(symbol)
        if name is None:
            raise AttributeError(f"'Flow' object has no attribute {symbol!r}")
        return getattr(self, name)

    @property
    def name(self) -> str:
        """What it is called by its own numbers, such as "hot, dilute, deep", see :mod:`chuteflow.steady.names`."""
        return name_of(self.surface_temperature, self.largest_volume_fraction, self.centre_of_mass)

    @property
    def mass_flux(self) -> float:
        """Q, (3.26)."""
        return self._macroscopic(LOG_Q)

    @property
    def centre_of_mass(self) -> float:
        """h, (3.27)."""
        return self._macroscopic(LOG_H)

    @property
    def mass_holdup(self) -> float:
        """M, (3.27)."""
        return self._macroscopic(LOG_M)

    @property
    def surface_temperature(self) -> float:
        """T far above (half-line) or at the interface."""
        return self._macroscopic(LOG_T)

    @property
    def law(self) -> Law:
        """The constitutive law that it was solved with, whatever is registered under its name now."""
        source = self.solution.source
        return source if isinstance(source, Law) else self._model.law

    @property
    def error(self) -> float:
        """Estimated relative error of Q, h and M, the largest."""
        return self.solution.error

    @property
    def base_temperature(self) -> float:
        """T at the base."""
        return float(np.exp(self._state.log_t[-1]))

    @property
    def base_volume_fraction(self) -> float:
        """nu at the base."""
        return self._below_packing(_density(self._state.x, self._state.f)[-1])

    @property
    def slip_velocity(self) -> float:
        """u at the base, (3.15)."""
        return float(self._slip)

    @cached_property
    def largest_volume_fraction(self) -> float:
        """The largest nu in the flow."""
        return self._below_packing(self._at_share(self._share_of_largest)[0]["nu"][0])

    def _below_packing(self, nu: float) -> float:
        """A volume fraction, which rounding does not lift to that of the densest packing, where grains cannot come."""
        return min(float(nu), float(np.nextafter(self.law.densest, 0.0)))

    @property
    def interface_height(self) -> float:
        """H, the height of the interface; infinite on the half-line (section 3.7)."""
        if self._model.surface_stress == 0.0:
            return float("inf")
        return float(self._heights(np.zeros(1))[0])

    @cached_property
    def depth(self) -> float:
        """Height above which nu is below 1 % of its maximum, or of the interface where it stays above."""
        return float(self._heights(np.array([self._share_above_depth]))[0])

    @cached_property
    def _share_above_depth(self) -> float:
        """Fraction of the mass hold-up above the depth: 0 where that is the height of the interface."""
        target = np.log(CUTOFF * self.largest_volume_fraction)
        if self._model.surface_stress and self._log_density(0.0) >= target:
            return 0.0
        low, high = np.log(_SMALLEST_SHARE), np.log(self._share_of_largest[0])
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self._log_density(np.exp(middle)) < target:
                low = middle
            else:
                high = middle
        return float(np.exp(0.5 * (low + high)))

    @property
    def mean_velocity(self) -> float:
        """Q/M, the velocity of the grains averaged over their mass."""
        return self.mass_flux / self.mass_holdup

    @property
    def surface_velocity(self) -> float:
        """u far above (half-line) or at the interface."""
        return float(self._velocities(np.zeros(1))[0])

    @property
    def mean_volume_fraction(self) -> float:
        """nu averaged over heights from the base to the depth."""
        return self.mass_holdup * (1.0 - self._share_above_depth) / self.depth

    @property
    def froude_number(self) -> float:
        """Mean velocity over sqrt(g cos(theta) depth)."""
        return self.mean_velocity / math.sqrt(self.depth)

    @property
    def angle(self) -> float:
        """Inclination of the chute in degrees."""
        return self.chute.angle

    @cached_property
    def interior(self) -> str:
        """ "dissipative" or "productive" throughout, or "mixed"."""
        net = self._samples["net"]
        # Net loss within rounding of zero decides nothing.
        return interior_kind(net.min(), net.max(), 1e-12 * np.abs(net).max())

    @property
    def density(self) -> str:
        """ "inverted" where the volume fraction rises with height anywhere, else "monotonic"."""
        return density_kind(self.density_excess)

    @cached_property
    def density_excess(self) -> float:
        """Largest d ln nu/d ln p below zero, as p dtheta/dp - 1: positive where the density is inverted."""
        return float(self._samples["rise"].max() - 1.0)

    @cached_property
    def net_loss_range(self) -> tuple[float, float]:
        """Smallest and largest dissipation minus production over nu p sqrt(T) in the flow."""
        net = self._samples["net"]
        return float(net.min()), float(net.max())

    @cached_property
    def validity(self) -> Validity:
        """How far the flow keeps to what the theory takes for granted."""
        problem, state = self.solution.problem, self._state
        chosen = self.law
        nu = _density(state.x, state.f)
        # Rounding does not let grains be packed to the last.
        free_fraction = np.maximum(1.0 - nu / chosen.densest, np.finfo(float).eps)
        contacts = (
            nu * chosen.called(chosen.coefficients, nu, free_fraction, self.chute.restitution, self.chute.slope).radial
        )
        per_grain = problem.grid.weights / state.s_p / state.mass
        largest = self.largest_volume_fraction
        return Validity(
            largest_volume_fraction=largest,
            packing=largest / chosen.densest,
            slip_ratio=float(self._model.slip(state.f[:, -1])),
            knudsen_number=MEAN_FREE_PATH / float(per_grain @ contacts) / self.centre_of_mass,
            density_turns=self._density_turns,
            dense_limit=chosen.dense_limit,
        )

    @property
    def _density_turns(self) -> int:
        rise = self._samples["rise"] - 1.0
        signs = np.sign(rise[np.abs(rise) > _LEVEL])
        return int(np.count_nonzero(np.diff(signs)))

    @cached_property
    def energy_budget(self) -> EnergyBudget:
        """Where fluctuation energy comes from and goes to, in the whole flow."""
        problem, state, model = self.solution.problem, self._state, self._model
        flux_scale = state.p * np.exp(0.5 * state.log_t)  # p sqrt(T)
        per_node = problem.grid.weights / state.s_p * flux_scale
        slip_work = model.slope * float(state.p[-1]) * self.slip_velocity
        return EnergyBudget(
            slip_work=slip_work,
            base_loss=slip_work - float(model.base_flux(state.f[:, -1]) * flux_scale[-1]),
            shear_work=model.slope**2 * float(per_node @ state.f[WORK]),
            dissipation=float(per_node @ state.f[LOSS]),
            heat_through_surface=model.surface_flux * float(flux_scale[0]),
        )

    def profile(self, z: ArrayLike) -> Profile:
        """All fields at heights ``z`` >= 0 (array), in any order; above an interface they are not defined.

        Raises:
            InputError: for a height below the base or above the interface.
        """
        z = real_array("z", z)
        flat = z.ravel()
        highest = self.interface_height
        if flat.size and not (np.isfinite(flat).all() and flat.min() >= 0.0 and flat.max() <= highest * (1 + 1e-12)):
            raise InputError(f"heights must be from 0 (base) to {highest}: got {flat.min()} to {flat.max()}")
        fields = self._fields(self._shares_at(flat))
        return Profile(height=z.copy(), **{name: values.reshape(z.shape) for name, values in fields.items()})

    def at_overburden(self, share: ArrayLike) -> Profile:
        """All fields where ``share`` (array, above 0 and at most 1) of the mass hold-up lies above, exactly there.

        Raises:
            InputError: for a fraction out of range.
        """
        share = real_array("share", share)
        if not (share.size and share.min() > 0.0 and share.max() <= 1.0):
            raise InputError("fractions of the overburden must be above 0 (surface) and at most 1 (base)")
        return Profile(height=self._heights(share), **self._fields(share))

    def sampled(self, points: int = 201, top: float | None = None) -> Profile:
        """All fields at ``points`` heights, spaced evenly from the base to ``top``, by default the depth."""
        points = whole("points", points, 1, _MOST_POINTS)
        return self.profile(np.linspace(0.0, self.depth if top is None else number("top", top), points))

    def sensitivity(self, parameters: Sequence[str] | None = None, *, at: str = "Q") -> Sensitivity:
        """Exact derivatives of all quantities and profiles with respect to parameters of the chute, see
        :func:`chuteflow.steady.sensitivity.sensitivity`."""
        from chuteflow.steady.sensitivity import sensitivity

        return sensitivity(self, parameters, at=at)

    @property
    def _model(self) -> Model:
        return self.solution.problem.model

    @property
    def _state(self) -> State:
        return self.solution.state

    def _macroscopic(self, which: int) -> float:
        return float(np.exp(self.solution.macroscopic[which]))

    @property
    def _slip(self) -> Array:
        state = self._state
        return self._model.slip(state.f[:, -1]) * np.exp(0.5 * state.log_t[-1])

    @property
    def _limit(self) -> Array:
        """The surface temperature; where T has no limit far above, of T p^beta."""
        return np.exp(self.solution.macroscopic[LOG_T])

    @_vanishing
    def _at_share(self, share: Array) -> tuple[dict[str, Array], Array]:
        """Potential, gradient, closures and density at fractions m = P/M of the overburden."""
        problem, state = self.solution.problem, self._state
        s = stretch_position(share, problem.stretch)
        theta, g = problem.grid.interpolate(np.stack([state.theta, state.g]), s)
        return self._pointwise(state.mass * share + self._model.surface_stress, theta, g)

    def _pointwise(self, p: Array, theta: Array, g: Array) -> tuple[dict[str, Array], Array]:
        """What follows from the normal stress, the potential and its gradient, at any points."""
        x = self._model.density_argument(p, theta)
        f, _ = self._model.closures(x)
        rise = p * g / self._state.mass - self._model.beta
        fields = {
            "p": p,
            "nu": _density(x, f),
            "y": f[CONDUCTION] * g / self._state.mass,
            "rise": rise,
            "log_t": self._model.log_temperature(p, theta, f[GAMMA]),
        }
        return fields, f

    def _log_density(self, share: float) -> float:
        return float(np.log(self._at_share(np.array([share]))[0]["nu"][0]))

    @cached_property
    def _samples(self) -> dict[str, Array]:
        """What kinds are distinguished from, see :func:`_samples_of`."""
        return _samples_of(self._state)

    @cached_property
    def _share_of_largest(self) -> Array:
        """Fraction of the overburden at the largest nu: where p dtheta/dp = 1, or at an end."""
        # Where grains are packed almost densest, samples alone do not tell.
        return max(self._locate_largest(), np.ones(1), key=lambda share: self._log_density(float(share[0])))

    def _locate_largest(self) -> Array:
        """Where nu is largest beside the largest of the samples."""
        share, nu = self._samples["share"], self._samples["nu"]
        k = int(np.argmax(nu))
        if k in (0, len(nu) - 1):
            return share[k : k + 1]
        below, above = (float(self._samples["rise"][i] - 1.0) for i in (k - 1, k + 1))

        def rise(at: float) -> float:
            return float(self._at_share(np.array([at]))[0]["rise"][0] - 1.0)

        # The density is flat there: half the digits of the place are all of its own.
        return np.array([secants(rise, (share[k - 1], share[k + 1]), (below, above), share[k], _LEVEL)])

    @cached_property
    def _antiderivatives(self) -> tuple[Array, Array]:
        """At the nodes, integrals over the overburden from the base up: the regular parts of z and u."""
        problem, state = self.solution.problem, self._state
        g = problem.grid
        span = 1.0 / state.s_p  # dp/ds
        if self._model.beta == 0.0:
            per_fall = np.exp(state.theta - state.f[DENSITY])  # dz/d ln p, which is T_surface at p = 0
        else:
            per_fall = state.p / np.maximum(_density(state.x, state.f), _SMALLEST_SHARE)
        if self._model.unlimited:
            # Less what goes like p^(-1-beta); the first piece of the grid is too short to count.
            beta = self._model.beta
            power = state.p[1:] ** -(1.0 + beta)
            regular = np.zeros_like(span)
            regular[1:] = (per_fall[1:] / state.p[1:] - self._limit * power) * span[1:]
        elif self._model.surface_stress == 0.0:
            regular = np.empty_like(span)
            regular[1:] = (per_fall[1:] - per_fall[0]) / state.p[1:] * span[1:]
            regular[0] = g.differentiate(per_fall)[0]
        else:
            regular = per_fall / state.p * span
        shear_rate = self._model.slope * state.f[WORK] * np.exp(0.5 * state.log_t) * span
        if self._model.unlimited:
            # Less what goes like sqrt(T) far above.
            shear_rate[1:] -= self._shear_far_above * state.p[1:] ** (-0.5 * self._model.beta) * span[1:]
            shear_rate[0] = 0.0
        height, velocity = g.integrate(np.stack([regular, shear_rate]))
        return height[-1] - height, self._slip + velocity[-1] - velocity

    @property
    def _shear_far_above(self) -> Any:
        """Where T has no limit far above: du/dp p^(beta/2) there."""
        return self._model.slope * self._state.f[WORK, 0] * np.sqrt(self._limit)

    def _velocities(self, share: Array) -> Array:
        s = stretch_position(share, self.solution.problem.stretch)
        velocity = self.solution.problem.grid.interpolate(self._antiderivatives[1], s)
        if self._model.unlimited:
            mass, power = self._state.mass[0], 1.0 - 0.5 * self._model.beta
            powers = mass**power - (mass * np.maximum(share, _SMALLEST_SHARE)) ** power
            velocity = velocity + self._shear_far_above / power * powers
        return velocity

    def _heights(self, share: Array) -> Array:
        s = stretch_position(share, self.solution.problem.stretch)
        z = self.solution.problem.grid.interpolate(self._antiderivatives[0], s)
        if self._model.unlimited:
            beta, mass = self._model.beta, self._state.mass[0]
            powers = (mass * np.maximum(share, _SMALLEST_SHARE)) ** -beta - mass**-beta
            z = z + self._limit / beta * powers
        elif self._model.surface_stress == 0.0:
            z = z - self._limit * np.log(np.maximum(share, _SMALLEST_SHARE))
        return z

    def _shares_at(self, z: Array) -> Array:
        """Fractions of the overburden at heights z. Those of the last heights are kept: fields, their derivatives in
        height and those with respect to parameters are asked for at the same ones."""
        kept: tuple[Array, Array] | None = self.__dict__.get("_last_shares")
        if kept is None or not np.array_equal(kept[0], z):
            kept = z.copy(), self._find_shares(z)
            kept[1].setflags(write=False)
            self.__dict__["_last_shares"] = kept
        return kept[1]

    @_vanishing
    def _find_shares(self, z: Array) -> Array:
        """Fractions of the overburden at heights z: Newton's method in ln p, along which dz = -(p/nu) d ln p."""
        state, p_s = self._state, self._model.surface_stress
        samples = self._samples["share"].copy()
        if p_s == 0.0:
            samples[0] = _SMALLEST_SHARE
        log_p = np.interp(z, self._heights(samples)[::-1], np.log(state.mass * samples + p_s)[::-1])
        low, high = np.log(state.mass * samples[0] + p_s), np.log(state.mass + p_s)
        for _ in range(60):
            share = np.clip((np.exp(log_p) - p_s) / state.mass, 0.0, 1.0)
            fields, _ = self._at_share(share)
            height_rate = np.exp(log_p) / fields["nu"]
            move = np.clip((self._heights(share) - z) / height_rate, -50.0, 50.0)
            log_p = np.clip(log_p + move, low, high)
            if np.abs(move).max(initial=0.0) < 1e-13 * max(1.0, float(np.abs(log_p).max(initial=0.0))):
                break
        return np.clip((np.exp(log_p) - p_s) / state.mass, 0.0, 1.0)

    @_vanishing
    def _fields(self, share: Array) -> dict[str, Array]:
        return self._local(*self._at_share(share)) | {"velocity": self._velocities(share)}

    def _local(self, at: dict[str, Array], f: Array) -> dict[str, Array]:
        """The fields that follow from what :meth:`_pointwise` gives."""
        slope, p, nu, rise = self._model.slope, at["p"], at["nu"], at["rise"]
        root_t = np.exp(0.5 * at["log_t"])
        conducting, beta = f[CONDUCTION] * root_t, self._model.beta
        if beta == 0.0:
            conductive = conducting * (rise + f[COUPLING] * (1.0 - rise))
            along_density = -conducting * f[COUPLING] * (1.0 - rise)
        else:
            conductive = (1.0 + beta) * conducting * (rise + f[COUPLING] * (1.0 - rise))
            along_density = conducting * (rise + beta) - conductive
        return {
            "volume_fraction": nu,
            "granular_temperature": root_t**2,
            "heat_flux": at["y"] * p * root_t,
            "conductive_heat_flux": conductive,
            "density_heat_flux": along_density,
            "normal_stress": p,
            "shear_stress": -slope * p,
            "shear_rate": slope * f[WORK] * nu * root_t,
            "production": slope**2 * f[WORK] * nu * p * root_t,
            "dissipation": f[LOSS] * nu * p * root_t,
        }


def flows_of(chute: Chute, solutions: Sequence[Solution]) -> list[Flow]:
    """The flows of many ``solutions`` on ``chute``."""
    return [Flow(chute, solution) for solution in solutions]


def rough_kinds(solutions: Sequence[Solution]) -> Array:
    """Density excess, smallest and largest net loss of flows of one chute as in :class:`Flow`, (k, 3), to about 1e-7:
    from their elements."""
    model = solutions[0].elements.model
    parts, firsts = [], [0]
    for solution in solutions:
        e = solution.elements
        s = np.append((e.breaks[:-1, None] + np.diff(e.breaks)[:, None] * _WITHIN_ELEMENT).ravel(), 1.0)
        theta, y = e.at(s).T
        share, _ = stretch_map(s, e.stretch)
        parts.append(np.stack([np.exp(e.log_mass) * share + model.surface_stress, theta, y]))
        firsts.append(firsts[-1] + len(s))
    p, theta, y = np.concatenate(parts, axis=1)
    f, _ = model.closures(model.density_argument(p, theta))
    rise, net = p * y / f[CONDUCTION] - (1.0 + model.beta), f[LOSS] - model.slope**2 * f[WORK]
    each = firsts[:-1]
    return np.stack(
        [np.maximum.reduceat(rise, each), np.minimum.reduceat(net, each), np.maximum.reduceat(net, each)], axis=1
    )


@_vanishing
def _samples_of(state: State) -> dict[str, Array]:
    """Fraction of the overburden, nu, p dtheta/dp and net loss on a fine grid, each (..., nodes)."""
    problem = state.problem
    fine = replace(problem, degree=max(_SAMPLES // (len(problem.breaks) - 1), 2 * problem.degree))
    nodal = np.stack([_density(state.x, state.f), state.rise, state.net_loss])
    nu, rise, net = problem.grid.interpolate(nodal, fine.grid.nodes)
    return {"share": fine.fraction[0], "nu": nu, "rise": rise, "net": net}


def _density(x: Array, f: Array) -> Array:
    return x * np.exp(f[DENSITY])
