"""The planes in which growth rates are mapped and neutral curves followed, and the scans of them.

One is that of the wavenumbers along and across the slope of one flow. The other has the wavenumber of waves in one
direction, in the logarithm, and the place along a branch of flows.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from chuteflow import display
from chuteflow.branches.paths import flow_between
from chuteflow.checks import check_size, number, pair
from chuteflow.errors import InputError, SolveError
from chuteflow.numerics.chebyshev import Array
from chuteflow.result import Result
from chuteflow.stability.modes import Disturbances, check_wavenumbers, leading, smallest_rate
from chuteflow.stability.neutral import EigenvalueGrid, NeutralCurve, NeutralPlane, neutral_curves
from chuteflow.stability.result import stability_of
from chuteflow.steady.flow import Flow
from chuteflow.threads import on_one_thread

#: Called with the fraction of a scan that is done.
Progress = Callable[[float], None]
#: Flows of a branch whose operators are kept, for the next point is near.
_KEPT = 8
_MOST_POINTS, _LARGEST_DEPTH_WAVENUMBER = 400, 100.0


def _silent(_: float) -> None:
    """No one looks on."""


@dataclass(frozen=True, eq=False)
class WavePlane:
    """Wavenumbers of one flow from ``low`` (kx, ky) on, in units of ``unit`` (kx, ky)."""

    disturbances: Disturbances
    low: tuple[float, float]
    unit: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """See :class:`chuteflow.stability.neutral.NeutralPlane`."""
        return 1.0, 1.0

    def wave(self, z: Array) -> tuple[Disturbances, float, float]:
        """See :class:`chuteflow.stability.neutral.NeutralPlane`."""
        kx, ky = np.array(self.low) + np.array(self.unit) * z
        return self.disturbances, float(kx), float(ky)


@dataclass(frozen=True, eq=False)
class FamilyPlane:
    """Waves at one ``angle`` to the slope (radians) on the flows of a branch.

    The first coordinate is (ln k - low) / unit, of k h with h the centre of mass; the second runs from the first to
    the last of ``flows`` by 0 to 1.
    """

    flows: Sequence[Flow]
    angle: float
    low: float
    unit: float
    _kept: OrderedDict[float, Disturbances] = field(default_factory=OrderedDict, repr=False)

    @property
    def size(self) -> tuple[float, float]:
        """See :class:`chuteflow.stability.neutral.NeutralPlane`."""
        return 1.0, 1.0

    def named(self, z: Array) -> Array:
        """k h and the place along the branch at points z (n, 2)."""
        return np.stack([np.exp(self.low + self.unit * z[:, 0]), z[:, 1]], axis=1)

    def flow(self, place: float) -> Flow:
        """The flow at a place between 0 and 1 along the branch, or a little outside; where it cannot be solved, the
        nearest of those given."""
        try:
            return self._at(place).flow
        except SolveError:
            return self.flows[int(np.clip(round(place * (len(self.flows) - 1)), 0, len(self.flows) - 1))]

    def wave(self, z: Array) -> tuple[Disturbances, float, float]:
        """See :class:`chuteflow.stability.neutral.NeutralPlane`."""
        disturbances = self._at(float(z[1]))
        k = float(np.exp(self.low + self.unit * z[0])) / disturbances.flow.centre_of_mass
        along, across = np.cos(self.angle), np.sin(self.angle)
        return disturbances, 0.0 if along < 1e-9 else k * float(along), 0.0 if across < 1e-9 else k * float(across)

    def _at(self, place: float) -> Disturbances:
        if place not in self._kept:
            flow = flow_between(self.flows, place * (len(self.flows) - 1))
            self._kept[place] = Disturbances(flow)
            if len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(place)
        return self._kept[place]


def scan_plane(plane: NeutralPlane, points: tuple[int, int], progress: Progress = _silent) -> EigenvalueGrid:
    """Leading eigenvalues at ``points`` evenly spaced over ``plane``; where the grids do not resolve it, that is
    marked."""
    a, b = (np.linspace(0.0, end, n) for end, n in zip(plane.size, points, strict=True))
    sigma = np.full(points, complex(np.nan, np.nan))
    grows, unresolved = np.zeros(points, dtype=bool), np.zeros(points, dtype=bool)
    # Flows change with b: one after the other.
    for j, up in enumerate(b):
        for i, right in enumerate(a):
            try:
                disturbances, kx, ky = plane.wave(np.array([right, up]))
                found = leading(disturbances, kx, ky)
            except SolveError:  # of the wave, or of the flow
                unresolved[i, j] = True
                continue
            if found:
                sigma[i, j] = found[0].sigma
                grows[i, j] = found[0].growth > max(disturbances.smallest_rate, found[0].error)
        progress((j + 1) / len(b))
    return EigenvalueGrid(a, b, sigma, grows, unresolved)


@dataclass(frozen=True, eq=False)
class WaveMap(Result):
    """Growth rates and frequencies (m, n) of the leading modes of ``flow`` over ``kx`` (m,) and ``ky`` (n,), in 1/d.

    NaN where no mode is distinguished from the continuous spectrum, which decays, and where ``unresolved`` (m, n):
    there the grids do not resolve whether a disturbance grows. ``grows`` (m, n) is where a mode grows faster than
    ``smallest_rate`` and its error. Points z (k, 2) of the ``neutral`` curves are kx and ky, and their errors are in
    1/d.
    """

    flow: Flow
    kx: Array
    ky: Array
    growth: Array
    frequency: Array
    grows: NDArray[np.bool_]
    unresolved: NDArray[np.bool_]
    smallest_rate: float
    neutral: tuple[NeutralCurve, ...]

    def __repr__(self) -> str:
        reach = (display.span("kx", self.kx), display.span("ky", self.ky), display.span("growth", self.growth.flat))
        return display.line("WaveMap", *reach, display.count_of(len(self.neutral), "neutral curve"))

    def _repr_html_(self) -> str:
        return display.html_table(repr(self)[1:-1], _HEADER, _rows(self.neutral))


@dataclass(frozen=True, eq=False)
class FamilyMap(Result):
    """Growth rates and frequencies (m, n) of waves at ``angle`` (degrees) to the slope on the flows of a branch.

    ``depth_wavenumber`` (m,) is k h with h the centre of mass, and ``flows`` (n) are those of the columns. NaN,
    ``grows`` and ``unresolved`` (m, n) are as in :class:`WaveMap`, with the ``smallest_rate`` (n) of each flow. Of each
    of the ``neutral`` curves, z (k, 2) is k h and the place along the branch from 0 to 1, the error is that of
    ln(k h), and ``neutral_flows`` has the flows.
    """

    flows: tuple[Flow, ...]
    angle: float
    depth_wavenumber: Array
    growth: Array
    frequency: Array
    grows: NDArray[np.bool_]
    unresolved: NDArray[np.bool_]
    smallest_rate: Array
    neutral: tuple[NeutralCurve, ...]
    neutral_flows: tuple[tuple[Flow, ...], ...]

    def __repr__(self) -> str:
        reach = (display.span("k h", self.depth_wavenumber), display.span("growth", self.growth.flat))
        flows, curves = display.count_of(len(self.flows), "flow"), display.count_of(len(self.neutral), "neutral curve")
        return display.line("FamilyMap", f"{flows}, waves at {self.angle:g} degrees", *reach, curves)

    def _repr_html_(self) -> str:
        return display.html_table(repr(self)[1:-1], _HEADER, _rows(self.neutral))


#: Columns of a table of neutral curves.
_HEADER = ["neutral curve", "points", "begins", "", "ends", "", "why it ends"]


def _rows(curves: Sequence[NeutralCurve]) -> list[list[str]]:
    return [
        [str(i), str(len(c.z)), *(display.number(v) for z in (c.z[0], c.z[-1]) for v in z), c.ends[1]]
        for i, c in enumerate(curves, 1)
    ]


@on_one_thread
@np.errstate(under="ignore")
def wave_map(
    flow: Flow,
    *,
    kx: tuple[float, float] | None = None,
    ky: tuple[float, float] | None = None,
    size: tuple[int, int] = (40, 40),
    progress: Progress = _silent,
) -> WaveMap:
    """Growth rates of ``flow`` over the wavenumbers along and across the slope, with the neutral curves.

    Args:
        flow: the steady flow.
        kx: range along the slope in 1/d; by default from 0 to three times the wavenumber of the fastest growing mode.
        ky: the same across the slope.
        size: points along kx and ky; about 20 ms each.
        progress: called with the fraction that is done.

    Raises:
        InputError: for wavenumbers or sizes out of range, and where stability cannot be posed.
    """
    _check_size(size)
    for name, ends in (("kx", kx), ("ky", ky)):
        if ends is not None:
            _check_range(name, *pair(name, ends))
    usual = _usual(flow) if kx is None or ky is None else 0.0
    ends = [(0.0, usual) if given is None else given for given in (kx, ky)]
    low, unit = [low for low, _ in ends], [high - low for low, high in ends]
    plane = WavePlane(Disturbances(flow), (low[0], low[1]), (unit[0], unit[1]))
    scan = scan_plane(plane, size, progress)
    curves = neutral_curves(plane, scan)
    scaled = [replace(c, z=np.array(low) + np.array(unit) * c.z, error=c.error * max(unit)) for c in curves]
    return WaveMap(
        flow,
        low[0] + unit[0] * scan.a,
        low[1] + unit[1] * scan.b,
        scan.growth,
        scan.frequency,
        scan.grows,
        scan.unresolved,
        plane.disturbances.smallest_rate,
        tuple(scaled),
    )


@on_one_thread
@np.errstate(under="ignore")
def family_map(
    flows: Sequence[Flow],
    *,
    angle: float,
    depth_wavenumber: tuple[float, float] = (1e-3, 1.0),
    size: tuple[int, int] = (24, 24),
    progress: Progress = _silent,
) -> FamilyMap:
    """Growth rates of waves in one direction along a branch of flows, with the neutral curves.

    Args:
        flows: neighbouring flows of one branch of :func:`chuteflow.curve`, in order.
        angle: of the waves to the slope, in degrees: 0 along it, 90 across.
        depth_wavenumber: range of k h, with h the centre of mass.
        size: points along k h, evenly in the logarithm, and along the branch; about 20 ms each.
        progress: called with the fraction that is done.

    Raises:
        InputError: for numbers out of range, and where stability cannot be posed.
    """
    _check_size(size)
    if len(flows) < 2:
        raise InputError(f"{len(flows)} flow: a branch needs at least 2")
    angle = number("angle", angle)
    if not 0.0 <= angle <= 90.0:
        raise InputError(f"angle {angle:g}: must be from 0 (along the slope) to 90 (across), in degrees")
    low, high = pair("depth_wavenumber", depth_wavenumber)
    if not 0.0 < low < high <= _LARGEST_DEPTH_WAVENUMBER:
        raise InputError(f"k h from {low:g} to {high:g}: must rise, from above 0 to {_LARGEST_DEPTH_WAVENUMBER:g}")
    low, high = np.log((low, high))
    plane = FamilyPlane(flows, float(np.radians(angle)), float(low), float(high - low))
    scan = scan_plane(plane, size, progress)
    curves = neutral_curves(plane, scan)
    columns = tuple(plane.flow(float(place)) for place in scan.b)
    return FamilyMap(
        flows=columns,
        angle=angle,
        depth_wavenumber=np.exp(low + (high - low) * scan.a),
        growth=scan.growth,
        frequency=scan.frequency,
        grows=scan.grows,
        unresolved=scan.unresolved,
        smallest_rate=np.array([smallest_rate(flow) for flow in columns]),
        neutral=tuple(
            replace(
                c, z=np.stack([np.exp(low + (high - low) * c.z[:, 0]), c.z[:, 1]], axis=1), error=c.error * plane.unit
            )
            for c in curves
        ),
        neutral_flows=tuple(tuple(plane.flow(float(place)) for place in c.z[:, 1]) for c in curves),
    )


def _usual(flow: Flow) -> float:
    """Three times the wavenumber of the fastest growing mode, or 1/h where none grows."""
    found = stability_of(flow)
    if not found.grows or found.mode is None or found.mode.direction == "uniform":
        return 1.0 / flow.centre_of_mass
    return 3.0 * float(np.hypot(found.mode.kx, found.mode.ky))


def _check_size(size: tuple[int, int]) -> None:
    check_size(size, 4, _MOST_POINTS)


def _check_range(name: str, low: float, high: float) -> None:
    for k in (low, high):
        check_wavenumbers(*((k, 0.0) if name == "kx" else (0.0, k)))
    if not low < high:
        raise InputError(f"{name} from {low:g} to {high:g}: the range must rise")
