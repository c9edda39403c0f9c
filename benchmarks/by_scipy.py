"""One flow by scipy's solve_bvp, in the best formulation at hand: what the engine is compared with.

# notation: x = p/M from 0 to 1, w = nu/p, Y = q/(p sqrt(T)), G = g1/nu.

The overburden coordinate makes the domain finite; ln w is smooth at the surface, where nu is not, and gives the
density without an iteration; the one singular term, Y/x, goes to the solver as such. With the flux as a third
unknown and ln M as a parameter, any Q can be asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from chuteflow import Chute, Flow
from chuteflow.theory import boundary
from chuteflow.theory.laws import law

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """Mesh, (ln w, Y, flux) on it and ln M."""

    x: Array
    fields: Array
    log_m: float


def start_from(flow: Flow, points: int) -> Start:
    """The profile of a flow on the half-line, on a uniform mesh."""
    t, mass = flow.surface_temperature, flow.mass_holdup
    heights = np.concatenate([np.linspace(0.0, flow.depth, 400), flow.depth + t * np.linspace(0.1, 30.0, 300)])
    profile = flow.profile(heights)
    p = profile.normal_stress[::-1]
    log_w = np.log(profile.volume_fraction[::-1] / p)
    y = profile.heat_flux[::-1] / (p * np.sqrt(profile.granular_temperature[::-1]))
    x = np.linspace(0.0, 1.0, points)
    fields = np.stack([np.interp(x, p / mass, log_w), np.interp(x, p / mass, y), x * flow.mass_flux])
    fields[1, 0] = 0.0
    return Start(x, fields, math.log(mass))


def solve(chute: Chute, flux: float, start: Start, tolerance: float = 1e-9) -> Any:
    """The result of solve_bvp for Q = ``flux`` on a chute with a free surface; its p[0] is ln M."""
    found = law(chute.closure)
    e, slope, r = chute.restitution, chute.slope, chute.roughness

    def closures(x: Array, log_w: Array, mass: Any) -> tuple[Any, Array, Array]:
        w = np.exp(log_w)
        nu = mass * x * w
        return found.coefficients(nu, 1.0 - nu / found.densest, e, slope), w, nu

    def right(x: Array, v: Array, unknown: Array) -> Array:
        mass = math.exp(unknown[0])
        g, w, nu = closures(x, v[0], mass)
        big_g = g.compressibility
        g1_nu = big_g + nu * g.compressibility_slope
        t = 1.0 / (w * big_g)
        t_p = (v[1] / w + g.density_conductivity / g1_nu) / (
            g.conductivity + g.density_conductivity * nu * big_g / g1_nu
        )
        log_w_p = -w * (g.compressibility_slope + big_g**2 * t_p) / g1_nu
        net = g.dissipation / big_g - slope**2 * big_g / g.viscosity
        y_p = net - 0.5 * v[1] * t_p / t
        flux_p = mass * x * slope * (big_g / g.viscosity) * np.sqrt(t)
        return mass * np.stack([log_w_p, y_p, flux_p])

    def ends(above: Array, below: Array, unknown: Array) -> Array:
        mass = math.exp(unknown[0])
        g, w, nu = closures(np.ones(1), below[:1], mass)
        shear = nu * g.compressibility / g.viscosity
        contact = nu * (1.0 + np.pi / (12.0 * np.sqrt(2.0))) + np.pi / (12.0 * np.sqrt(2.0)) * 5.0 / (8.0 * g.radial)
        slip = boundary.slip_coefficient(shear, g.compressibility * contact / g.viscosity, r, slope)
        flux_of_base = slope * slip - boundary.base_loss(chute.wall_restitution, r)
        carried = slip * mass / np.sqrt(w * g.compressibility)
        return np.array([above[1], above[2], below[1] - flux_of_base[0], below[2] + carried[0] - flux])

    singular = np.diag([0.0, -1.0, 0.0])
    return solve_bvp(right, ends, start.x, start.fields, p=[start.log_m], S=singular, tol=tolerance, max_nodes=20000)
