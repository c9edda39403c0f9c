"""Tables of many measured flows, each compared with the theory."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from chuteflow.dem import records
from chuteflow.dem.comparison import UPWARD, Comparison, Difference, compare
from chuteflow.dem.measured import Measured
from chuteflow.errors import InputError

#: The laws that flows are compared with unless others are given; the first gives the columns of the table.
CLOSURES = ("lun", "garzo-dufty-fourier")
#: A mean temperature below which a flow is cold, layers that slide over one another, and the drift over 300 time units
#: up to which the functions of a flow that is not steady are shown.
COLD, SLOW = 0.1, 0.1
#: Heights that are kept of a run.
HEIGHTS = 30
#: Differences from the first law that the table shows.
_COMPARED = (
    "g1",
    UPWARD,
    "g2",
    "g5",
    "slip, r by area",
    "base heat, r by area",
    "slip, r by spacing",
    "base heat, r by spacing",
)


@dataclass(frozen=True, eq=False)
class StudyResult:
    """A named measured flow, and its comparison with the theory at the same hold-up."""

    name: str
    comparison: Comparison

    @property
    def measured(self) -> Measured:
        """The measured flow."""
        return self.comparison.measured

    @property
    def state(self) -> str:
        """ "at rest" where it comes to rest, "cold" where the granular temperature is small, else its steadiness."""
        if self.measured.notes.get("comes_to_rest") == "yes":
            return "at rest"
        temperature = self.measured.numbers.get("mean_temperature", math.inf)
        return "cold" if temperature < COLD else self.measured.steadiness

    @property
    def is_slow(self) -> bool:
        """Whether it moves, and changes slowly enough for time averages to be those of one state."""
        drifts = [abs(one.value) for one in self.measured.drifts.values()]
        return self.state != "at rest" and max(drifts, default=0.0) < SLOW

    def flux_ratios(self, closure: str, mapping: str) -> list[float]:
        """Q of the theory over that of the particles, of each flow at the same hold-up, from hot to cold."""
        return [
            one.flow.mass_flux / self.measured.numbers["mass_flux"]
            for one in self.comparison.candidates
            if (one.closure, one.mapping) == (closure, mapping)
        ]


def read_folder(folder: str | os.PathLike[str], closures: Sequence[str] = CLOSURES) -> Iterator[StudyResult]:
    """The measured flows in the files of a folder, by name, each compared with the theory.

    Raises:
        InputError: for a folder without such files, or one that is damaged.
    """
    path = Path(folder)
    files = sorted(file for file in path.glob("*") if file.suffix in records.SAVED) if path.is_dir() else []
    if not files:
        raise InputError(f"{folder} holds no measured flows, .nc or .csv")
    for file in files:
        yield StudyResult(file.stem, compare(records.load(file), closures, conditions=("M",)))


def thin(measured: Measured, heights: int = HEIGHTS) -> Measured:
    """``measured`` at fewer heights, spread evenly over the overburden; the means over tenths stay the same."""
    fraction = measured.fraction_above
    wanted = np.linspace(float(np.nanmax(fraction)), max(float(np.nanmin(fraction)), 0.02), heights)
    chosen = np.unique([int(np.nanargmin(np.abs(fraction - value))) for value in wanted])
    return replace(
        measured,
        height=measured.height[chosen],
        fields={name: values[chosen] for name, values in measured.fields.items()},
        errors={name: values[chosen] for name, values in measured.errors.items()},
    )


def rest_slope(roughness: float) -> float:
    """The slope up to which a grain without friction rests in a pocket of a triangular base, rows across the slope,
    with bumps as large as grains: (r/sqrt 3)/sqrt(1 - 4 r^2/3)."""
    squared_height = 1.0 - 4.0 * roughness**2 / 3.0
    return roughness / math.sqrt(3.0) / math.sqrt(squared_height) if squared_height > 0.0 else math.inf


def table(results: Sequence[StudyResult], closures: Sequence[str] = CLOSURES) -> list[list[str]]:
    """Rows of cells with a heading: the run, its flow, and the theory beside it."""
    header = ["run", "e", "slope", "M", "r", "state", "drift of Q", "Q", "T_mean", "nu"]
    header += [f"Q {closure[:3]}/{mapping}" for closure in closures for mapping in ("area", "spacing")]
    header += ["g1", "g1(T_z)", "g2", "g5", "slip", "heat", "slip/spacing", "heat/spacing"]
    return [header, *(_row(one, closures) for one in results)]


def _row(one: StudyResult, closures: Sequence[str]) -> list[str]:
    measured = one.measured
    numbers, errors = measured.numbers, measured.number_errors
    drift = measured.drifts.get("mass_flux")
    ratios = [one.flux_ratios(closure, mapping) for closure in closures for mapping in ("area", "spacing")]
    # Means over a flow that changes much are those of no state.
    found = {d.name: d for d in one.comparison.functions[0].differences} if one.is_slow else {}
    return [
        one.name,
        *(f"{value:g}" for value in (measured.restitution, measured.slope)),
        f"{measured.holdup:.3f}",
        f"{measured.roughness:.3g}",
        one.state,
        "" if drift is None else f"{100.0 * drift.value:+.1f}±{100.0 * drift.error:.1f} %",
        f"{numbers['mass_flux']:.4g}±{errors.get('mass_flux', math.nan):.1g}",
        f"{numbers.get('mean_temperature', math.nan):.3g}",
        f"{np.nanmax(measured.tenths['volume_fraction']):.2g}",
        *(" ".join(f"{ratio:.3f}" for ratio in each) or "none" for each in ratios),
        *(_percent(found.get(name)) for name in _COMPARED),
    ]


def _percent(one: Difference | None) -> str:
    if one is None or not math.isfinite(one.relative):
        return "-"
    return f"{100.0 * one.relative:+.1f}±{100.0 * one.error:.1f}"
