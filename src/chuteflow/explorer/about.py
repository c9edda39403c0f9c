"""Metadata for the page: its controls, cases, quantities and their units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from chuteflow import __version__
from chuteflow.explorer import queries
from chuteflow.steady.quantities import QUANTITIES
from chuteflow.steady.validity import WORDS


def about(data: Sequence[Mapping[str, Any]] = (), first: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Controls, cases, limits of validity and quantities as JSON objects, with ``data``, the measurements, and
    ``first``, what the state has at first that the first case has not."""
    return {
        "version": __version__,
        "data": list(data),
        "first": dict(first or {}),
        "controls": {name: asdict(control) for name, control in queries.CONTROLS.items()},
        "presets": [asdict(preset) for preset in queries.PRESETS],
        "cases": [asdict(case) for case in queries.cases()],
        "validity": WORDS,
        "choices": {name: asdict(choice) for name, choice in queries.CHOICES.items()},
        "quantities": {
            quantity.symbol: {
                "description": quantity.description,
                "unit": quantity.unit,
                "dimension": quantity.dimension,
            }
            for quantity in QUANTITIES.values()
        },
    }
