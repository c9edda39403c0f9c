"""Several constitutive laws fitted to the same measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from chuteflow import display
from chuteflow.errors import InputError, SolveError
from chuteflow.fitting.calibration import Fit, fit
from chuteflow.fitting.measurements import Measurements
from chuteflow.steady.chute import Chute
from chuteflow.theory.constitutive import Law


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Fits of several laws, by AICc from the best on; ``failed`` says why there is none for others."""

    fits: tuple[Fit, ...]
    failed: tuple[str, ...]

    def __repr__(self) -> str:
        said = ", ".join(f"{one.chute.closure} {delta:.1f}" for one, delta in zip(self.fits, self.deltas, strict=True))
        return display.line("LawComparison", f"AICc above the best: {said}")

    @property
    def deltas(self) -> list[float]:
        """By how much the AICc of each is above that of the best."""
        return [one.aicc - self.fits[0].aicc if one is not self.fits[0] else 0.0 for one in self.fits]


def compare(
    measured: Measurements, chute: Chute, free: Sequence[str], closures: Sequence[str | Law], **settings: Any
) -> LawComparison:
    """Fit ``free`` parameters under each of ``closures``, see :func:`chuteflow.fitting.calibration.fit`.

    Raises:
        InputError: for an unknown closure, or where none of them fits; and as for a fit.
    """
    found, failed, errors = [], [], []
    # Every law is looked up before anything is computed.
    for one in [replace(chute, closure=closure) for closure in closures]:
        try:
            found.append(fit(measured, one, free, **settings))
        except (InputError, SolveError) as error:
            failed.append(f"{one.closure}: {error}")
            errors.append(error)
    if not found:
        if len(errors) == 1:
            raise errors[0]
        raise InputError("; ".join(dict.fromkeys(failed)))
    return LawComparison(tuple(sorted(found, key=lambda one: one.aicc)), tuple(failed))
