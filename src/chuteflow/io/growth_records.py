"""Growth rates and neutral curves as JSON objects and as rows of CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.io import contract

if TYPE_CHECKING:
    from chuteflow.stability.neutral import NeutralCurve
    from chuteflow.stability.planes import FamilyMap, WaveMap
    from chuteflow.steady.flow import Flow

_ALONG = {"Q": "mass_flux", "h": "centre_of_mass", "M": "mass_holdup", "T_surface": "surface_temperature"}


def wave_object(found: WaveMap) -> dict[str, Any]:
    """What ``chuteflow growth --json`` prints."""
    return {
        "chute": contract.chute_object(found.flow.chute),
        "flow": contract.flow_object(found.flow),
        "kx": found.kx.tolist(),
        "ky": found.ky.tolist(),
        "growth": _finite(found.growth),
        "frequency": _finite(found.frequency),
        "threshold": found.smallest_rate,
        "growing": int(found.grows.sum()),
        "unresolved": [
            {"kx": float(found.kx[i]), "ky": float(found.ky[j])} for i, j in np.argwhere(found.unresolved).tolist()
        ],
        "neutral": [
            {"kx": curve.z[:, 0].tolist(), "ky": curve.z[:, 1].tolist(), **_of_curve(curve)} for curve in found.neutral
        ],
    }


def family_object(found: FamilyMap) -> dict[str, Any]:
    """What ``chuteflow neutral --json`` prints."""
    return {
        "chute": contract.chute_object(found.flows[0].chute),
        "angle": found.angle,
        "kh": found.depth_wavenumber.tolist(),
        "flows": _numbers(found.flows),
        "growth": _finite(found.growth),
        "frequency": _finite(found.frequency),
        "threshold": found.smallest_rate.tolist(),
        "growing": int(found.grows.sum()),
        "unresolved": [
            {"kh": float(found.depth_wavenumber[i]), **_place(found.flows[j])}
            for i, j in np.argwhere(found.unresolved).tolist()
        ],
        "neutral": [
            {"kh": curve.z[:, 0].tolist(), **_numbers(flows), **_of_curve(curve)}
            for curve, flows in zip(found.neutral, found.neutral_flows, strict=True)
        ],
    }


def wave_rows(found: WaveMap) -> Iterator[list[str]]:
    """The map as rows of CSV; an empty cell where growth is not known."""
    yield ["kx", "ky", "growth", "frequency"]
    for i, along in enumerate(found.kx.tolist()):
        for j, across in enumerate(found.ky.tolist()):
            cells = (along, across, float(found.growth[i, j]), float(found.frequency[i, j]))
            yield ["" if np.isnan(cell) else repr(cell) for cell in cells]


def family_rows(found: FamilyMap) -> Iterator[list[str]]:
    """The map as rows of CSV; an empty cell where growth is not known."""
    yield ["kh", *_ALONG, "growth", "frequency"]
    for j, flow in enumerate(found.flows):
        of_flow = [float(getattr(flow, name)) for name in _ALONG.values()]
        for i, kh in enumerate(found.depth_wavenumber.tolist()):
            cells = (kh, *of_flow, float(found.growth[i, j]), float(found.frequency[i, j]))
            yield ["" if np.isnan(cell) else repr(cell) for cell in cells]


def _of_curve(curve: NeutralCurve) -> dict[str, Any]:
    return {"frequency": curve.frequency.tolist(), "error": curve.error.tolist(), "ends": list(curve.ends)}


def _place(flow: Flow) -> dict[str, float]:
    return {symbol: float(getattr(flow, name)) for symbol, name in _ALONG.items()}


def _numbers(flows: Any) -> dict[str, list[float]]:
    return {symbol: [float(getattr(flow, name)) for flow in flows] for symbol, name in _ALONG.items()}


def _finite(values: Any) -> list[list[float | None]]:
    return [[contract.finite(value) for value in row] for row in values]
