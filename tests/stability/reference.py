"""An independent linearisation: the printed equations in plain fields, disturbed by an imaginary step.

No code of chuteflow beyond the profiles of the steady flow, and no formula of its disturbances. (2.1)-(2.7) are
written in nu, u, v, w and T with table 1 of the other reference, and (2.9)-(2.15) by components. Waves are seen at
three phases, on which differentiation of exp(i phase) is exact, so that d/dx = kx d/dphase and d/dy = ky d/dphase
of plain real fields. The heights run up to ten wavelengths over 2 pi, with a stretched map and no condition but
that stresses and heat flux vanish there: what fills the space above the grains is computed, not assumed.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

import chuteflow

from ..verification.reference import NU_STAR, Case, Table1

Array = NDArray[Any]
STEP = 1e-40
_D = 1.0 / math.sqrt(3.0)
#: d/dphase at the phases 0, 2 pi/3, 4 pi/3.
BY_PHASE = np.array([[0.0, _D, -_D], [-_D, 0.0, _D], [_D, -_D, 0.0]])
PHASES = 2.0 * math.pi / 3.0 * np.arange(3)


def chebyshev(n: int) -> tuple[Array, Array]:
    """Points cos(pi j/n) and their differentiation matrix (Trefethen 2000)."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.where(np.isin(np.arange(n + 1), (0, n)), 2.0, 1.0) * (-1.0) ** np.arange(n + 1)
    gap = x[:, None] - x + np.eye(n + 1)
    d = np.outer(c, 1.0 / c) / gap
    return x, d - np.diag(d.sum(axis=1))


@dataclass
class Problem:
    """Disturbances of one flow at one pair of wavenumbers, on ``n`` + 1 heights from the top down to the base."""

    flow: chuteflow.Flow
    kx: float
    ky: float
    n: int

    def __post_init__(self) -> None:
        chute, flow = self.flow.chute, self.flow
        self.case = Case(chute.slope, chute.restitution, chute.wall_restitution, chute.roughness)
        k = math.hypot(self.kx, self.ky)
        T = flow.surface_temperature
        top, scale = max(10.0 / k, 16.0 * T), 2.0 * flow.centre_of_mass
        x, d = chebyshev(self.n)
        span = 1.0 + 2.0 * scale / top - x
        self.z = scale * (1.0 + x) / span
        self.z[0] = top
        self.d = d * (span**2 / (scale * (1.0 + span + x)))[:, None]
        profile = flow.profile(np.minimum(self.z, 200.0 * T))
        self.log_nu = np.log(profile.volume_fraction) - np.maximum(self.z - 200.0 * T, 0.0) / T
        still = np.zeros(self.n + 1)
        self.steady = np.array([still, profile.velocity, still, still, profile.granular_temperature])

    def rates(self, fields: Array) -> Array:
        """Right-hand sides for d ln nu/dt, nu du/dt, 3/2 nu dT/dt of ``fields`` (..., 5, 3, n+1): ln nu over its
        steady value, u, v, w, T at three phases; in the first and last heights of the last four, the conditions."""
        case = self.case
        log_nu, u, v, w, T = (fields[..., i, :, :] for i in range(5))
        log_nu = log_nu + self.log_nu
        nu = np.exp(log_nu)
        g = Table1(case, nu, 1.0 - nu / NU_STAR)
        g6 = 4.0 / (3.0 * math.sqrt(math.pi)) * (1.0 + case.e) * nu**2 * g.g0
        root = np.sqrt(T)

        def dx(f: Array) -> Array:
            return self.kx * (BY_PHASE @ f)

        def dy(f: Array) -> Array:
            return self.ky * (BY_PHASE @ f)

        def dz(f: Array) -> Array:
            return f @ self.d.T

        ux, uy, uz, vx, vy, vz, wx, wy, wz = (d(f) for f in (u, v, w) for d in (dx, dy, dz))
        div = ux + vy + wz
        eta, xi = g.g2 * root, g6 * root
        mean = g.g1 * T - xi * div + 2.0 / 3.0 * eta * div
        pxx, pyy, pzz = mean - 2.0 * eta * ux, mean - 2.0 * eta * vy, mean - 2.0 * eta * wz
        pxy, pxz, pyz = -eta * (uy + vx), -eta * (uz + wx), -eta * (vz + wy)
        K, K_star = g.g3 * root, g.g4 * root * T * nu  # K* grad nu = K* nu grad ln nu
        qx, qy, qz = (K_star * d(log_nu) - K * d(T) for d in (dx, dy, dz))
        work = pxx * ux + pyy * vy + pzz * wz + pxy * (uy + vx) + pxz * (uz + wx) + pyz * (vz + wy)

        def carried(f: Array) -> Array:
            return u * dx(f) + v * dy(f) + w * dz(f)

        out = np.stack(
            [
                -carried(log_nu) - div,
                nu * case.slope - nu * carried(u) - dx(pxx) - dy(pxy) - dz(pxz),
                -nu * carried(v) - dx(pxy) - dy(pyy) - dz(pyz),
                -nu - nu * carried(w) - dx(pxz) - dy(pyz) - dz(pzz),
                -1.5 * nu * carried(T) - work - dx(qx) - dy(qy) - dz(qz) - g.g5 * root * T,
            ],
            axis=-3,
        )
        for row, value in zip(range(1, 5), (pxz, pyz, pzz, qz), strict=True):
            out[..., row, :, 0] = value[..., 0]
        base = {name: f[..., -1] for name, f in zip(["u", "v", "w", "T", "nu"], (u, v, w, T, nu), strict=True)}
        lid = math.sqrt(1.0 - case.r**2)
        kappa = 2.0 / 3.0 * (2.0 / (1.0 + lid) - lid)
        a = 1.0 + math.pi / (12.0 * math.sqrt(2.0)) * (1.0 + 5.0 / (8.0 * base["nu"] * g.g0[..., -1]))
        c = math.sqrt(2.0 / math.pi) / root[..., -1]
        turn = 0.5 * a * case.r**2
        mx = c * (-kappa * base["u"] + kappa * uz[..., -1] - turn * (uz + wx)[..., -1])
        my = c * (-kappa * base["v"] + kappa * vz[..., -1] - turn * (vz + wy)[..., -1])
        mz = 1.0 + c * (
            -kappa * base["w"] + (kappa + 2.0 * lid + a * (case.r**2 - 2.0)) * wz[..., -1] - turn * (ux + vy)[..., -1]
        )
        push = pzz[..., -1] / mz
        lost = math.sqrt(2.0 / math.pi) * 2.0 * (1.0 - case.e_w) / (1.0 + lid) * push * root[..., -1]
        slip_work = -push * (mx * base["u"] + my * base["v"] + mz * base["w"])
        out[..., 1, :, -1] = pxz[..., -1] - push * mx
        out[..., 2, :, -1] = pyz[..., -1] - push * my
        out[..., 3, :, -1] = base["w"]
        out[..., 4, :, -1] = qz[..., -1] - slip_work + lost
        return out

    def matrices(self) -> tuple[Array, Array]:
        """A and the weights of the time derivatives, for ln nu, u, v, w, T of waves exp(i phase)."""
        n = self.n + 1
        steady = np.broadcast_to(self.steady[:, None, :], (5, 3, n)).astype(complex)
        matrix = np.empty((5 * n, 5 * n), dtype=complex)
        for field in range(5):
            for first in range(0, n, 16):
                nodes = np.arange(first, min(first + 16, n))
                response = []
                for wave in (np.cos(PHASES), np.sin(PHASES)):
                    fields = np.repeat(steady[None], len(nodes), axis=0)
                    fields[np.arange(len(nodes)), field, :, nodes] += 1j * STEP * wave
                    response.append(np.imag(self.rates(fields)[:, :, 0, :]).reshape(len(nodes), -1) / STEP)
                matrix[:, field * n + nodes] = (response[0] + 1j * response[1]).T
        nu = np.exp(self.log_nu)
        weights = np.concatenate([np.ones(n), nu, nu, nu, 1.5 * nu])
        for field in range(1, 5):
            weights[[field * n, (field + 1) * n - 1]] = 0.0
        return matrix, weights

    def nearest(self, sigma: complex, steps: int = 12) -> complex:
        """The eigenvalue nearest to ``sigma``, by inverse iteration."""
        matrix, weights = self.matrices()
        shift = sigma + 1e-5 * abs(sigma)
        shifted = matrix - shift * np.diag(weights)
        size = np.abs(shifted).max(axis=1)
        factors = scipy.linalg.lu_factor(shifted / size[:, None])
        v = np.exp(1j * np.arange(len(weights)))
        mu = 0j
        for _ in range(steps):
            image = scipy.linalg.lu_solve(factors, weights / size * v)
            live = weights > 1e-12
            mu = np.vdot(v[live], image[live]) / np.vdot(v[live], v[live])
            v = image / np.abs(image[live]).max()
        return complex(shift + 1.0 / mu)
