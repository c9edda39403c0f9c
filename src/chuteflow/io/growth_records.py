"""Growth rates and neutral curves as JSON objects and as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chuteflow.io import contract
from chuteflow.io.datasets import dataset
from chuteflow.steady.quantities import NUMBERS, PLACE, Scales

if TYPE_CHECKING:
    from chuteflow.stability.neutral import NeutralCurve
    from chuteflow.stability.planes import FamilyMap, WaveMap


def wave_object(found: WaveMap, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow growth --json`` prints; in SI units where ``scales`` are given."""
    chute, table = found.flow.chute, dataset(found, scales)
    wave, rate = (contract.factor(name, chute, scales) for name in ("wavenumber", "growth"))
    return {
        "chute": contract.chute_object(chute),
        "flow": contract.flow_object(found.flow, scales),
        **{name: table.lists(name) for name in ("kx", "ky", "growth", "frequency")},
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
    rate, table = contract.factor("growth", found.flows[0].chute, scales), dataset(found, scales)
    return {
        "chute": contract.chute_object(found.flows[0].chute),
        "angle": found.angle,
        "kh": found.depth_wavenumber.tolist(),
        "flows": contract.places_object(found.flows, scales),
        **{name: table.lists(name) for name in ("growth", "frequency")},
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
        **contract.units_object(scales, (*PLACE, "growth")),
    }


def wave_rows(found: WaveMap, scales: Scales | None = None) -> Iterator[Sequence[Any]]:
    """The map as rows of a table."""
    return dataset(found, scales).rows({name: name for name in ("kx", "ky", "growth", "frequency")})


def family_rows(found: FamilyMap, scales: Scales | None = None) -> Iterator[Sequence[Any]]:
    """The map as rows of a table, flow after flow."""
    names = {NUMBERS[name].symbol: name for name in PLACE}
    headings = {"kh": "depth_wavenumber", **names, "growth": "growth", "frequency": "frequency"}
    return dataset(found, scales).rows(headings, order=("flow", "depth_wavenumber"))


def _of_curve(curve: NeutralCurve, rate: float, error: float) -> dict[str, Any]:
    """What a curve has along it, by the scales of its frequency and of its error."""
    return {
        "frequency": (rate * curve.frequency).tolist(),
        "error": (error * curve.error).tolist(),
        "ends": list(curve.ends),
    }
