"""What a claim is, how its verdict is decided, and the table of all claims.

A claim is one function without arguments that computes and returns a :class:`Finding`, under the decorator
:func:`claim`. The verdict follows from what was computed: ``holds`` is whether the statement holds as printed;
where it does not, ``corrected`` is whether what is said in its place does, by an argument of its own.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from chuteflow.errors import InputError

CONFIRMED, CORRECTED, NOT_CONFIRMED = "confirmed", "corrected", "not confirmed"
VERDICTS: tuple[str, ...] = (CONFIRMED, CORRECTED, NOT_CONFIRMED)

#: What can be compared: a number, words, or several of them by name.
Value = float | str | Mapping[str, float | str]


@dataclass(frozen=True)
class Finding:
    """What a claim's function computed; ``reason`` is one sentence or two, with the numbers that decide."""

    printed: Value
    computed: Value
    verdict: str
    reason: str


@dataclass(frozen=True)
class ClaimResult:
    """The outcome of one claim.

    ``source`` is the place in the paper; ``printed`` and ``computed`` are numbers, words, or several by name, which
    :func:`shown` makes into text; ``verdict`` is one of VERDICTS.
    """

    id: str
    statement: str
    source: str
    printed: Value
    computed: Value
    verdict: str
    reason: str


@dataclass(frozen=True)
class Claim:
    """A statement of the paper at ``source``, and the function that tests it."""

    id: str
    statement: str
    source: str
    test: Callable[[], Finding]

    @property
    def sections(self) -> tuple[str, ...]:
        """The sections that the source names, such as "4.3" or "appendix"."""
        return tuple(re.findall(r"(?<=section )\d(?:\.\d)?|appendix", self.source))

    def check(self) -> ClaimResult:
        """Compute, and give the verdict."""
        found = self.test()
        return ClaimResult(
            self.id, self.statement, self.source, found.printed, found.computed, found.verdict, found.reason
        )


#: All claims by id, in the order of the paper.
CLAIMS: dict[str, Claim] = {}


def claim(id: str, source: str, statement: str) -> Callable[[Callable[[], Finding]], Callable[[], Finding]]:
    """Enter the decorated function into CLAIMS."""

    def enter(test: Callable[[], Finding]) -> Callable[[], Finding]:
        if id in CLAIMS:
            raise ValueError(f"there are two claims {id!r}")
        CLAIMS[id] = Claim(id, statement, source, test)
        return test

    return enter


def check(ids: Iterable[str] | None = None) -> Iterator[ClaimResult]:
    """The verdicts on the claims ``ids``, by default on all, computed one at a time in the order of the paper.

    Raises:
        InputError: for an id that is not in CLAIMS, before anything is computed.
    """
    wanted = list(CLAIMS) if ids is None else list(ids)
    for id in wanted:
        if id not in CLAIMS:
            raise _unknown(id)
    chosen = [found for id, found in CLAIMS.items() if id in wanted]
    return (found.check() for found in chosen)


def matching(words: Iterable[str]) -> list[str]:
    """The ids that are one of ``words``, or have one in them, in the order of the paper.

    Raises:
        InputError: for a word without any.
    """
    found: set[str] = set()
    for word in words:
        ids = [word] if word in CLAIMS else [id for id in CLAIMS if word and word in id]
        if not ids:
            raise _unknown(word)
        found.update(ids)
    return [id for id in CLAIMS if id in found]


def _unknown(id: str) -> InputError:
    near = difflib.get_close_matches(id, CLAIMS, n=3, cutoff=0.4)
    advice = f"did you mean {' or '.join(near)}?" if near else f"they are from {next(iter(CLAIMS))} on, see --list"
    return InputError(f"there is no claim {id!r}: {advice}")


def decide(
    printed: Value, computed: Value, *, holds: bool, reason: str, corrected: bool = False, correction: str = ""
) -> Finding:
    """A finding: confirmed where the statement ``holds``; else corrected where ``corrected`` holds; else not confirmed.

    ``reason`` is true either way; ``correction`` is added where the verdict is "corrected".
    """
    verdict = CONFIRMED if holds else CORRECTED if corrected else NOT_CONFIRMED
    words = [reason, correction] if verdict == CORRECTED else [reason]
    return Finding(printed, computed, verdict, " ".join(word for word in words if word))


def rounds_to(value: float, printed: str) -> bool:
    """Whether ``value`` is ``printed``, a decimal number such as "7.34", at its last digit."""
    decimals = len(printed.partition(".")[2])
    return math.isfinite(value) and abs(value - float(printed)) <= 0.5 * 10.0**-decimals * (1.0 + 1e-9)


def close(value: float, other: float, tolerance: float) -> bool:
    """Whether two numbers agree to a relative ``tolerance``; never where one is not finite."""
    return math.isfinite(value) and math.isfinite(other) and abs(value - other) <= tolerance * abs(other)


def shown(value: Value) -> str:
    """A value as text: numbers in up to five digits, several as "name: value; name: value"."""
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {shown(part)}" for name, part in value.items())
    return value if isinstance(value, str) else f"{value:.5g}"
