"""Following a solution curve to both sides of a point: its points, events located between them, and why it ends.

The points come from :func:`chuteflow.numerics.continuation.trace`. What is made of each, where a side ends, and which
events are located on a step, by :func:`chuteflow.numerics.continuation.locate`, is for the caller to say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from chuteflow.numerics.continuation import CurvePoint, System, Trace

S = TypeVar("S", bound=System)
P = TypeVar("P")


@dataclass(frozen=True, eq=False)
class Event(Generic[P]):
    """A special point of a curve: its ``kind``, and in ``position`` the index of the regular point before it."""

    kind: str
    point: P
    position: int


class Side(Generic[P]):
    """One side of a curve, from its start outwards, while it is followed.

    ``end`` says in words why it ends, and is empty until it does; ``closed`` is whether it returned to its start.
    """

    def __init__(self, *start: P) -> None:
        self.found: list[tuple[str, P]] = [("", point) for point in start]
        self.end = ""
        self.closed = False

    @property
    def points(self) -> list[P]:
        """The regular points."""
        return [point for kind, point in self.found if not kind]

    def add(self, point: P, kind: str = "") -> None:
        """Add the next point; with a ``kind``, an event."""
        self.found.append((kind, point))

    def stop(self, end: str, *, closed: bool = False) -> None:
        """End the side."""
        self.end, self.closed = end, closed


@dataclass(frozen=True, eq=False)
class FollowedCurve(Generic[P]):
    """A curve as far as it was followed: points in order, the events between them, and in words why it ends."""

    points: tuple[P, ...]
    events: tuple[Event[P], ...]
    ends: tuple[str, str]


def follow_side(
    path: Trace[S], side: Side[P], extend: Callable[[Side[P], CurvePoint[S] | None, CurvePoint[S]], None]
) -> Side[P]:
    """Follow one side until it is stopped, or until its ``path`` ends, which then says why.

    ``extend(side, previous, point)`` is called for each point of the path, first with None for the previous one. It
    adds to the side, and may stop it.
    """
    previous = None
    for point in path:
        extend(side, previous, point)
        if side.end:
            return side
        previous = point
    side.stop(path.status.value)
    return side


def follow_both_sides(follow: Callable[[float], Side[P]]) -> FollowedCurve[P]:
    """The curve through a start: ``follow(1.0)`` is its side along a direction, ``follow(-1.0)`` that against it.

    Each side begins with the start, and the curve runs along the direction. A closed curve has its start twice, as the
    first and the last point, and is followed to one side alone.
    """
    onward = follow(1.0)
    if onward.closed:
        return _join([*onward.found, onward.found[0]], (onward.end, onward.end))
    back = follow(-1.0)
    return _join([*back.found[:0:-1], *onward.found], (back.end, onward.end))


def _join(found: list[tuple[str, P]], ends: tuple[str, str]) -> FollowedCurve[P]:
    points: list[P] = []
    events: list[Event[P]] = []
    for kind, point in found:
        if kind:
            events.append(Event(kind, point, len(points) - 1))
        else:
            points.append(point)
    return FollowedCurve(tuple(points), tuple(events), ends)
