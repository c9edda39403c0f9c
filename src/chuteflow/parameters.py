"""The parameters of a chute and of a search: one row each, from which options, files, studies, plots and pages are fed.

What is computed of a flow is in :mod:`chuteflow.steady.quantities`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from chuteflow.checks import number
from chuteflow.errors import InputError


@dataclass(frozen=True)
class Parameter:
    """A number of a chute.

    ``name`` is the argument of :class:`chuteflow.Chute`, ``key`` the name in JSON, in studies and on the command line;
    ``noun``, ``symbol`` and ``latex`` its notation, ``label`` what messages call it. It is from ``low`` to ``high``, as
    ``allowed`` says in short and ``rule`` in full; a value that is above ``high`` by no more than ``rounding`` is taken
    for it. ``of_base`` is whether it belongs to the base alone. All parameters are dimensionless.
    """

    name: str
    key: str
    noun: str
    symbol: str
    latex: str
    label: str
    low: float
    high: float
    allowed: str
    rule: str
    example: str
    description: str
    rounding: float = 0.0
    of_base: bool = False

    @property
    def highest(self) -> float:
        """The largest value that is taken, rounding included."""
        return self.high + self.rounding

    def rounded(self, value: float) -> float:
        """``value``, or ``high`` where it is above that by the rounding of printed digits alone."""
        return self.high if self.high < value <= self.highest else value

    def checked(self, value: Any) -> float:
        """``value`` as a number in range.

        Raises:
            InputError: naming what was given and what is allowed.
        """
        found = number(self.name, value)
        if not self.low <= found <= self.highest:
            raise InputError(f"{self.label} = {found}: {self.rule}")
        return self.rounded(found)


@dataclass(frozen=True)
class FlowCondition:
    """A number that picks flows out of a branch.

    ``key`` is the argument of :func:`chuteflow.flows` and the symbol in JSON and studies, ``quantity`` the name in the
    registry of quantities, ``option`` that on the command line. It is from ``low`` to ``high``.
    """

    key: str
    quantity: str
    option: str
    low: float
    high: float
    description: str


_SQRT_3_HALF = math.sqrt(3.0) / 2.0

#: The four numbers of a chute, by their names in :class:`chuteflow.Chute`.
PARAMETERS: dict[str, Parameter] = {
    parameter.name: parameter
    for parameter in (
        Parameter(
            name="slope",
            key="slope",
            noun="slope",
            symbol="tan(theta)",
            latex=r"\tan\theta",
            label="slope",
            low=1e-8,
            high=1e4,
            allowed="above 0",
            rule="tan(theta) must be positive (from 1e-8 to 1e4)",
            example="0.3",
            description="slope tan(theta) of the chute",
        ),
        Parameter(
            name="restitution",
            key="e",
            noun="restitution",
            symbol="e",
            latex="e",
            label="restitution e",
            low=1e-8,
            high=1.0,
            allowed="above 0 and at most 1",
            rule="must be above 0 (from 1e-8) and at most 1",
            example="0.8",
            description="coefficient of restitution of two grains",
        ),
        Parameter(
            name="wall_restitution",
            key="ew",
            noun="wall restitution",
            symbol="e_w",
            latex="e_w",
            label="wall restitution e_w",
            low=0.0,
            high=1.0,
            allowed="from 0 to 1",
            rule="must be from 0 to 1",
            example="0.8",
            description="coefficient of restitution of a grain and the base",
            of_base=True,
        ),
        Parameter(
            name="roughness",
            key="roughness",
            noun="roughness",
            symbol="r",
            latex="r",
            label="roughness r",
            low=0.5,
            high=_SQRT_3_HALF,
            allowed="from 1/2 to sqrt(3)/2",
            rule=f"must be from 1/2 to sqrt(3)/2 = {_SQRT_3_HALF:.6f}, where wall grains as large as the flowing ones "
            "leave no flat base to touch",
            example="0.6",
            description="roughness r of the base",
            # sqrt(3)/2 typed with a few digits rounds up: its last printed digits are allowed for.
            rounding=5e-5,
            of_base=True,
        ),
    )
}
#: The same by their keys.
BY_KEY: dict[str, Parameter] = {parameter.key: parameter for parameter in PARAMETERS.values()}
#: What else a chute has, each a name out of a list.
NAMES = ("surface", "closure")

#: Range searched by default.
SURFACE_TEMPERATURE = (1e-3, 1e5)
LARGEST_HOLDUP = 30.0
#: What can be searched at all.
WIDEST, SHALLOWEST, DEEPEST = (1e-24, 1e20), 1e-9, 300.0

_LEAST, _MOST = 1e-12, 1e12
#: Conditions on the flows of a chute, by their keys.
CONDITIONS: dict[str, FlowCondition] = {
    condition.key: condition
    for condition in (
        FlowCondition("T_surface", "surface_temperature", "temperature", *WIDEST, "surface temperature"),
        FlowCondition("Q", "mass_flux", "flux", _LEAST, _MOST, "mass flux"),
        FlowCondition("M", "mass_holdup", "holdup", _LEAST, DEEPEST, "mass hold-up"),
        FlowCondition("h", "centre_of_mass", "centre_of_mass", _LEAST, _MOST, "centre of mass"),
    )
}
