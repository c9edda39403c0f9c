"""The range of surface temperatures and hold-ups that is searched."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from chuteflow.checks import number, pair
from chuteflow.errors import InputError
from chuteflow.numerics.chebyshev import Array
from chuteflow.parameters import DEEPEST, SHALLOWEST, WIDEST
from chuteflow.steady.collocation import LOG_M, LOG_Q, LOG_T

#: A flow this near to an edge, in the logarithm, is at the edge; rounding allowed beyond it.
_NEAR, _ROUNDING = 0.3, 1e-9
#: How far a search goes beyond a hold-up and a requested flux, so that turns near them are seen from both sides.
_DEEPER, _FURTHER = 1.5, 3.0


class BranchEnd(StrEnum):
    """Why a branch ends, in words; those that leave the range go on with the number at its edge."""

    VANISHES = "its hold-up vanishes"
    CLOSED = "the branch closes on itself"
    DEEPER = "it goes on to hold-ups above"
    HOTTER = "it goes on to surface temperatures above"
    COLDER = "it goes on to surface temperatures below"
    LOST = "it could not be followed further"
    NOT_SEARCHED = "the search was not carried further"

    @classmethod
    def of(cls, words: str) -> BranchEnd:
        """The kind of an end that is told in ``words``; NOT_SEARCHED for words of another method."""
        return next((end for end in cls if words.startswith(end)), cls.NOT_SEARCHED)

    @property
    def is_final(self) -> bool:
        """Whether there are no more flows beyond."""
        return self in (BranchEnd.VANISHES, BranchEnd.CLOSED)


@dataclass(frozen=True)
class SearchRange:
    """Surface temperatures from ``coldest`` to ``hottest``, hold-ups from ``shallowest`` to ``deepest``.

    A branch may end at an interface whose flow has vanished; on the half-line thin flows have a hold-up in
    proportion to their temperature, and no branch ends so. Mass fluxes above ``largest_flux`` are not asked for: a
    branch may end on its way to them.
    """

    coldest: float
    hottest: float
    deepest: float
    shallowest: float
    largest_flux: float = np.inf

    @classmethod
    def checked(
        cls, surface_temperature: tuple[float, float], largest_holdup: float, surface: str = "free"
    ) -> SearchRange:
        """The range given.

        Raises:
            InputError: if it is empty or beyond what can be searched.
        """
        low, high = pair("surface_temperature", surface_temperature)
        largest_holdup = number("largest_holdup", largest_holdup)
        if not WIDEST[0] <= low < high <= WIDEST[1]:
            raise InputError(
                f"surface temperatures from {low:g} to {high:g}: must rise, within {WIDEST[0]:g} to {WIDEST[1]:g}"
            )
        if not SHALLOWEST <= largest_holdup <= DEEPEST:
            raise InputError(f"largest hold-up {largest_holdup:g}: must be from {SHALLOWEST:g} to {DEEPEST:g}")
        return cls(low, high, largest_holdup, SHALLOWEST if surface == "interface" else 0.0)

    def reaching(self, axis: int, value: float) -> SearchRange:
        """The range widened, as far as allowed, to ``value`` of the surface temperature or hold-up."""
        if axis == LOG_M:
            return replace(self, deepest=min(max(self.deepest, value), DEEPEST))
        return replace(
            self,
            coldest=max(min(self.coldest, value), WIDEST[0]),
            hottest=min(max(self.hottest, value), WIDEST[1]),
        )

    def restrict(self, which: int, value: float) -> SearchRange:
        """The part of the range in which all flows lie at which the quantity ``which`` has a ``value``: no deeper than
        a given hold-up, and with trajectories no further than to a given flux, but for a margin."""
        if which == LOG_M:
            return replace(self, deepest=min(self.deepest, _DEEPER * value))
        return replace(self, largest_flux=_FURTHER * value) if which == LOG_Q else self

    def contains(self, macroscopic: Array, margin: float = _ROUNDING) -> bool:
        """Whether a flow (ln Q, ln h, ln M, ln T_surface) lies in the range, within ``margin``."""
        return bool(
            np.log(self.coldest) - margin <= macroscopic[LOG_T] <= np.log(self.hottest) + margin
            and macroscopic[LOG_M] <= np.log(self.deepest) + margin
            and (self.shallowest == 0.0 or macroscopic[LOG_M] >= np.log(self.shallowest) - margin)
        )

    def edge(self, macroscopic: Array, axis: int) -> int:
        """-1 or 1 where a flow lies at the lower or upper edge of LOG_T, 1 at the edge of LOG_M, else 0."""
        if axis == LOG_T and macroscopic[LOG_T] < np.log(self.coldest) + _NEAR:
            return -1
        upper = self.hottest if axis == LOG_T else self.deepest
        return int(macroscopic[axis] > np.log(upper) - _NEAR)

    def at_edge(self, macroscopic: Array, near: float) -> tuple[int, float] | None:
        """The edge at which a flow lies to within ``near``: LOG_T or LOG_M, and its value there."""
        edges = [(LOG_M, self.deepest), (LOG_T, self.hottest), (LOG_T, self.coldest)]
        if self.shallowest > 0.0:
            edges.append((LOG_M, self.shallowest))
        for axis, value in edges:
            if abs(float(macroscopic[axis]) - np.log(value)) < near:
                return axis, float(np.log(value))
        return None

    def end_words(self, macroscopic: Array) -> str:
        """Why a branch ends at a flow."""
        edge = self.at_edge(macroscopic, _NEAR)
        if edge is None:
            return BranchEnd.NOT_SEARCHED
        axis, value = edge
        if axis == LOG_M:
            if value == np.log(self.deepest):
                return f"{BranchEnd.DEEPER} {self.deepest:g}"
            return BranchEnd.VANISHES
        if value == np.log(self.hottest):
            return f"{BranchEnd.HOTTER} {self.hottest:g}"
        return f"{BranchEnd.COLDER} {self.coldest:g}"
