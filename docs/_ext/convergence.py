"""The directive ``coefficients``: how the series of the two methods converge, drawn at build."""

import numpy as np
from docutils import nodes
from package import FromPackage
from sphinx.application import Sphinx

from chuteflow import Flow, flows
from chuteflow.paper.materials import dissipative
from chuteflow.plotting import style
from chuteflow.plotting.plots import write_figure
from chuteflow.steady.collocation import LOG_Q, prolong
from chuteflow.steady.mapped.solution import LARGEST_DEGREE, best_multiple, solve_mapped
from chuteflow.steady.solver import Condition

_FLUX = 3.0
#: Smaller coefficients are noise.
_ROUNDING = 1e-14
#: Degree to which a smooth overburden solution is solved again, to show where its coefficients meet rounding.
_FINE = 80
_FILE = "coefficients.png"
_SAID = (
    "Size of the Chebyshev coefficients against their number, for flows A, B and C: those of the overburden method "
    "fall fastest; those of the mapped method slowly in flow C, and with k = 1 hardly at all"
)


class Coefficients(FromPackage):
    """The coefficients of flows A, B and C by either method, against their number."""

    def run(self) -> list[nodes.Node]:
        """The picture; in a quick build what it shows."""
        return [self.image(_FILE, _SAID, lambda folder: write_figure(drawn(), folder / _FILE))]


def drawn():
    """One panel for each flow."""
    figure, axes = style.panels(3, height=3.1, shared_y=True)
    for ax, name, flow in zip(axes, "ABC", flows(dissipative(0.3), Q=_FLUX, tolerance=1e-11), strict=True):
        best = best_multiple(flow.centre_of_mass / flow.surface_temperature)
        lines = {"overburden": (_overburden(flow), style.LineStyle(style.BLUE, style.SOLID))}
        lines["mapped, $L = 2\\,T_\\infty$"] = (_mapped(flow, 1), style.LineStyle(style.VERMILION, style.DASHED))
        if best > 1:
            words = f"mapped, $L = {2 * best}\\,T_\\infty$"
            lines[words] = (_mapped(flow, best), style.LineStyle(style.GREEN, style.DASH_DOTTED))
        for words, (sizes, stroke) in lines.items():
            ax.semilogy(np.arange(len(sizes)), sizes, label=words, **stroke.line())
        style.name_axes(ax, "number of the coefficient", "size, over the largest" if name == "A" else None)
        ax.set_title(f"flow {name}", loc="left", **style.title())
        ax.set_xlim(0, 300 if name == "C" else 60)
        ax.set_ylim(1e-15, 2.0)
        # In flow C below the line that hardly falls.
        style.legend(ax, loc="upper right", bbox_to_anchor=(1.02, 0.76 if name == "C" else 1.0))
    return figure


def _overburden(flow: Flow):
    """Of g, the gradient of the heat potential."""
    problem, z = prolong(flow.solution.problem, flow.solution.z, _FINE)
    step = np.linalg.lstsq(problem.state(z).jacobian(), problem.state(z).residual())[0]
    return _envelope(problem.grid.to_coefficients @ (z - step)[:-2])


def _mapped(flow: Flow, multiple: int):
    """Of X, the root of nu."""
    found = solve_mapped(flow.chute, flow, Condition.fix(LOG_Q, _FLUX), LARGEST_DEGREE, multiple=multiple)
    return _envelope(found.x_coefficients)


def _envelope(coefficients):
    """The largest from each number on, as some vanish by chance, over the largest of all; down to rounding."""
    sizes = np.abs(coefficients)
    sizes = np.maximum.accumulate(sizes[::-1])[::-1] / sizes.max()
    return sizes[sizes > _ROUNDING]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("coefficients", Coefficients)
    return {"parallel_read_safe": True}
