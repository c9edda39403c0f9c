"""Disturbances at the top of the package: their growth, neutral curves, and a disturbed flow followed in time.

The analyses themselves are in the modules beside this one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from chuteflow.branches.curve import curve
from chuteflow.branches.results import Branch, Curve
from chuteflow.checks import number
from chuteflow.errors import InputError
from chuteflow.progress import report_progress
from chuteflow.stability import relaxation
from chuteflow.stability.layer import Layer
from chuteflow.stability.planes import FamilyMap, WaveMap, family_map, wave_map
from chuteflow.stability.relaxation import Relaxation, disturb, outcome
from chuteflow.steady.chute import Chute
from chuteflow.steady.flow import Flow

#: Flows of a branch between which others are solved, and the range of surface temperatures, where a chute is given.
FLOWS, TEMPERATURES = 80, (0.05, 50.0)
#: How long a flow is followed, and by how much it is heated, by default.
DURATION, LONGEST, HEAT = 2000.0, 1e8, 1.1
Progress = Callable[[float], None]


def growth(
    flow: Flow,
    *,
    kx: tuple[float, float] | None = None,
    ky: tuple[float, float] | None = None,
    size: tuple[int, int] = (40, 40),
    progress: Progress | None = None,
) -> WaveMap:
    """Growth rates of ``flow`` over the wavenumbers along and across the slope, with the neutral curves.

    Args:
        flow: the steady flow.
        kx: range of wavenumbers along the slope, in 1/d; by default to three times that of the fastest growing mode.
        ky: range of wavenumbers across the slope.
        size: points along kx and ky.
        progress: called with the fraction that is done; without it, a terminal or notebook shows a line.

    Raises:
        InputError: for numbers out of range, and where stability cannot be posed.
    """
    with report_progress("growth", progress) as tell:
        return wave_map(flow, kx=kx, ky=ky, size=size, progress=tell)


def neutral(
    line: Chute | Curve | Branch | Sequence[Flow],
    *,
    angle: float = 0.0,
    depth_wavenumber: tuple[float, float] = (1e-3, 1.0),
    size: tuple[int, int] = (24, 24),
    progress: Progress | None = None,
) -> FamilyMap:
    """Growth rates of waves in one direction along a branch of flows, with the neutral curves.

    Args:
        line: neighbouring flows of one branch: a branch, the first branch of a curve, or a chute, of which the hottest
            branch is followed over surface temperatures from 0.05 to 50.
        angle: of the waves to the slope, in degrees: 0 along it, 90 across.
        depth_wavenumber: range of k h, with h the centre of mass.
        size: points along k h and along the branch.
        progress: called with the fraction that is done; without it, a terminal or notebook shows a line.

    Raises:
        InputError: for numbers out of range, a chute without flows, and where stability cannot be posed.
    """
    if isinstance(line, Chute):
        line = curve(line, points=FLOWS, surface_temperature=TEMPERATURES)
    if isinstance(line, Curve):
        if not line.branches:
            raise InputError(f"there is no flow: {line.reason}")
        line = line.branches[0]
    flows = line.flows if isinstance(line, Branch) else tuple(line)
    with report_progress("neutral", progress) as tell:
        return family_map(flows, angle=angle, depth_wavenumber=depth_wavenumber, size=size, progress=tell)


def relax(
    flow: Flow,
    *,
    temperature: float | None = None,
    velocity: float | None = None,
    duration: float = DURATION,
    progress: Progress | None = None,
) -> Relaxation:
    """A disturbed ``flow`` followed in time, the same all along the chute and of one hold-up.

    Args:
        flow: a steady flow with a free surface.
        temperature: factor on the granular temperature at the start; 1.1 by default, or 1 where a velocity is given.
        velocity: factor on the velocity at the start; 1 by default.
        duration: time, in sqrt(d/(g cos theta)).
        progress: called with the time that is reached; without it, a terminal or notebook shows a line.

    Raises:
        InputError: for a factor or duration out of range.
        SolveError: where the integration cannot continue.
    """
    duration = number("duration", duration)
    if not 0.0 < duration <= LONGEST:
        raise InputError(f"duration = {duration:g}: must be above 0 and at most {LONGEST:g}")
    if temperature is None:
        temperature = HEAT if velocity is None else 1.0
    layer = Layer.of(flow)
    start = disturb(layer.steady(flow), temperature, 1.0 if velocity is None else velocity)
    moments = []
    with report_progress("relax", None if progress is None else lambda _: progress(moments[-1].time)) as tell:
        for moment in relaxation.relax(layer, start, duration):
            moments.append(moment)
            tell(moment.time / duration)
    return Relaxation(flow, tuple(moments), outcome(layer, moments))
