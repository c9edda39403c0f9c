"""The Q-h curve of the paper's figure 3, with both folds, by this package and by what one would pick instead.

All start from the flow with Q = 6 on the hot branch and go down to the cold one with Q = 0.7, which has
T_inf = 0.0101. The package also finds out, at each run, whether there are other branches. Folds and the flows at
Q = 3 are compared with those of the package at its tightest tolerance; it and the paper's method, which share no
discretisation, agree to 1e-9.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import by_auto
import by_bice
from chuteflow import Chute, Curve, curve, flows
from chuteflow.steady.mapped.curve import mapped_curve
from timing import Row, forget_search, median_time

Array = NDArray[np.float64]
PAPER = Chute(slope=0.3, restitution=0.8, wall_restitution=0.8, roughness=0.6)
FIRST, LAST, ASKED = 6.0, 0.7, 3.0
#: Surface temperatures of both ends, about; the mapped method is asked for what it reaches.
ENDS, MAPPED_ENDS = (0.0101, 44.0), (0.06, 44.0)
POINTS = 100
#: What is aimed at against AUTO: so many times faster, and nearer to the folds.
FASTER, NEARER = 20.0, 1000.0
#: A fold found is one of the flow's if it is nearer than this, relatively.
_SAME = 1e-2


def compared() -> list[Row]:
    """One row for each way to the curve."""
    own = median_time(_own, 9, before=forget_search).cpu
    folds, error = _folds(_own(1e-11))
    drift = float(np.abs(_folds(_own())[0] / folds - 1.0).max())
    rows = [
        Row(
            f"chuteflow: all branches, {POINTS} points",
            own,
            "ms",
            own,
            10.0,
            note=f"folds at Q = {folds[0]:.10f} and {folds[1]:.10f}; estimated error {error:.0e}, and {drift:.0e} "
            "from those at the tightest tolerance",
        )
    ]
    return [*rows, *_by_auto(own, folds, error), _by_bice(own, folds), _by_mapped(own, folds)]


def _own(tolerance: float = 1e-10) -> Curve:
    return curve(PAPER, surface_temperature=ENDS, points=POINTS, tolerance=tolerance)


def _folds(found: Curve) -> tuple[Array, float]:
    """Q at the folds, ascending, and the largest estimated error of their flows."""
    turning = [point.flow for branch in found.branches for point in branch.special if point.kind == "fold-Q"]
    return np.sort([flow.mass_flux for flow in turning]), max(flow.error for flow in turning)


def _off(found: Array, folds: Array) -> list[float]:
    """How far from each fold the nearest one found is, relatively; infinite where there is none."""
    gaps = [float(np.abs(found / fold - 1.0).min(initial=np.inf)) for fold in folds]
    return [gap if gap < _SAME else np.inf for gap in gaps]


def _in_words(gaps: list[float]) -> str:
    words = ["a fold missed" if np.isinf(gap) else f"{gap:.0e}" for gap in gaps]
    return "folds off by " + " and ".join(words)


def _by_auto(own: float, folds: Array, error: float) -> list[Row]:
    without = by_auto.missing()
    if without:
        return [Row("AUTO-07p", None, "times", note=without)]
    start = flows(PAPER, Q=FIRST)[0]
    rows = []
    for setting in by_auto.SETTINGS:
        with tempfile.TemporaryDirectory() as folder:
            found = by_auto.traced(setting, start, LAST, ASKED, Path(folder), 5)
        gaps = _off(found.folds[:, 0], folds)
        note = f"{found.time.cpu:.0f} ms, {len(found.points)} points; {_in_words(gaps)}; {_flows(found.asked)}"
        if len(found.folds) > len(folds):
            note += f"; {len(found.folds)} folds"
        if not len(found.points) or found.points[-1, 0] > 1.01 * LAST:
            note += "; the cold branch lost"
        ratio = found.time.cpu / own
        rows.append(Row(f"AUTO-07p over it: {setting.name}", ratio, "times", None, FASTER, best="large", note=note))
        if np.isfinite(gaps).all():
            nearer = max(gaps) / error
            note = "largest error at a fold; its output has 11 digits"
            rows.append(Row("    its error over ours", nearer, "times", None, NEARER, best="large", note=note))
    return rows


def _flows(asked: Array) -> str:
    """How far the flows found at Q = ASKED are from what they should be, in h and M."""
    named = dict(zip("ABC", flows(PAPER, Q=ASKED, tolerance=1e-11), strict=True))
    words = []
    for name, flow in named.items():
        right = np.array([flow.mass_flux, flow.centre_of_mass, flow.mass_holdup])
        gaps = np.abs(asked / right - 1.0).max(axis=1, initial=0.0)
        gap = float(gaps.min(initial=np.inf))
        words.append(f"{name} {gap:.0e}" if gap < _SAME else f"{name} missed")
    return f"flows at Q = {ASKED:g}: " + ", ".join(words)


def _by_bice(own: float, folds: Array) -> Row:
    without = by_bice.missing()
    if without:
        return Row("bice", None, "times", note=without)
    found = by_bice.traced(flows(PAPER, Q=FIRST)[0], LAST, 3)
    note = (
        f"{found.time.cpu:.0f} ms, {len(found.points)} points; {_in_words(_off(found.folds, folds))}; {found.said}; "
        f"on this package's grid, degree {by_bice.DEGREE}"
    )
    return Row("bice over it", found.time.cpu / own, "times", best="large", note=note)


def _by_mapped(own: float, folds: Array) -> Row:
    start = flows(PAPER, Q=FIRST)[0]
    found = mapped_curve(start, surface_temperature=MAPPED_ENDS)
    time = median_time(lambda: mapped_curve(start, surface_temperature=MAPPED_ENDS), 3)
    gaps = _off(np.array([flow.mass_flux for flow in found.folds]), folds)
    note = (
        f"{time.cpu:.0f} ms, {len(found.flows)} points; {_in_words(gaps)}; to T_inf = "
        f"{found.surface_temperature.min():.2g}: {found.ends[1]}; N up to {max(f.degree for f in found.flows)}"
    )
    return Row("the paper's mapped method over it", time.cpu / own, "times", best="large", note=note)
