"""Flows by integration from the surface down, with formulas of its own and the breaks of the law located.

The equations (3.6), (3.8) and (3.9) over the normal stress p, as they are printed, from the coefficients of the law and
nothing else of the program: d(g1 T)/dp = 1, q = nu (g3 sqrt(T) T' - g4 T^(3/2) nu'), q' = -nu (G^2 s^2/g2 - g5/nu^2)
T^(3/2) with ' = d/dp. A step never passes a break: where one is met the integration stops there, and goes on.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

#: Where the integration begins, in parts of the surface temperature: T and nu are those far above to first order.
START = 1e-10


def closures(law, nu, e, slope):
    """G, dG/dnu, g2, g3, g4 and g5/nu^2 at one nu."""
    g = law.coefficients(np.array([nu]), np.array([1.0 - nu / law.densest]), e, slope)
    names = ("compressibility", "compressibility_slope", "viscosity", "conductivity", "density_conductivity")
    return [float(np.broadcast_to(getattr(g, name), (1,))[0]) for name in (*names, "dissipation")]


def rates(law, e, slope, surface_stress):
    """d/dp of ln nu, ln T, q and the integrals of P dz and P du."""

    def derivative(p, state):
        nu, T = math.exp(state[0]), math.exp(state[1])
        G, G_nu, g2, g3, g4, g5 = closures(law, nu, e, slope)
        root = math.sqrt(T)
        # (nu G)' T + nu G T' = 1 and nu (g3 T' - g4 T nu') sqrt(T) = q, for d ln nu/dp and d ln T/dp
        matrix = np.array([[nu * (G + nu * G_nu) * T, nu * G * T], [-(nu**2) * g4 * T * root, nu * g3 * T * root]])
        by_nu, by_T = np.linalg.solve(matrix, [1.0, state[2]])
        heat = -nu * (G**2 * slope**2 / g2 - g5) * T * root
        over = p - surface_stress
        return [by_nu, by_T, heat, over / nu, over * G * slope / g2 * root]

    return derivative


def down(law, e, slope, temperature, mass, beta=0.0, rtol=1e-12):
    """The state at the base of a flow on the half-line with this hold-up, and T ``temperature`` p^(-beta) far above."""
    p = START * temperature ** (1.0 / (1.0 + beta))
    T = temperature * p**-beta
    G, _, g2, _, _, g5 = closures(law, p / T, e, slope)
    heat = -(p**2) * math.sqrt(T) * (G**2 * slope**2 / g2 - g5) / (2.0 - 0.5 * beta)
    glide = slope * G / g2 * math.sqrt(T) * p**2 / (2.0 - 0.5 * beta)
    state = [math.log(p / (T * G)), math.log(T), heat, T * p / (1.0 - beta), glide]
    return carried(law, e, slope, state, p, mass, 0.0, rtol)


def carried(law, e, slope, state, p, end, surface_stress, rtol):
    """``state`` at ``p`` carried down to ``end``, in pieces between the breaks of the law."""
    levels = [math.log(nu) for nu in law.breaks_at(e, slope)]
    derivative = rates(law, e, slope, surface_stress)
    while p < end * (1.0 - 1e-15):
        # The level just left is no event until the density has moved away from it.
        events = []
        for level in levels:
            if abs(state[0] - level) > 1e-12:

                def crossing(p, state, level=level):
                    return state[0] - level

                vars(crossing)["terminal"] = True
                events.append(crossing)
        stop = end
        if len(events) < len(levels):
            stop = min(end, p * (1.0 + 1e-3))
        found = solve_ivp(derivative, (p, stop), state, method="DOP853", rtol=rtol, atol=1e-30, events=events or None)
        assert found.success
        p, state = float(found.t[-1]), list(found.y[:, -1])
    return state


def base_flux(law, e, slope, wall_restitution, r, nu, diameter=1.0, specularity=None):
    """F1 of (3.16), and F2 of (3.18) over g1, both reduced; or, with a specularity, those of Johnson & Jackson."""
    G, _, g2, *_ = closures(law, nu, e, slope)
    free_fraction = 1.0 - nu / law.densest
    g0 = float(law.coefficients(np.array([nu]), np.array([free_fraction]), e, slope).radial[0])
    if specularity is not None:
        f1 = slope * G / g0 * 6.0 * 0.62 / (math.pi * math.sqrt(3.0) * specularity)
        return f1, slope * f1 - math.pi * math.sqrt(3.0) / (4.0 * 0.62) * (1.0 - wall_restitution**2) * g0 / G
    lid = math.sqrt(1.0 - r**2)
    kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
    mean = 0.5 * (1.0 + diameter)
    bumps = 1.0 + math.pi / (12.0 * math.sqrt(2.0) * mean) * (1.0 + 5.0 / (8.0 * nu * g0))
    f1 = slope / kappa * (math.sqrt(math.pi / 2.0) + mean * (kappa - 0.5 * bumps * r**2) * nu * G / g2)
    loss = math.sqrt(2.0 / math.pi) * 2.0 * (1.0 - wall_restitution) / (1.0 + lid)
    return f1, slope * f1 - loss
