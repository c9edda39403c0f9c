"""Flows in time by finite volumes: grains in cells of given mass, velocities along z on the faces between them.

It shares with the package the functions g_i of the law alone: the equations, the conditions at the base (solved by
hand for the shear rate), the variables and the grid are its own. Second order in the size of the cells.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from chuteflow.steady.chute import Chute
from chuteflow.theory.laws import law

STEP = 1e-40


def _between(values):
    return 0.5 * (values[1:] + values[:-1])


@dataclass(frozen=True)
class Cells:
    """``cells`` cells, thinner at the surface. A state is 1/nu, u and T of the cells and w of the faces above them."""

    chute: Chute
    holdup: float
    cells: int
    stretch: float

    @cached_property
    def faces(self):
        s = np.linspace(0.0, 1.0, self.cells + 1)
        return self.holdup * np.expm1(self.stretch * s) / np.expm1(self.stretch)

    @cached_property
    def mass(self):
        return np.diff(self.faces)

    @cached_property
    def centres(self):
        return _between(self.faces)

    def of_flow(self, flow):
        profile = flow.at_overburden(self.centres / self.holdup)
        nu, T = profile.volume_fraction, profile.granular_temperature
        return np.concatenate([1.0 / nu, profile.velocity, T, np.zeros_like(nu)])

    def law(self, nu):
        chosen = law(self.chute.closure)
        return chosen.coefficients(nu, 1.0 - nu / chosen.densest, self.chute.restitution, self.chute.slope)

    def rate(self, state):
        volume, u, T, w = state.reshape(4, -1)
        nu, g, dm, apart = 1.0 / volume, self.law(1.0 / volume), self.mass, np.diff(self.centres)
        stretching = -np.diff(np.append(w, 0.0)) / dm  # d(1/nu)/dt
        lag = (4.0 / 3.0 * g.viscosity + g.bulk_viscosity) * np.sqrt(T) * nu * stretching
        normal = g.compressibility * nu * T - lag
        root_T = _between(np.sqrt(T))
        shear = _between(g.viscosity * nu) * root_T * np.diff(u) / apart
        heat = _between(g.conductivity * nu) * root_T * np.diff(T) / apart
        heat -= _between(g.density_conductivity * nu) * root_T**3 * np.diff(nu) / apart
        u_base, *at_base = self.base(*map(self.extrapolated, (nu, u, T, normal, nu * stretching)))
        shear, heat = (np.concatenate([[0.0], f, [b]]) for f, b in zip((shear, heat), at_base, strict=True))
        # Either cell takes half of the work on the face between them, and the last one all on its way to the base.
        half = 0.5 * np.diff(u)
        work = shear[:-1] * np.append(0.0, half) + shear[1:] * np.append(half, u_base - u[-1])
        lifted = np.append(0.5 * dm[0], _between(dm))
        return np.concatenate(
            [
                stretching,
                np.diff(shear) / dm + self.chute.slope,
                ((np.diff(heat) + work) / dm - normal * stretching - g.dissipation * nu * T**1.5) / 1.5,
                np.diff(np.append(0.0, normal)) / lifted - 1.0,
            ]
        )

    def extrapolated(self, values):
        share = (self.holdup - self.centres[-1]) / (self.centres[-1] - self.centres[-2])
        return values[-1] + share * (values[-1] - values[-2])

    def base(self, nu, u, T, normal, w_z):
        """u, P_xz and q at the base: (2.9)-(2.15) with w = 0, of which x and z are left."""
        r, g = self.chute.roughness, self.law(nu)
        lid = np.sqrt(1.0 - r**2)
        kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
        A = 1.0 + np.pi / (12.0 * np.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * nu * g.radial))
        c = np.sqrt(2.0 / np.pi / T)
        hits = normal / (1.0 + c * w_z * (A * (r**2 - 2.0) + kappa + 2.0 * lid))  # nu chi T
        eta = g.viscosity * np.sqrt(T)
        shear_rate = hits * c * kappa * u / (eta + hits * c * (kappa - 0.5 * A * r**2))
        shear = -eta * shear_rate
        lost = np.sqrt(2.0 / np.pi) * 2.0 * (1.0 - self.chute.wall_restitution) / (1.0 + lid) * hits * np.sqrt(T)
        return u, shear, -shear * u - lost

    def jacobian(self, state):
        rates = [self.rate(state + step).imag for step in STEP * 1j * np.eye(len(state))]
        return np.stack(rates, axis=-1) / STEP

    def steady(self, state):
        """The steady state near ``state``, by Newton's method."""
        for _ in range(20):
            step = np.linalg.solve(self.jacobian(state), -self.rate(state))
            state = state + step
            if np.abs(step).max() < 1e-10:
                return state
        raise AssertionError("no steady state in 20 steps")

    def flux(self, state):
        return float(self.mass @ state.reshape(4, -1)[1])
