"""Every flow of a chute with a given hold-up, by shooting from the surface down.

A scan of surface temperatures, and the zeros of what it finds solved by :mod:`.downwards`. Nothing of the program but
the coefficients of the laws is used.
"""

import math

import numpy as np

from . import downwards

#: Surface temperatures that are scanned, and how many.
COLDEST, HOTTEST, COUNT = 1e-2, 1e4, 1200
#: Steps in ln p of the scan, where on the half-line it begins in parts of the temperature, and how often a bracket is
#: divided into how many.
_STEPS, _START, _ROUNDS, _PARTS = 700, 1e-5, 3, 40
_INTERFACE = math.sqrt(math.pi) / 48.0


class Problem:
    """One chute with its hold-up: numbers and the law's function alone."""

    def __init__(self, law, slope, e, e_w, r, mass, surface="free", **on):
        self.law, self.slope, self.e, self.e_w, self.r, self.mass, self.on = law, slope, e, e_w, r, mass, on
        self.stress = _INTERFACE if surface == "interface" else 0.0
        self.beta = 0.0
        dilute = law.coefficients(np.zeros(1), np.ones(1), e, slope)
        if dilute.density_flux is not None:
            b = -float(dilute.density_flux[0] / dilute.conductivity[0])
            self.beta = b / (1.0 - b)

    def scanned(self, temperature):
        """The residual y - y_base at the base for each of many surface temperatures; NaN where one comes to no base."""
        if self.stress:
            log_p, T = np.full_like(temperature, math.log(self.stress)), temperature
            y = np.full_like(temperature, -(self.slope**2))
        else:
            p = _START * temperature ** (1.0 / (1.0 + self.beta))
            log_p, T = np.log(p), temperature * p**-self.beta
            g = self._coefficients(p / T)
            y = -p * (g.compressibility**2 * self.slope**2 / g.viscosity - g.dissipation) / (2.0 - 0.5 * self.beta)
        nu = np.exp(log_p) / (T * self._coefficients(np.exp(log_p) / T).compressibility)
        for _ in range(30 if self.stress else 2):
            nu = np.minimum(np.exp(log_p) / (T * self._coefficients(nu).compressibility), 0.999 * self.law.densest)
        if self.stress:
            nu = _bisected(
                lambda nu: nu * self._coefficients(nu).compressibility * T - self.stress, self.law.densest, T
            )
        state = np.stack([np.log(nu / (1.0 - nu / self.law.densest)), np.log(T), y])
        step = (math.log(self.mass + self.stress) - log_p) / _STEPS
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                k1 = self._rate(log_p, state)
                k2 = self._rate(log_p + 0.5 * step, state + 0.5 * step * k1)
                k3 = self._rate(log_p + 0.5 * step, state + 0.5 * step * k2)
                k4 = self._rate(log_p + step, state + step * k3)
                state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                log_p = log_p + step
            x = np.exp(state[0])
            return state[2] - self._base_flux(x / (1.0 + x / self.law.densest))

    def brackets(self):
        """Pairs of surface temperatures between which there is a flow."""
        found = []
        whole = np.geomspace(COLDEST, HOTTEST, COUNT)
        self._divide(whole, _ROUNDS, found)
        return found

    def _divide(self, temperature, rounds, found):
        residual = self.scanned(temperature)
        for i in range(len(temperature) - 1):
            one, other = residual[i], residual[i + 1]
            if np.isfinite(one) and np.isfinite(other) and (one > 0.0) != (other > 0.0):
                if rounds == 0:
                    found.append((temperature[i], temperature[i + 1]))
                else:
                    self._divide(np.geomspace(temperature[i], temperature[i + 1], _PARTS), rounds - 1, found)

    def shot(self, temperature, rtol=1e-13):
        """The residual, and ln Q, ln h and ln T at the base, by :mod:`.downwards`."""
        args = self.law, self.e, self.slope
        if self.stress:
            nu = float(
                _bisected(
                    lambda nu: nu * self._coefficients(nu).compressibility * temperature - self.stress,
                    self.law.densest,
                    np.array([temperature]),
                )[0]
            )
            heat = -(self.slope**2) * self.stress * math.sqrt(temperature)
            start = [math.log(nu), math.log(temperature), heat, 0.0, 0.0]
            end = self.mass + self.stress
            state = downwards.carried(*args, start, self.stress, end, self.stress, rtol)
        else:
            state = downwards.down(*args, temperature, self.mass, self.beta, rtol)
        nu, root = math.exp(state[0]), math.exp(0.5 * state[1])
        f1, f2 = downwards.base_flux(*args, self.e_w, self.r, nu, **self.on)
        p = self.mass + self.stress
        flux = state[4] + f1 * root * self.mass
        return state[2] / (p * root) - f2, np.array([math.log(flux), math.log(state[3] / self.mass), state[1]])

    def solved(self, temperature):
        """The surface temperature of the flow near ``temperature``, what :meth:`shot` gives there, and how much a
        relative change of it is magnified on the way down."""
        a, off = math.log(temperature), 1e-5
        f_a, _ = self.shot(math.exp(a))
        b = a + off
        f_b, q_b = self.shot(math.exp(b))
        magnified = 1.0
        for _ in range(12):
            step = -f_b * (b - a) / (f_b - f_a) if f_b != f_a else 0.0
            step = max(-0.05, min(0.05, step))
            if abs(step) < 1e-14:
                break
            a, f_a, q_a, b = b, f_b, q_b, b + step
            f_b, q_b = self.shot(math.exp(b))
            if abs(b - a) > 1e-9:
                magnified = max(magnified, float(np.abs((q_b - q_a) / (b - a)).max()))
        return math.exp(b), q_b, magnified

    def _coefficients(self, nu):
        return self.law.coefficients(nu, 1.0 - nu / self.law.densest, self.e, self.slope)

    def _rate(self, log_p, state):
        """d/d ln p of ln x, ln T and y = q/(p sqrt(T))."""
        x = np.exp(state[0])
        free_fraction = 1.0 / (1.0 + x / self.law.densest)
        nu, p = x * free_fraction, np.exp(log_p)
        g = self.law.coefficients(nu, free_fraction, self.e, self.slope)
        G = g.compressibility
        stiff = 1.0 + nu * g.compressibility_slope / G
        flux = g.density_conductivity * nu if g.density_flux is None else g.density_flux
        # stiff ln nu' + ln T' = 1,  g3 ln T' - nu g4 ln nu' = p y G
        by_nu = (g.conductivity - p * state[2] * G) / (stiff * g.conductivity + flux)
        by_T = 1.0 - stiff * by_nu
        net = g.dissipation / G - self.slope**2 * G / g.viscosity
        return np.stack([by_nu / free_fraction, by_T, p * net - state[2] * (1.0 + 0.5 * by_T)])

    def _base_flux(self, nu):
        out = np.full_like(nu, np.nan)
        for i in np.flatnonzero(np.isfinite(nu) & (nu > 0.0) & (nu < self.law.densest)).tolist():
            out[i] = downwards.base_flux(self.law, self.e, self.slope, self.e_w, self.r, float(nu[i]), **self.on)[1]
        return out


def _bisected(f, densest, like):
    low, high = np.zeros_like(like), np.full_like(like, densest * (1.0 - 1e-15))
    for _ in range(200):
        middle = 0.5 * (low + high)
        above = f(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)
