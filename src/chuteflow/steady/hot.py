"""Hot flows of a chute, by the reduced model of section 4; and that model solved the paper's way.

# notation: as in chuteflow.theory.hot, sigma = ln s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chuteflow import display
from chuteflow.checks import number, real_array
from chuteflow.errors import InputError, SolveError
from chuteflow.result import Result
from chuteflow.steady.chute import Chute
from chuteflow.steady.kinds import INVERTED, MONOTONIC, interior_kind
from chuteflow.theory.bases import require_richman
from chuteflow.theory.constitutive import Field
from chuteflow.theory.hot import (
    LAMBDA_C,
    HotParameters,
    HotSolution,
    SlopeBounds,
    dilute,
    hot_parameters,
    hot_solution,
    slope_bounds,
)


@dataclass(frozen=True)
class HotModel(Result):
    """The hot flow of ``chute``: its limit T_inf -> infinity, from which its numbers differ by O(1/T_inf).

    Where there is none, ``solution`` and all numbers of the flow are None, and ``reason`` says why in one
    sentence. ``slope_bounds`` are those of the material and base, whatever the slope. With alpha of
    ``parameters``, nu = alpha psi/T_inf and the overburden is p = alpha P.
    """

    chute: Chute
    parameters: HotParameters
    solution: HotSolution | None
    reason: str | None
    slope_bounds: SlopeBounds | None

    def __repr__(self) -> str:
        numbers = {"lambda": self.parameters.lambda_, "delta": self.parameters.delta}
        if self.mass_holdup is None:
            return display.line("HotModel", self.reason, **numbers)
        density = INVERTED if self.inverted else MONOTONIC
        return display.line("HotModel", f"{self.interior}, density {density}", **numbers, M=self.mass_holdup)

    def _repr_html_(self) -> str:
        rows = [[name, "-" if value is None else str(value)] for name, value in self.as_dict().items()]
        return display.html_table(repr(self)[1:-1], ["", ""], rows)

    @property
    def exists(self) -> bool:
        """Whether the chute has a hot flow."""
        return self.solution is not None

    @property
    def interior(self) -> str | None:
        """Which the flow is, "dissipative" or "productive"."""
        if self.solution is None:
            return None
        # Of one sign throughout the hot flow.
        return interior_kind(self.parameters.delta, self.parameters.delta)

    @property
    def inverted(self) -> bool | None:
        """Whether the volume fraction rises with height above the base."""
        return self.solution.inverted if self.solution else None

    @property
    def mass_holdup(self) -> float | None:
        """M, the same for all T_inf (4.19)."""
        return self.parameters.alpha * self.solution.P_b if self.solution else None

    @property
    def log_flux(self) -> float | None:
        """ln(Q/sqrt(T_inf)) (4.18)."""
        if self.solution is None:
            return None
        a = self.parameters
        return math.log(abs(a.alpha) * a.F10) + self.solution.log_flux(a.mu)

    @property
    def log_centre_of_mass(self) -> float | None:
        """ln(h/T_inf) (4.20)."""
        return self.solution.log_centre_of_mass if self.solution else None

    @property
    def largest_volume_fraction(self) -> float | None:
        """Largest nu, times T_inf: the flow is dilute where T_inf is far above this."""
        return self.parameters.alpha * self.solution.largest_psi if self.solution else None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers by name, None for what does not exist or is too large for a number."""
        a, bounds = self.parameters, self.slope_bounds
        return {
            "lambda": _finite(a.lambda_),
            "delta": a.delta,
            "F10": a.F10,
            "F21": a.F21,
            "alpha": _finite(a.alpha),
            "mu": _finite(a.mu),
            "exists": self.exists,
            "interior": self.interior,
            "inverted": self.inverted,
            "M": self.mass_holdup,
            "Q_over_sqrt_T": _power(self.log_flux),
            "h_over_T": _power(self.log_centre_of_mass),
            "log_Q_over_sqrt_T": self.log_flux,
            "log_h_over_T": self.log_centre_of_mass,
            "nu_max_times_T": self.largest_volume_fraction,
            "slope_bounds": [bounds.lowest, _finite(bounds.highest)] if bounds else None,
            "reason": self.reason,
        }


def hot(chute: Chute) -> HotModel:
    """The hot flow of ``chute``, or why it has none.

    Raises:
        InputError: for a chute with interface conditions, which section 4 leaves out, or a closure without
            dilute limit.
    """
    if chute.surface != "free":
        raise InputError(f"surface = {chute.surface!r}: the model of hot flows has the surface 'free' alone")
    require_richman(chute.base, "the hot limit is")
    limit = dilute(chute.law, chute.restitution, chute.slope)
    parameters = hot_parameters(limit, chute.wall_restitution, chute.roughness, chute.slope)
    reason = parameters.obstacle
    return HotModel(
        chute=chute,
        parameters=parameters,
        solution=hot_solution(parameters.lambda_) if reason is None else None,
        reason=reason,
        slope_bounds=slope_bounds(limit, chute.wall_restitution, chute.roughness),
    )


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _power(log: float | None) -> float | None:
    try:
        return None if log is None else math.exp(log)
    except OverflowError:
        return None


# The paper's way

#: psi over sqrt(|lambda|) where the shooting starts: (4.24) errs by a quarter of the square of this.
_START = 1e-6
#: A base hotter than this is not looked for.
_HOTTEST = 1e150
#: The state that is integrated: psi, tau, d tau^(3/2)/dsigma, and the integrals over sigma of psi sqrt(tau),
#: of psi, of psi times the first of them, and of sigma psi.
_PSI, _TAU, _FLUX, _SHEAR, _HOLDUP, _SHEARED, _MOMENT = range(7)


@dataclass(frozen=True, eq=False)
class ShootingSolution:
    """The reduced system integrated from the surface to the base, where (4.13) holds.

    ``log_c`` is ln |c| of (4.24). ``psi``, ``tau`` and ``U`` are arrays of the shape of ``s``. ``flux``
    (4.18) is over alpha F10 sqrt(T_inf), ``holdup`` (4.19) over alpha, both of the sign of lambda, and
    ``centre_of_mass`` (4.20) over T_inf. ``error`` is the estimated relative error of these three, the
    largest, and ``error_of_log_c`` that of ln |c|, absolute.
    """

    lambda_: float
    log_c: float
    s: Field
    psi: Field
    tau: Field
    U: Field
    flux: float
    holdup: float
    centre_of_mass: float
    error: float
    error_of_log_c: float

    @property
    def c(self) -> float:
        """c of (4.24), of the sign of lambda; infinite where it overflows."""
        return math.copysign(math.exp(self.log_c) if self.log_c < 709.0 else math.inf, self.lambda_)


def shoot(lambda_: float, mu: float = 0.0, s: ArrayLike | None = None, tolerance: float = 1e-12) -> ShootingSolution:
    """Solve (4.11)-(4.13), (4.16) and (4.17) as the paper does: by a Runge-Kutta method, from (4.24) on.

    The paper adjusts c until (4.13) holds at s = 1. As sigma = ln s does not appear in the system, c shifts
    one and the same trajectory, and the search for c is a search for the end of the trajectory with c = 1. A
    second trajectory, with start and ``tolerance`` less fine, gives the errors. Fields are given at ``s`` in
    (0, 1], by default 200 points.

    Raises:
        InputError: for a lambda without hot flow, or ``s`` or ``tolerance`` out of range.
        SolveError: where the base is not reached, for lambda near 3.
    """
    lambda_, mu, tolerance = number("lambda", lambda_), number("mu", mu), number("tolerance", tolerance)
    if not (lambda_ < LAMBDA_C and lambda_ != 0.0):
        raise InputError(f"lambda = {lambda_}: hot flows have a lambda below 3, other than 0")
    if not 1e-13 <= tolerance <= 1e-3:
        raise InputError(f"tolerance = {tolerance}: must be from 1e-13 to 1e-3")
    s = np.linspace(0.005, 1.0, 200) if s is None else real_array("s", s)
    if not (s.size and s.min() > 0.0 and s.max() <= 1.0):
        raise InputError("s must be above 0 and at most 1")
    fine = _Trajectory.to_base(lambda_, _START, tolerance)
    rough = _Trajectory.to_base(lambda_, 3.0 * _START, 30.0 * tolerance)
    numbers = fine.macroscopic(mu)
    state = fine.states(fine.end + np.log(s))
    return ShootingSolution(
        lambda_=lambda_,
        log_c=fine.end,
        s=s,
        psi=state[_PSI],
        tau=state[_TAU],
        U=math.sqrt(fine.base[_TAU]) + mu * (fine.base[_SHEAR] - state[_SHEAR]),
        flux=float(numbers[0]),
        holdup=float(numbers[1]),
        centre_of_mass=float(numbers[2]),
        error=float(np.abs(rough.macroscopic(mu) / numbers - 1.0).max()),
        error_of_log_c=abs(rough.end - fine.end),
    )


@dataclass(frozen=True, eq=False)
class _Trajectory:
    """The trajectory with c = 1 from sigma = ``first`` to the base at ``end``, in between by ``inside``."""

    lambda_: float
    first: float
    end: float
    base: Field
    inside: Callable[[Field], Field]

    @classmethod
    def to_base(cls, lambda_: float, start: float, tolerance: float) -> _Trajectory:
        from scipy.integrate import solve_ivp

        def at_base(sigma: float, z: Field) -> float:
            return z[_FLUX] / (z[_PSI] * z[_TAU] ** 1.5) - 1.0  # (4.13)

        def too_hot(sigma: float, z: Field) -> float:
            return z[_TAU] - _HOTTEST

        at_base.terminal = too_hot.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        first = math.log(start * math.sqrt(abs(lambda_)))
        found = solve_ivp(
            lambda sigma, z: _derivative(lambda_, sigma, z),
            (first, 1e300),
            _far_above(lambda_, np.array(first)),
            method="DOP853",
            rtol=tolerance,
            atol=0.0,
            first_step=0.1,
            dense_output=True,
            events=[at_base, too_hot],
        )
        ends, states, inside = found.t_events, found.y_events, found.sol
        if ends is None or states is None or inside is None or not ends[0].size:
            raise SolveError(
                f"the integration ended above the base at lambda = {lambda_}: "
                "take chuteflow.theory.hot.hot_solution, which is exact"
            )
        return cls(lambda_, first, float(ends[0][0]), states[0][0], inside)

    def states(self, sigma: Field) -> Field:
        """States (7, ...) at ``sigma`` up to the base."""
        flat = sigma.ravel()
        above = _far_above(self.lambda_, np.minimum(flat, self.first))
        inside = self.inside(np.clip(flat, self.first, self.end))
        return np.where(flat < self.first, above, inside).reshape(7, *sigma.shape)

    def macroscopic(self, mu: float) -> Field:
        """Flux (4.18), hold-up (4.19) and centre of mass (4.20), (3,)."""
        z = self.base
        flux = math.sqrt(z[_TAU]) * z[_HOLDUP] + mu * (z[_SHEAR] * z[_HOLDUP] - z[_SHEARED])
        return np.array([flux, z[_HOLDUP], self.end - z[_MOMENT] / z[_HOLDUP]])


def _derivative(lambda_: float, sigma: float, z: Field) -> list[float]:
    psi, tau, flux, shear = z[:_HOLDUP]
    if tau <= 0.0:  # a step went through the base and beyond the end of the trajectory: to be halved
        return [math.nan] * 7
    root = math.sqrt(tau)
    tau_slope = flux / (1.5 * root)
    return [
        psi * (1.0 - tau_slope) / tau,  # (4.11)
        tau_slope,
        psi**2 * tau * root / lambda_,  # (4.12)
        psi * root,
        psi,
        psi * shear,
        sigma * psi,
    ]


def _far_above(lambda_: float, sigma: Field) -> Field:
    """States (7, ...) by (4.24) with |c| = 1."""
    psi = np.copysign(np.exp(sigma), lambda_)
    heating = psi**2 / (6.0 * lambda_)
    return np.array([psi, 1.0 + heating, 3.0 * heating, psi, psi, 0.5 * psi**2, psi * (sigma - 1.0)])
