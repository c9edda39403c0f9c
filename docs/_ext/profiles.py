"""The directive ``density-profiles``: the volume fraction of every flow of one question, drawn at build."""

from pathlib import Path

import numpy as np
from docutils import nodes
from package import FromPackage
from sphinx.application import Sphinx

from chuteflow import Chute, FlowSet, flows
from chuteflow.plotting import style
from chuteflow.plotting.plots import write_figure

_FILE = "density-profiles.png"
_COLUMNS = 6
_POINTS = 800
_SAID = (
    "Volume fraction against height in each of the flows: below a dilute upper part most have dense layers with less "
    "dense ones between them; the thinner the upper part, the more layers, and the weaker they are"
)


class DensityProfiles(FromPackage):
    """Profiles of the flows of the chute slope, e, e_w, r that have the hold-up M: the five numbers of the argument."""

    required_arguments = 5

    def run(self) -> list[nodes.Node]:
        """The picture; in a quick build what it shows."""
        slope, e, e_w, r, holdup = map(float, self.arguments)

        def make(folder: Path) -> None:
            write_figure(drawn(flows(Chute(slope, e, e_w, r), M=holdup)), folder / _FILE)

        return [self.image(_FILE, _SAID, make)]


def drawn(found: FlowSet):
    """One panel for each flow."""
    rows = -(-len(found) // _COLUMNS)
    figure, axes = style.panels(_COLUMNS, rows, height=1.9 * rows + 0.3, shared_y=True)
    top = 1.1 * max(flow.depth for flow in found)
    for i, (ax, flow) in enumerate(zip(axes, found, strict=False)):
        z = np.linspace(0.0, top, _POINTS)
        ax.plot(flow.profile(z).volume_fraction, z, **style.LineStyle(style.BLUE).line())
        left, below = i % _COLUMNS == 0, i >= len(found) - _COLUMNS
        style.name_axes(ax, "$\\nu$" if below else None, "height, $z$" if left else None)
        ax.set_xlim(0.0, 0.65)
        ax.set_ylim(0.0, top)
        ax.set_title(f"$Q = {flow.mass_flux:.0f}$", loc="right", math_fontfamily="stix", **style.title())
    for ax in axes[len(found) :]:
        ax.set_visible(False)
    return figure


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("density-profiles", DensityProfiles)
    return {"parallel_read_safe": True}
