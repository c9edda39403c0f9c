"""The continuous steady problem in the overburden coordinate, with the closures tabulated.

# notation: p normal stress (the coordinate), P = p - p_S overburden, M hold-up, nu volume fraction,
# theta = ln T - Gamma(nu) heat potential, x = p exp(-theta) = g1 exp(Gamma), which is nu where dilute,
# y = q/(p sqrt(T)) heat flux, s slope.

At a given p, the potential theta fixes the density through x, which rises with nu. With ' = d/dp the problem
on p_S <= p <= p_S + M is

    y = a theta',    p T'/T = p theta' + k (1 - p theta'),    k = (g4/g3) dnu/dln x
    p y' + y + y (p T'/T)/2 = p (loss - s^2 work)    (3.9)
    y = y_S at p_S,    y = base(nu) at p_S + M       (3.17), (3.18) with F2 = g1 base

A law whose g4 grows like 1/nu where dilute, g4 = -b g3/nu, has T ~ p^(-beta) there, beta = b/(1 - b), and no
temperature far above. What stays finite is theta = (ln T - Gamma(nu))/(1 - b) with Gamma = -b ln nu + ..., which is
ln T + beta ln p far above. With x = p^(1 + beta) exp(-theta), a and k with respect to these, Gamma = ln(x/g1), and

    ln T = theta + Gamma - beta ln p,    p theta' - beta in place of p theta' on the right sides

the problem is the same, and beta = 0 gives the one above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from chuteflow.numerics.complex_step import stepped
from chuteflow.numerics.tabulate import Array, FunctionTable, PieceNodes, antiderivative, piece_nodes
from chuteflow.parameters import PARAMETERS
from chuteflow.steady.chute import Chute
from chuteflow.theory import boundary
from chuteflow.theory.bases import BASES, BaseCondition, base
from chuteflow.theory.constitutive import Law, dilute_drift, reduce, require_height, require_positive

#: Order of the functions of x in a table of closures: a, k, loss, work, shear and wall_shear as above and in
#: :class:`chuteflow.theory.constitutive.Reduced`; DENSITY ln(nu/x); GAMMA.
CONDUCTION, COUPLING, LOSS, WORK, SHEAR, WALL_SHEAR, DENSITY, GAMMA = range(8)

# Tables run over c = ln(1 + ln(1 + x/OFFSET)): linear in x where dilute, the dense range in few pieces.
OFFSET = 0.2
UPPER, _PIECES, _DEGREE = 4.2, 200, 7
#: Closures differ by less than the second number from one side of a break to the other, at this distance in ln x, where
#: they have no jump.
_BESIDE, _JUMP = 1e-9, 1e-7
#: After so small a step of Newton's method the next would be rounding.
_QUADRATIC = 1e-7


def closure_coordinate(x: Array) -> Array:
    """c, along which tables of closures run."""
    return np.log1p(np.log1p(x * (1.0 / OFFSET)))


def _argument(c: Array) -> Array:
    return OFFSET * np.expm1(np.expm1(c))


def closure_table(closure: Law, e: float, slope: float, on: BaseCondition = BASES["richman"]) -> FunctionTable:
    """The eight functions of x for ``closure``; the two of the base for that of the kind of ``on``."""
    return _closure_table(closure, e, slope if closure.knows_slope else 0.0, BASES[on.name])


# Keyed by the law itself: another may be registered under its name at any time.
@lru_cache(maxsize=32)
def _closure_table(chosen: Law, e: float, slope: float, on: BaseCondition) -> FunctionTable:
    b = dilute_drift(chosen, e, slope)
    breaks = chosen.breaks_at(float(np.real(e)), float(np.real(slope)))
    scaled_breaks = np.array([nu / (1.0 - nu / np.real(chosen.densest)) for nu in breaks])
    log_ratio, big_gamma = _density_tables(chosen, e, slope, b, tuple(closure_coordinate(scaled_breaks).tolist()))
    breaks_of_x = scaled_breaks
    if len(breaks):
        (there,) = log_ratio.values(closure_coordinate(scaled_breaks))
        breaks_of_x = closure_coordinate(scaled_breaks * np.exp(np.real(there)))
    nodes = _nodes(tuple(breaks_of_x.tolist()))
    ratio = _invert(log_ratio, nodes.argument)  # of density scaled by the free fraction to x
    scaled = nodes.argument * np.exp(ratio)
    r = reduce(chosen, scaled, e, slope)
    log_free_fraction = -np.log1p(scaled * (1.0 / chosen.densest))
    k = (r.drift + b * r.stiffness) / (r.stiffness + r.drift)
    if np.all(b == 0.0):
        (gamma,) = big_gamma.values(closure_coordinate(scaled))
    else:
        # ln T = theta + Gamma - beta ln p, which is ln p - ln g1
        gamma = -(ratio + log_free_fraction + np.log(r.compressibility))
    values = [r.conduction * (1.0 - b), k, r.loss, r.work, *on.functions(r), ratio + log_free_fraction, gamma]
    return nodes.pieces.table(np.stack(values, axis=-1))


@dataclass(frozen=True, eq=False)
class _Nodes:
    """The points of a table, and there the ``argument``, x or the scaled density, and its derivative with respect to
    the coordinate; arrays (k,)."""

    pieces: PieceNodes
    argument: Array
    by_coordinate: Array


@lru_cache(maxsize=8)
def _nodes(breaks: tuple[float, ...]) -> _Nodes:
    pieces = piece_nodes(0.0, UPPER, _PIECES, _DEGREE, breaks)
    argument = _argument(pieces.x)
    return _Nodes(pieces, argument, (argument + OFFSET) * (1.0 + np.log1p(argument / OFFSET)))


def evaluate_closures(table: FunctionTable, x: Array, side: Array | None = None) -> tuple[Array, Array]:
    """The eight functions of a ``table`` at x, and their derivatives with respect to ln x, each (8,) + x.shape; at a
    break those of the ``side`` on which that x lies, where it is given."""
    inner = np.log1p(x * (1.0 / OFFSET))
    values, slopes = table(np.log1p(inner), None if side is None else closure_coordinate(side))
    return values, slopes * (x / ((x + OFFSET) * (1.0 + inner)))


def _density_tables(
    chosen: Law, e: float, slope: float, b: Any, breaks: tuple[float, ...]
) -> tuple[FunctionTable, FunctionTable]:
    """ln(x / scaled density), and Gamma, against the coordinate of the scaled density nu/(1 - nu/nu*), of which
    ``breaks`` are places where the law is not smooth."""
    nodes = _nodes(breaks)
    r = reduce(chosen, nodes.argument, e, slope)
    free_fraction = 1.0 / (1.0 + nodes.argument / chosen.densest)
    rate = r.coupling * free_fraction**2  # dGamma/dscaled
    gamma = antiderivative(nodes.pieces.table((rate * nodes.by_coordinate)[:, None]))
    (big_gamma,) = gamma.values(nodes.pieces.x)
    log_g, log_free_fraction = np.log(r.compressibility), np.log(free_fraction)
    log_ratio = log_free_fraction + (log_g + big_gamma if np.all(b == 0.0) else (log_g + big_gamma) / (1.0 - b))
    return nodes.pieces.table(log_ratio[:, None]), gamma


@lru_cache(maxsize=1)
def _samples() -> tuple[Array, Array]:
    """Coordinates at which the linear inverse is known, and the logarithms of the scaled densities there."""
    samples = _argument(np.linspace(1e-9, UPPER, 400))
    return closure_coordinate(samples), np.log(samples)


def _invert(log_ratio: FunctionTable, x: Array) -> Array:
    """ln(scaled density / x) such that the density has this x, by Newton's method from a linear inverse."""
    log_x = np.log(np.maximum(x, 1e-300))
    samples, log_samples = _samples()
    (there,) = log_ratio.values(samples)
    log_scaled = np.interp(log_x, log_samples + there.real, log_samples)
    log_scaled = np.where(x < 1e-8, log_x, log_scaled)
    for _ in range(3):
        scaled = np.exp(log_scaled)
        inner = np.log1p(scaled * (1.0 / OFFSET))
        values, slopes = log_ratio(np.log1p(inner))
        by_log = scaled / ((scaled + OFFSET) * (1.0 + inner))  # derivative of the coordinate
        step = (log_scaled + values[0] - log_x) / (1.0 + slopes[0] * by_log)
        log_scaled = log_scaled - step
        # The imaginary part of a complex step is one iteration behind.
        if np.isrealobj(step) and np.abs(step).max() < _QUADRATIC:
            break
    return log_scaled - log_x


@dataclass(frozen=True, eq=False)
class Model:
    """The steady problem of one chute: closures and boundary data, ready to evaluate.

    ``slope`` and ``roughness`` are those of the chute, but where one is moved along by :func:`model_along`.
    ``law`` is the one that was registered under the name of the chute's closure when the model was made.
    """

    chute: Chute
    law: Law
    slope: float
    roughness: float
    table: FunctionTable
    surface_stress: float
    surface_flux: float
    base: BaseCondition
    base_loss: float
    loss_by_second: float
    slip_of_empty_base: float
    beta: float

    @property
    def unlimited(self) -> bool:
        """Whether the temperature has no limit far above, where it goes like p^(-beta)."""
        return self.beta != 0.0 and self.surface_stress == 0.0

    def density_argument(self, p: Array, theta: Array) -> Array:
        """x at normal stresses ``p`` and potentials ``theta``: p exp(-theta) but where beta is not 0."""
        if self.beta == 0.0:
            return p * np.exp(-theta)
        return np.exp((1.0 + self.beta) * log_stress(p) - theta)

    def log_temperature(self, p: Array, theta: Array, gamma: Array) -> Array:
        """ln T, given Gamma."""
        return theta + gamma if self.beta == 0.0 else theta + gamma - self.beta * log_stress(p)

    def closures(self, x: Array, side: Array | None = None) -> tuple[Array, Array]:
        """The eight functions at x, and their derivatives with respect to ln x, each (8,) + x.shape."""
        return evaluate_closures(self.table, x, side)

    def slip(self, closures: Array) -> Array:
        """F1 of (3.16)."""
        return self.base.slip(closures[SHEAR], closures[WALL_SHEAR], self.roughness, self.slope)

    def slip_slope(self, slopes: Array) -> Array:
        """Derivative of F1, given those of the closures: F1 is affine in them."""
        return self.slip(slopes) - self.slip_of_empty_base

    def base_flux(self, closures: Array) -> Array:
        """Heat flux y = q/(p sqrt(T)) that the base gives: s F1 - loss, which is F2/g1 of (3.18)."""
        flux = self.slope * self.slip(closures) - self.base_loss
        return flux if self.loss_by_second == 0.0 else flux - self.loss_by_second * closures[WALL_SHEAR]

    def base_flux_slope(self, slopes: Array) -> Array:
        """Derivative of the flux that the base gives, given those of the closures: it is affine in them."""
        slope = self.slope * self.slip_slope(slopes)
        return slope if self.loss_by_second == 0.0 else slope - self.loss_by_second * slopes[WALL_SHEAR]

    @cached_property
    def kinks(self) -> Array:
        """ln x at which the closures are not smooth, ascending."""
        return np.log(_argument(np.array(self.table.breaks)))

    def kinks_at(self, which: Sequence[int]) -> Array:
        """Some of the kinks by their index; not a number where there is none."""
        there = np.append(self.kinks, np.nan)
        return there[np.minimum(which, len(self.kinks))]

    @cached_property
    def kinks_join(self) -> bool:
        """Whether the closures are continuous there: all but COUPLING are, where g0 has a kink and g4 is not 0."""
        below, above = (self.closures(np.exp(self.kinks + side))[0][COUPLING] for side in (-_BESIDE, _BESIDE))
        return bool(np.abs(above - below).max(initial=0.0) < _JUMP)

    @cached_property
    def flux_scale(self) -> float:
        """The size of heat fluxes y: the largest of those that the base gives, and at which loss balances
        conduction."""
        f, _ = self.closures(np.append(0.0, np.geomspace(1e-3, 1e6, 64)))
        net = f[LOSS] - self.slope**2 * f[WORK]
        balance = np.sqrt(2.0 * np.maximum(net, 0.0) * f[CONDUCTION])
        return max(float(balance.max()), float(np.abs(self.base_flux(f)).max()), 1e-3)

    @cached_property
    def constants(self) -> Array:
        """Slope, p_S, y_S, base loss, the slip coefficient F1 as an affine function of the two functions of the base,
        beta, and the factor of the second function in the loss, (9,)."""
        unit = np.zeros((8, 2))
        unit[SHEAR, 0] = unit[WALL_SHEAR, 1] = 1.0
        by_shear, by_grip = self.slip_slope(unit)
        return np.array(
            [
                self.slope, self.surface_stress, self.surface_flux, self.base_loss,
                self.slip_of_empty_base, by_shear, by_grip, self.beta, self.loss_by_second,
            ]
        )  # fmt: skip


def beta_of(b: Any) -> Any:
    """beta = b/(1 - b)."""
    return b / (1.0 - b)


def log_stress(p: Array) -> Array:
    """ln p, as small as there are numbers at p = 0."""
    return np.log(np.where(p == 0.0, np.finfo(float).tiny, p))


def model(chute: Chute) -> Model:
    """The continuous problem of ``chute``, with the law that is registered now.

    Raises:
        InputError: where that law has no meaning for the chute.
    """
    return _model_of(chute, chute.law)


@lru_cache(maxsize=64)
def _model_of(chute: Chute, chosen: Law) -> Model:
    # The chute may be older than the law.
    require_positive(chosen, chute.restitution, chute.slope)
    if chute.surface == "free":
        require_height(chosen, chute.restitution, chute.slope)
    on = base(chute.base)
    return _model(chute, chosen, _parameters(chute), closure_table(chosen, chute.restitution, chute.slope, on), on)


def model_along(chute: Chute, parameter: str, value: float) -> tuple[Model, Model]:
    """The continuous problem with one ``parameter`` of ``chute`` at ``value``, and that an imaginary step further.

    The imaginary parts of what the second model gives, over the step, are exact derivatives with respect to the
    parameter (:mod:`chuteflow.numerics.complex_step`). The value may lie a little beyond what a chute allows.
    ``parameter`` is one of PARAMETERS.
    """
    at = _parameters(chute) | {parameter: value}
    beyond: dict[str, Any] = at | {parameter: np.complex128(stepped(value))}
    chosen, on = chute.law, base(chute.base)
    table_beyond = closure_table(chosen, beyond["restitution"], beyond["slope"], on)
    table = replace(table_beyond, coefficients=np.ascontiguousarray(table_beyond.coefficients.real))
    return _model(chute, chosen, at, table, on), _model(chute, chosen, beyond, table_beyond, on)


def step_model(chute: Chute, parameter: str) -> Model:
    """The continuous problem of ``chute`` an imaginary step of one parameter further, see :func:`model_along`.

    ``parameter`` is one of PARAMETERS, or ``closure.NAME`` or ``base.NAME`` for a parameter of the law or the base.
    """
    values: dict[str, Any] = _parameters(chute)
    chosen, on = chute.law, base(chute.base)
    where, _, name = parameter.rpartition(".")
    if where == "closure":
        chosen = chosen.stepped(name)
    elif where == "base":
        on = on.stepped(name)
    else:
        values[name] = np.complex128(stepped(values[name]))
    return _model(chute, chosen, values, closure_table(chosen, values["restitution"], values["slope"], on), on)


def _parameters(chute: Chute) -> dict[str, Any]:
    return {name: getattr(chute, name) for name in PARAMETERS}


def _model(chute: Chute, chosen: Law, parameters: dict[str, Any], table: FunctionTable, on: BaseCondition) -> Model:
    slope, roughness = parameters["slope"], parameters["roughness"]
    loss, loss_by_second = on.loss(parameters["wall_restitution"], roughness)
    return Model(
        chute=chute,
        law=chosen,
        slope=slope,
        roughness=roughness,
        table=table,
        surface_stress=boundary.surface_stress(chute.surface),
        surface_flux=boundary.surface_flux(chute.surface, slope),
        base=on,
        base_loss=loss,
        loss_by_second=loss_by_second,
        beta=beta_of(dilute_drift(chosen, parameters["restitution"], slope)),
        slip_of_empty_base=np.asarray(on.slip(np.zeros(()), np.zeros(()), roughness, slope)).item(),
    )
