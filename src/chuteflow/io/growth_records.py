"""Growth rates and neutral curves as JSON objects and as rows of CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.io import contract
from chuteflow.steady.quantities import NUMBERS, Scales

if TYPE_CHECKING:
    from chuteflow.stability.neutral import NeutralCurve
    from chuteflow.stability.planes import FamilyMap, WaveMap


def wave_object(found: WaveMap, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow growth --json`` prints; in SI units where ``scales`` are given."""
    chute = found.flow.chute
    wave, rate = (contract.factor(name, chute, scales) for name in ("wavenumber", "growth"))
    return {
        "chute": contract.chute_object(chute),
        "flow": contract.flow_object(found.flow, scales),
        "kx": (wave * found.kx).tolist(),
        "ky": (wave * found.ky).tolist(),
        "growth": _finite(rate * found.growth),
        "frequency": _finite(rate * found.frequency),
        "threshold": rate * found.smallest_rate,
        "growing": int(found.grows.sum()),
        "unresolved": [
            {"kx": wave * float(found.kx[i]), "ky": wave * float(found.ky[j])}
            for i, j in np.argwhere(found.unresolved).tolist()
        ],
        "neutral": [
            {
                "kx": (wave * curve.z[:, 0]).tolist(),
                "ky": (wave * curve.z[:, 1]).tolist(),
                **_of_curve(curve, rate, wave),
            }
            for curve in found.neutral
        ],
        **contract.units_object(scales, (*NUMBERS, "wavenumber", "growth")),
    }


def family_object(found: FamilyMap, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow neutral --json`` prints; in SI units where ``scales`` are given."""
    rate = contract.factor("growth", found.flows[0].chute, scales)
    return {
        "chute": contract.chute_object(found.flows[0].chute),
        "angle": found.angle,
        "kh": found.depth_wavenumber.tolist(),
        "flows": contract.places_object(found.flows, scales),
        "growth": _finite(rate * found.growth),
        "frequency": _finite(rate * found.frequency),
        "threshold": (rate * found.smallest_rate).tolist(),
        "growing": int(found.grows.sum()),
        "unresolved": [
            {"kh": float(found.depth_wavenumber[i]), **contract.place_object(found.flows[j], scales)}
            for i, j in np.argwhere(found.unresolved).tolist()
        ],
        "neutral": [
            {
                "kh": curve.z[:, 0].tolist(),
                **contract.places_object(flows, scales),
                **_of_curve(curve, rate, 1.0),
            }
            for curve, flows in zip(found.neutral, found.neutral_flows, strict=True)
        ],
        **contract.units_object(scales, (*contract.PLACE, "growth")),
    }


def wave_rows(found: WaveMap, scales: Scales | None = None) -> Iterator[list[str]]:
    """The map as rows of CSV; an empty cell where growth is not known."""
    wave, rate = (contract.factor(name, found.flow.chute, scales) for name in ("wavenumber", "growth"))
    yield ["kx", "ky", "growth", "frequency"]
    for i, along in enumerate((wave * found.kx).tolist()):
        for j, across in enumerate((wave * found.ky).tolist()):
            cells = (along, across, rate * float(found.growth[i, j]), rate * float(found.frequency[i, j]))
            yield ["" if np.isnan(cell) else repr(cell) for cell in cells]


def family_rows(found: FamilyMap, scales: Scales | None = None) -> Iterator[list[str]]:
    """The map as rows of CSV; an empty cell where growth is not known."""
    rate = contract.factor("growth", found.flows[0].chute, scales)
    yield ["kh", *(NUMBERS[name].symbol for name in contract.PLACE), "growth", "frequency"]
    for j, flow in enumerate(found.flows):
        of_flow = [*contract.place_object(flow, scales).values()]
        for i, kh in enumerate(found.depth_wavenumber.tolist()):
            cells = (kh, *of_flow, rate * float(found.growth[i, j]), rate * float(found.frequency[i, j]))
            yield ["" if np.isnan(cell) else repr(cell) for cell in cells]


def _of_curve(curve: NeutralCurve, rate: float, error: float) -> dict[str, Any]:
    """What a curve has along it, by the scales of its frequency and of its error."""
    return {
        "frequency": (rate * curve.frequency).tolist(),
        "error": (error * curve.error).tolist(),
        "ends": list(curve.ends),
    }


def _finite(values: Any) -> list[list[float | None]]:
    return [[contract.finite(value) for value in row] for row in values]
