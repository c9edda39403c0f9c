"""Many chutes in a batch: the steady problem as an initial value problem, one member for each chute.

# notation: p normal stress, P = p - p_S overburden, nu volume fraction, X = nu/(1 - nu/nu*), L = ln X,
# y = q/(p sqrt(T)) heat flux, a conduction, s slope, net = loss - s^2 work; k = (g4/g3) nu/D,
# D = d ln g1/d ln nu + (g4/g3) nu.

From the surface down, with v = p y/a and P T = p P/g1:

    dL/dln p = (1 - v)/(D dln nu/dln X),    dy/dln p = p net - y - y (v + k (1 - v))/2

The integrals of P dz and P du go with them over p and p^2, in which form they are uniform close to a free surface.
The closures are evaluated as they stand, so that every member may have its own restitution; where all members have
one, nothing else would be gained by tables.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from chuteflow.numerics.chebyshev import Array
from chuteflow.theory import boundary
from chuteflow.theory.constitutive import Law, reduce
from chuteflow.theory.laws import law

Indices = NDArray[np.intp]

#: Rows of a state: ln p, ln X, y, the integral of P dz over p, that of P du over p^2, and that of dz.
LOG_P, LOG_X, FLUX, MOMENT, SHEAR_FLUX, HEIGHT = range(6)
ROWS = 6
#: Densities at which the speed of a member's equations is looked up.
_DENSITIES = np.append(0.0, np.logspace(-3.0, 4.0, 15))


@dataclass(frozen=True, eq=False)
class Batch:
    """Chutes of one law and one surface, arrays (n,): the slope and restitution, and F1 of (3.16), affine in
    the closures: ``slip`` + s shear + ``slip_by_wall_shear`` wall_shear; ``base_loss`` is (2.15)."""

    law: Law
    surface: str
    slope: Array
    restitution: Array
    slip: Array
    slip_by_wall_shear: Array
    base_loss: Array

    @classmethod
    def of(
        cls,
        closure: str | Law,
        surface: str,
        slope: Array,
        restitution: Array,
        wall_restitution: Array,
        roughness: Array,
    ) -> Batch:
        """The batch of chutes with these parameters, each (n,)."""
        # F1 is proportional to the slope.
        pairs = [
            (boundary.slip_coefficient(_ZERO, _ZERO, r, 1.0), boundary.slip_coefficient(_ZERO, _ONE, r, 1.0))
            for r in roughness.tolist()
        ]
        empty, full = np.array(pairs, dtype=float).reshape(-1, 2).T
        losses = [boundary.base_loss(w, r) for w, r in zip(wall_restitution.tolist(), roughness.tolist(), strict=True)]
        return cls(law(closure), surface, slope, restitution, slope * empty, slope * (full - empty), np.array(losses))

    def __len__(self) -> int:
        return len(self.slope)

    def take(self, members: Indices) -> Batch:
        """The batch of the chutes ``members``, which may repeat."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return replace(
            self, **{name: values[members] for name, values in arrays.items() if isinstance(values, np.ndarray)}
        )

    @property
    def surface_stress(self) -> float:
        """p_S."""
        return boundary.surface_stress(self.surface)

    @property
    def has_limit(self) -> NDArray[np.bool_]:
        """Whether the temperature of the law has a limit far above, (n,)."""
        nothing = np.zeros(len(self))
        return reduce(self.law, nothing, cast(Any, self.restitution), cast(Any, self.slope)).drift == 0.0

    def at_state(self, state: Array) -> Pointwise:
        """Everything pointwise at states (ROWS, n)."""
        return Pointwise(self, np.exp(state[LOG_P]), state[LOG_X], state[FLUX])

    def at_density(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Conduction, net loss, base flux and volume fraction at X, of the shape (..., n)."""
        here = Pointwise(self, np.ones_like(x), np.log(np.maximum(x, 1e-300)), np.zeros_like(x))
        return here.conduction, here.net, here.base_flux, here.nu

    def fastest_rates(self) -> tuple[Array, Array]:
        """Fastest rate of y in p, and the largest y at which loss and conduction balance, (n,)."""
        x = np.broadcast_to(_DENSITIES[:, None], (len(_DENSITIES), len(self)))
        conduction, net, _, _ = self.at_density(x)
        rate = np.sqrt(2.0 * np.abs(net) / conduction).max(axis=0)
        balance = np.sqrt(2.0 * np.maximum(net, 0.0) * conduction).max(axis=0)
        return rate, balance


_ZERO, _ONE = np.zeros(()), np.ones(())


class Pointwise:
    """The closures and the balance at one point of every member, arrays of the shape of ``p``."""

    __slots__ = (
        "_base",
        "_batch",
        "_reduced",
        "conduction",
        "coupling",
        "log_x",
        "log_x_rate",
        "net",
        "nu",
        "p",
        "v",
        "y",
    )

    def __init__(self, batch: Batch, p: Array, log_x: Array, y: Array) -> None:
        x = np.exp(log_x)
        # Laws are functions of every state by itself, and so of every restitution.
        r = reduce(batch.law, x, cast(Any, batch.restitution), cast(Any, batch.slope))
        free_fraction = 1.0 / (1.0 + x * (1.0 / batch.law.densest))
        self._batch, self._reduced = batch, r
        self.p, self.log_x, self.y = p, log_x, y
        self.nu = x * free_fraction
        coupled = r.drift
        stiff = r.stiffness + coupled
        self.coupling = coupled / stiff
        self.log_x_rate = 1.0 / (stiff * free_fraction)  # dL/dln x
        self.conduction = r.conduction
        self.net = r.loss - batch.slope**2 * r.work
        self.v = p * y / r.conduction

    @property
    def raw_coupling(self) -> Array:
        """g4/g3."""
        return self._reduced.coupling

    @property
    def work(self) -> Array:
        """g1/(nu g2)."""
        return self._reduced.work

    @property
    def stiff_x(self) -> Array:
        """d ln g1/d ln X."""
        return self._reduced.stiffness * self.nu * np.exp(-self.log_x)

    @property
    def temperature(self) -> Array:
        """T = p/g1."""
        return self.p / (self.nu * self._reduced.compressibility)

    @property
    def slip(self) -> Array:
        """F1 of (3.16)."""
        r, b = self._reduced, self._batch
        return b.slip + b.slope * r.shear + b.slip_by_wall_shear * r.wall_shear

    @property
    def base_flux(self) -> Array:
        """The heat flux that a base here would give, F2/g1 of (3.18)."""
        return self._batch.slope * self.slip - self._batch.base_loss

    def derivative(self, state: Array, out: Array) -> None:
        """Derivatives of ``state`` with respect to ln p, into ``out``, both (ROWS, n)."""
        p, y, batch = self.p, self.y, self._batch
        still = 1.0 - self.v
        out[LOG_P] = 1.0
        out[LOG_X] = still * self.log_x_rate
        out[FLUX] = p * self.net - y * (1.0 + 0.5 * (self.v + self.coupling * still))
        fraction = 1.0 - batch.surface_stress / p if batch.surface_stress else 1.0
        thickness = p / self.nu
        out[MOMENT] = fraction * thickness - state[MOMENT]
        out[SHEAR_FLUX] = fraction * (batch.slope * self.work) * np.sqrt(self.temperature) - 2.0 * state[SHEAR_FLUX]
        out[HEIGHT] = thickness
