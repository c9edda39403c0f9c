"""What is known of the stability of one flow, as it is told, saved and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from chuteflow.stability.budget import ModeBudget, energy_budget
from chuteflow.stability.modes import Mode
from chuteflow.stability.result import Stability
from chuteflow.steady.flow import Flow


@dataclass(frozen=True, eq=False)
class StabilityAnswer:
    """What is known of one flow: its stability and its leading modes."""

    flow: Flow
    found: Stability
    modes: tuple[Mode, ...]

    @cached_property
    def budget(self) -> ModeBudget | None:
        """The energy budget of the leading mode, where there is one."""
        return energy_budget(self.modes[0]) if self.modes else None
