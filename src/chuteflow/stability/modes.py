"""Normal modes of a steady flow: computed twice, distinguished from the continuous spectrum, each with its error.

An eigenvalue of the coarse grid is a mode if

- its density is resolved: the last coefficients of its Chebyshev series are small;
- it comes back on a finer grid, with another map that reaches farther: the change is its error;
- that change is a small part of its distance to the continuous spectrum.

The continuous spectrum never grows. A mode that runs into it is no longer reported. An eigenvalue that grows on
the coarse grid is followed to the finest, until it is a mode, or is gone, or keeps changing from grid to grid.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from chuteflow import display
from chuteflow.checks import real
from chuteflow.errors import InputError, SolveError
from chuteflow.numerics.chebyshev import Array, grid
from chuteflow.numerics.eigenproblem import Complex, refine_eigenvalue, spectrum
from chuteflow.result import Compared
from chuteflow.stability.base import BESIDE, BaseState, Resolution, base, overburden_fractions
from chuteflow.stability.essential import distance, relaxation
from chuteflow.stability.linear import ALONG, DENSITY, FIELDS, Operator, operator, without_top
from chuteflow.steady.flow import Flow

#: Degrees of the coarse and fine grids, tried in turn, and the weights of their maps for each unit of
#: ln(1 + M/T) + k T: what is dense or short in z needs points near the base.
DEGREES = ((32, 44), (48, 64), (72, 96))
_WEIGHTS, _LARGEST_WEIGHT = (0.5, 0.8), 16.0
#: Degree of the coarsest grid, on which wavenumbers are searched for what may grow.
_SCREEN = 20
#: How far the grids reach, in ln p, for k h >= _SHORT M, and more for longer waves.
_REACH, _SHORT = ((10.5, 13.0), (12.0, 14.5), (13.5, 16.5)), 1.0 / 60.0
#: Steps in which the reach grows, so that wavenumbers share grids.
_STRIDE = 1.5
#: Largest fraction of the last coefficients of a resolved density.
_TAIL = 0.03
#: Largest fraction that the change between grids may have in the distance to the continuous spectrum; what moves by
#: more than the second on the finest grids is an artefact of them.
_DRIFT, _ARTEFACT = 1e-3, 0.03
#: Default error of a rate; relative for rates above 1.
TOLERANCE = 1e-6
#: Growth that counts as none, in sqrt(g cos(theta)/h); and a rate at k = 0 that is that of the mass mode.
NEUTRAL, AT_REST = 1e-6, 1e-10
#: M/T_surface from which the coldness of a flow is why grids do not resolve it.
_COLD = 1e3
#: Smallest and largest wavenumber that is not 0, in 1/d.
_SMALLEST, _LARGEST = 1e-15, 1e4


class UnresolvedError(SolveError):
    """Something seems to grow at ``kx``, ``ky`` that the finest grids do not resolve: whether it does is not known."""

    def __init__(self, flow: Flow, kx: float, ky: float) -> None:
        self.kx, self.ky = kx, ky
        coldness = flow.mass_holdup / flow.surface_temperature
        cold = f", as happens in flows as cold as M/T_surface = {coldness:.2g}" if coldness > _COLD else ""
        super().__init__(
            f"not known at kx = {kx:g}, ky = {ky:g}: a rate that seems to grow there changes from grid to grid up to "
            f"degree {DEGREES[-1][1]}{cold}; take other wavenumbers, nearby ones can be known"
        )


@dataclass(frozen=True, eq=False)
class Mode(Compared):
    """A disturbance exp(``sigma`` t + i (kx x + ky y)) of ``flow``; ``error`` is the estimated one of sigma.

    Rates are in sqrt(g cos(theta)/d), wavenumbers in 1/d.
    """

    flow: Flow
    kx: float
    ky: float
    sigma: complex
    error: float
    operator: Operator = field(compare=False)
    vector: Complex

    def __repr__(self) -> str:
        numbers = {"kx": self.kx, "ky": self.ky, "growth": self.growth, "frequency": self.frequency}
        return display.line("Mode", self.kind, **numbers, error=self.error)

    @property
    def growth(self) -> float:
        """Growth rate, negative where the disturbance decays."""
        return self.sigma.real

    @property
    def frequency(self) -> float:
        """Angular frequency: crests go as exp(i (kx x + ky y - frequency t))."""
        return -self.sigma.imag

    @property
    def speed(self) -> float | None:
        """Speed of the crests down the slope; None for disturbances that do not vary along it."""
        return self.frequency / self.kx if self.kx else None

    @property
    def kind(self) -> str:
        """ "mass" for the neutral mode that leads to the neighbouring steady flow, else :attr:`direction`."""
        return "mass" if self.direction == "uniform" and abs(self.sigma) < AT_REST else self.direction

    @property
    def direction(self) -> str:
        """ "uniform", "along" the slope, "across" it or "oblique", by the wavenumbers."""
        if self.kx == 0.0 and self.ky == 0.0:
            return "uniform"
        if self.ky == 0.0:
            return "along"
        return "across" if self.kx == 0.0 else "oblique"

    @cached_property
    def height(self) -> Array:
        """Heights at which the fields of :meth:`fields` are given, from far above down to the base."""
        return self.operator.base.profile.height

    @cached_property
    def fields(self) -> Complex:
        """nu', u, v, w and T' at :attr:`height`, (5, n): the largest of u, v, w is 1, and real."""
        profile = self.operator.base.profile
        relative = relative_fields(self.operator, self.vector)
        out = relative.copy()
        out[0] *= profile.volume_fraction
        out[-1] *= profile.granular_temperature
        velocity = out[ALONG:-1]
        return out / velocity.ravel()[np.abs(velocity).argmax()]

    def sampled(self, points: int = 201) -> tuple[Array, Complex]:
        """Heights (points,) from the base up, and the fields there, (5, points): as smooth as they are."""
        base_ = self.operator.base
        s = grid(points - 1).nodes[::-1]
        fraction, _ = overburden_fractions(s, base_.resolution)
        return self.flow.at_overburden(fraction).height, self.fields @ base_.grid.interpolation(s).T


def relative_fields(of: Operator, vector: Complex) -> Complex:
    """n = nu'/nu, u, v, w and tau = T'/T at the nodes, (5, n), from the unknowns."""
    fields = vector.reshape(FIELDS, -1).copy()
    fields[DENSITY] = without_top(of.base) @ fields[DENSITY]
    return fields


class Disturbances:
    """All small disturbances of one flow; grids are made when they are wanted, and kept.

    Raises:
        InputError: where stability cannot be posed, see :func:`chuteflow.stability.linear.grains`.
    """

    def __init__(self, flow: Flow) -> None:
        self.flow = flow
        self._operators: dict[Resolution, Operator] = {}
        self._rates: dict[Resolution, tuple[Array, Array]] = {}

    def modes(self, kx: float, ky: float, *, count: int = 1, tolerance: float = TOLERANCE) -> list[Mode]:
        """Up to ``count`` modes at wavenumbers ``kx`` along and ``ky`` across the slope, fastest growing first.

        Grids are refined until the first of them is known to ``tolerance``, and nothing else grows. Where the
        continuous spectrum hides all modes, there are none.

        Raises:
            InputError: for wavenumbers out of range.
            SolveError: where the finest grids do not reach the tolerance.
        """
        check_wavenumbers(kx, ky)
        error = np.inf
        for level in range(len(DEGREES)):
            found, doubtful = self.accepted(kx, ky, level, count)
            if not doubtful and found and (error := found[0].error) <= tolerance * max(1.0, abs(found[0].sigma)):
                return found
            if not doubtful and not found and level:
                return []
        raise SolveError(
            f"the leading mode at kx = {kx:g}, ky = {ky:g} is known to {error:.1e} at best, not to {tolerance:g}: "
            "ask for a larger tolerance"
        )

    def accepted(self, kx: float, ky: float, level: int, count: int = 1) -> tuple[list[Mode], bool]:
        """Up to ``count`` modes on the grids of a ``level``, and whether something that is none of them seems to grow.

        The wavenumbers are not checked.
        """
        found: list[Mode] = []
        finest = level == len(DEGREES) - 1
        for candidate in self.candidates(kx, ky, level):
            mode, drift = self._compare(kx, ky, complex(candidate), level)
            if mode is not None:
                found.append(mode)
            elif candidate.real > self.smallest_rate and not found and (not finest or drift < _ARTEFACT):
                return [], True
            if len(found) == count:
                break
        return found, False

    @property
    def smallest_rate(self) -> float:
        """Growth that counts as none: 1e-6 sqrt(g cos(theta)/h)."""
        return smallest_rate(self.flow)

    @property
    def is_cold(self) -> bool:
        """Whether M/T_surface is so large that coarse grids say little."""
        return self.flow.mass_holdup > _COLD * self.flow.surface_temperature

    def candidates(self, kx: float, ky: float, level: int = 0) -> Complex:
        """Eigenvalues of the coarse grid that may be modes, fastest growing first; not yet checked on another."""
        return self._candidates(self.coarse_operator(kx, ky, level), kx, ky)

    def screen(self, kx: float, ky: float) -> Complex:
        """The same on a coarser grid: rates to a few per cent where flows are not very cold, much faster."""
        usual = self._resolutions(kx, ky, 0)[0]
        degree = round(usual.degree * _SCREEN / DEGREES[0][0])
        return self._candidates(self.operator(Resolution(degree, usual.reach, usual.beta)), kx, ky)

    def _candidates(self, of: Operator, kx: float, ky: float) -> Complex:
        curve = self._curve(of.base.resolution, kx)
        end = curve[0]
        # To the right of everything that matters, in the middle of the range of speeds.
        shift = complex(0.05 * (1.0 + abs(kx)), 0.5 * (end.imag + curve[-1].imag))
        found = spectrum(of.matrix(kx, ky), of.weights, shift)
        kept = (density_tail(of, found.vectors) < _TAIL) & (np.abs(found.values - end) > 3.0 * abs(end.real))
        kept |= found.values.real > self.smallest_rate
        if kx == 0.0 and ky == 0.0:
            kept |= np.abs(found.values) < AT_REST
        values = found.values[kept]
        return values[np.argsort(-values.real)]

    def checked(self, kx: float, ky: float, candidate: complex, level: int = 0) -> Mode | None:
        """The mode on the fine grid that ``candidate`` of the coarse one stands for, or None if there is none."""
        return self._compare(kx, ky, candidate, level)[0]

    def _compare(self, kx: float, ky: float, candidate: complex, level: int) -> tuple[Mode | None, float]:
        """The same, and the change between the grids in fractions of the distance to the continuous spectrum."""
        coarse, fine = self._resolutions(kx, ky, level)
        of = self.operator(fine)
        sigma, vector = refine_eigenvalue(of.matrix(kx, ky), of.weights, candidate)
        error = abs(sigma - candidate)
        away = max(float(distance(np.array([sigma]), self._curve(coarse, kx))[0]), 1e-300)
        if error > _DRIFT * away or density_tail(of, vector[:, None])[0] > _TAIL:
            return None, error / away
        # Rounding leaves this much of a rate, whatever the grids say.
        noise = (BESIDE if len(of.base.grid.pieces) > 1 else 1e-14) * (1.0 + abs(sigma))
        return Mode(self.flow, kx, ky, sigma, float(max(error, noise)), of, vector), error / away

    def followed(self, kx: float, ky: float, near: complex, level: int = 0) -> Mode | None:
        """The mode whose rate is closest to ``near``, its value at wavenumbers close by: much faster than a search."""
        of = self.coarse_operator(kx, ky, level)
        return self.checked(kx, ky, refine_eigenvalue(of.matrix(kx, ky), of.weights, near)[0], level)

    def coarse_operator(self, kx: float, ky: float, level: int = 0) -> Operator:
        """The operator on the coarse grid for these wavenumbers."""
        return self.operator(self._resolutions(kx, ky, level)[0])

    def operator(self, resolution: Resolution) -> Operator:
        """The operator on one grid."""
        if resolution not in self._operators:
            self._operators[resolution] = operator(base(self.flow, resolution))
        return self._operators[resolution]

    def continuous(self, kx: float) -> Complex:
        """Points of the continuous spectrum, from far above down to the base."""
        return self._curve(self._resolutions(kx, 0.0, 0)[0], kx)

    def _resolutions(self, kx: float, ky: float, level: int) -> tuple[Resolution, Resolution]:
        # Far above, where nu is below k, stresses change from those of inertia to those of viscosity.
        k, temperature, mass = float(np.hypot(kx, ky)), self.flow.surface_temperature, self.flow.mass_holdup
        beyond = np.log(max(1.0, _SHORT * mass / (k * self.flow.centre_of_mass))) if k else 0.0
        farther = _STRIDE * float(np.ceil(beyond / _STRIDE))
        # In powers of 2, so that wavenumbers share grids.
        decay = min(2.0 ** float(np.round(np.log2(k * temperature))), _LARGEST_WEIGHT) if k * temperature > 0.7 else 0.0
        stretch = float(np.log1p(mass / temperature)) + decay
        coarse, fine = (
            Resolution(round(degree * (1.0 + 0.5 * farther / reach)), reach + farther, weight * stretch)
            for degree, reach, weight in zip(DEGREES[level], _REACH[level], _WEIGHTS, strict=True)
        )
        return coarse, fine

    def _curve(self, resolution: Resolution, kx: float) -> Complex:
        if resolution not in self._rates:
            self._rates[resolution] = relaxation(self._base(resolution))
        velocity, rate = self._rates[resolution]
        return -1j * kx * velocity - rate

    def _base(self, resolution: Resolution) -> BaseState:
        return self.operator(resolution).base


def leading(
    disturbances: Disturbances, kx: float, ky: float, *, count: int = 1, tolerance: float = np.inf
) -> list[Mode]:
    """The leading modes on the first grids that tell what grows and know it to ``tolerance``, or on the finest.

    Raises:
        UnresolvedError: where the finest grids do not resolve it.
    """
    found: list[Mode] = []
    doubtful = True
    for level in range(len(DEGREES)):
        found, doubtful = disturbances.accepted(kx, ky, level, count)
        if not doubtful and (not found or found[0].error <= tolerance * max(1.0, abs(found[0].sigma))):
            break
    if doubtful:
        raise UnresolvedError(disturbances.flow, kx, ky)
    return found


def smallest_rate(flow: Flow) -> float:
    """Growth that counts as none: 1e-6 sqrt(g cos(theta)/h), in sqrt(g cos(theta)/d)."""
    return NEUTRAL / float(np.sqrt(flow.centre_of_mass))


def density_tail(of: Operator, vectors: Complex) -> Array:
    """Relative size of the last sixth of the Chebyshev coefficients of the density of each of ``vectors``."""
    density = without_top(of.base) @ vectors[: of.points]
    last, largest = np.zeros(vectors.shape[1]), np.zeros(vectors.shape[1])
    for piece, nodes in zip(of.base.grid.pieces, of.base.grid.nodes_of_pieces, strict=True):
        coefficients = np.abs(piece.to_coefficients @ density[nodes])
        last = np.maximum(last, coefficients[-(len(coefficients) // 6) :].max(axis=0))
        largest = np.maximum(largest, coefficients.max(axis=0))
    return last / largest


def check_wavenumbers(kx: float, ky: float) -> None:
    """Check wavenumbers.

    Raises:
        InputError: where they are no finite numbers in the range that has a meaning.
    """
    for name, k in (("kx", kx), ("ky", ky)):
        k = real(f"wavenumber {name}", k, " (in 1/d)")
        if not (np.isfinite(k) and abs(k) <= _LARGEST):
            raise InputError(f"wavenumber {name} = {k}: must be from -{_LARGEST:g} to {_LARGEST:g} (in 1/d)")
    k = np.hypot(kx, ky)
    if 0.0 < k < _SMALLEST:
        raise InputError(f"wavenumber {k:g}: must be 0 or at least {_SMALLEST:g} (in 1/d)")
