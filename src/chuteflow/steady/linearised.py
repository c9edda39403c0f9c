"""Changes of a discretised flow by the linearised problem, bordered by one condition.

# notation: z unknowns of a flow (n+3,) = (g at the nodes, theta at the surface, ln M), F(z) = 0 (n+2,) the
# discretised problem, m = (ln Q, ln h, ln M, ln T_surface).

On a grid of many pieces the Jacobian is dense, since theta at a node is an integral of g over all pieces above it. With
theta at the nodes as unknowns of their own it is sparse: an equation then knows the nodes of one piece alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from chuteflow.numerics.chebyshev import Array, PiecewiseGrid
from chuteflow.steady.collocation import State
from chuteflow.steady.model import CONDUCTION, COUPLING, LOSS, WORK

#: Weights of m, none of them 0, for which hardly any branch has a turning point.
_GENERIC = np.array([0.3, 0.5, 0.7, 1.1])
#: Nodes up to which the dense matrix is faster.
_DENSE = 800


def solve_bordered(state: State, border: Array, sides: Array) -> Array:
    """The changes of z (n+3, k) for which F changes by ``sides[:-1]`` and ``border`` (n+3,) . z by ``sides[-1]``."""
    grid = state.problem.grid
    if not isinstance(grid, PiecewiseGrid) or len(state.g) <= _DENSE or state.problem.pins:
        dense: Any = np.linalg.solve(np.concatenate([state.jacobian(), border[None]]), sides)
        return dense
    from scipy.sparse.linalg import splu

    nodes, matrix = len(state.g), _sparse(state, grid, border)
    right = np.concatenate([np.zeros((nodes, sides.shape[1])), sides])
    factors: Any = splu(matrix)
    found = factors.solve(right)
    # Without this the elimination, which pivots for sparsity too, has fewer digits than that of a dense matrix.
    found += factors.solve(right - matrix @ found)
    return np.delete(found, np.s_[nodes : 2 * nodes], axis=0)


def rates_along_branch(state: State, gradient: Array) -> Array:
    """The derivatives (4,) of m, with the ``gradient`` (4, n+3), along the branch, but for a factor."""
    side = np.zeros((gradient.shape[1], 1))
    side[-1] = 1.0
    return gradient @ solve_bordered(state, _GENERIC @ gradient, side)[:, 0]


def _sparse(state: State, grid: PiecewiseGrid, border: Array) -> Any:
    """The matrix of the bordered problem, with unknowns g (n+1), theta (n+1), theta at the surface and ln M."""
    from scipy import sparse

    model, count = state.problem.model, len(state.g)
    f, df, p, mass = state.f, state.df, state.p, state.mass
    by_mass = (1.0 + model.beta) * state.overburden_fraction  # d ln x/d ln M
    y_log_x = df[CONDUCTION] * state.g / mass
    by_log_x = 0.5 * state.y * df[COUPLING] * (1.0 - state.rise) - p * (df[LOSS] - model.slope**2 * df[WORK])
    by_rise = 0.5 * state.y * (1.0 - f[COUPLING])
    steep = state.rise + model.beta
    # The energy balance: through y and its derivative, and directly.
    through = sparse.diags_array(p * state.s_p) @ _by_pieces(grid, grid.piece.derivative, -1) + sparse.diags_array(
        1.0 + 0.5 * state.heating
    )
    y_mass = y_log_x * by_mass - state.y
    by_g = (through @ sparse.diags_array(f[CONDUCTION] / mass) + sparse.diags_array(by_rise * p / mass)).tolil()
    by_theta = (through @ sparse.diags_array(-y_log_x) - sparse.diags_array(by_log_x)).tolil()
    mass_column = through @ y_mass + (state.overburden - p) * state.y_p - state.overburden * state.net_loss
    mass_column += by_log_x * by_mass + by_rise * (state.overburden_fraction - 1.0) * steep
    # The conditions at the surface, in the place of the energy balance there, and at the base.
    base = model.base_flux_slope(df[..., -1])
    by_g[0], by_theta[0] = 0.0, 0.0
    by_g[0, 0], by_theta[0, 0], mass_column[0] = f[CONDUCTION][0] / mass[0], -y_log_x[0], y_mass[0]
    at_base_g, at_base_theta = sparse.lil_array((1, count)), sparse.lil_array((1, count))
    at_base_g[0, -1], at_base_theta[0, -1] = f[CONDUCTION][-1] / mass[0], base - y_log_x[-1]
    mass_column = np.append(mass_column, y_mass[-1] - base * by_mass[-1])
    # theta at a node less that at the beginning of its piece.
    inner = _by_pieces(grid, grid.piece.integral, 1) @ sparse.diags_array(state.fraction[1])
    steps = sparse.eye_array(count, format="lil")
    for first, *others in grid.columns.tolist():
        steps[others, first] = -1.0
    surface = sparse.csr_array(([-1.0], ([0], [0])), shape=(count, 1))
    none = sparse.csr_array((count + 1, 1))
    return sparse.block_array(
        [
            [-inner, steps, surface, None],
            [sparse.vstack([by_g, at_base_g]), sparse.vstack([by_theta, at_base_theta]), none, mass_column[:, None]],
            [border[None, :count], None, border[-2:-1, None], border[-1:, None]],
        ],
        format="csc",
    )


def _by_pieces(grid: PiecewiseGrid, matrix: Array, power: int) -> Any:
    """A ``matrix`` of each piece, times a ``power`` of its width, as a sparse one of all nodes: at a break that of the
    piece to the left."""
    from scipy import sparse

    widths = np.diff(grid.breaks) ** power
    blocks = widths[:, None, None] * matrix
    rows = np.broadcast_to(grid.columns[:, :, None], blocks.shape)
    columns = np.broadcast_to(grid.columns[:, None, :], blocks.shape)
    wanted = np.ones(blocks.shape, dtype=bool)
    wanted[1:, 0] = False
    size = len(grid.nodes)
    return sparse.csr_array((blocks[wanted], (rows[wanted], columns[wanted])), shape=(size, size))
