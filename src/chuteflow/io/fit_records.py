"""Fits as JSON objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from chuteflow.io import contract

if TYPE_CHECKING:
    from chuteflow.fitting.calibration import Fit, Fitted


def fit_object(found: Fit) -> dict[str, Any]:
    """What ``chuteflow fit --json`` prints of one law."""
    return {
        "chute": contract.chute_object(found.chute),
        "closure": contract.closure_object(found.chute),
        "estimates": {
            one.key: {
                "value": one.value,
                "error": contract.finite(one.error),
                "interval": [one.interval.low, one.interval.high],
                "ends": list(one.interval.ends),
                "determined": one.determined,
            }
            for one in found.estimates
        },
        "covariance": _rows(found.covariance),
        "correlation": _rows(found.correlation),
        "chi2": found.chi2,
        "values": found.count,
        "unknowns": found.unknowns,
        "freedom": found.freedom,
        "probability": found.probability,
        "aicc": contract.finite(found.aicc),
        "errors_known": found.measured.errors_known,
        "error_scale": found.error_scale,
        "loss": found.loss,
        "confidence": found.confidence,
        "converged": found.converged,
        "warnings": found.warnings,
        "experiments": [_experiment(one) for one in found.experiments],
        "alternatives": [
            {
                "values": dict(zip((p.key for p in found.free), one.values.tolist(), strict=True)),
                "chi2": one.chi2,
                "fits_as_well": one.fits_as_well,
                "same_flow": one.same_flow,
                "flows": [contract.flow_object(flow) for flow in one.flows],
            }
            for one in found.alternatives
        ],
    }


def comparison_object(found: Sequence[Fit], reasons: Sequence[str]) -> dict[str, Any]:
    """What ``chuteflow fit --json`` prints: fits of one or several laws, the best first; ``reasons`` why there is none
    for others."""
    return {"fits": [fit_object(one) for one in found], "failed": list(reasons)}


def _experiment(one: Fitted) -> dict[str, Any]:
    return {
        "name": one.name,
        "chute": contract.chute_object(one.flow.chute),
        "flow": contract.flow_object(one.flow),
        "rank": one.rank,
        "flows": one.flows,
        "base": one.base,
        "base_error": one.base_error,
        "residuals": {
            series.symbol: {"z": series.height.tolist(), "residual": residual.tolist()}
            for series, residual in one.profiles
        },
        "scalar_residuals": one.residuals[sum(len(r) for _, r in one.profiles) :].tolist(),
    }


def _rows(matrix: Any) -> list[list[float | None]]:
    return [[contract.finite(value) for value in row] for row in matrix]
