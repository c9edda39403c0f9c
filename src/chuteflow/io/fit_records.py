"""Fits and predictions as JSON objects, and fits in files from which predictions are made."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from chuteflow.errors import InputError
from chuteflow.fitting.calibration import Calibration
from chuteflow.io import contract, records
from chuteflow.io.dataset import Dataset, variable
from chuteflow.io.reading import loading
from chuteflow.io.records import FORMAT
from chuteflow.io.writing import require_suffix, write_file
from chuteflow.parameters import BY_KEY, CONDITIONS
from chuteflow.steady.free import free_parameter
from chuteflow.steady.quantities import FIELDS, NUMBERS, SCALED, Scales

if TYPE_CHECKING:
    from chuteflow.fitting.calibration import Fit, Fitted
    from chuteflow.fitting.design import Design
    from chuteflow.fitting.direct import DirectMeasurement
    from chuteflow.fitting.prediction import Prediction

#: Endings of the files, the name of their kind, and bytes in one at most.
SAVED = (".nc", ".json")
KIND = "fit"
_LARGEST = 100_000_000


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
        "direct": [_direct(one) for one in found.direct],
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


def prediction_object(found: Prediction, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow predict --json`` prints: values with standard errors, null where one is infinite; in SI units
    where there are scales."""

    def by(name: str) -> float:
        return contract.factor(name, found.calibration.chute, scales)

    return {
        **contract.units_object(scales, SCALED),
        "chute": contract.chute_object(found.calibration.chute),
        "parameters": list(found.calibration.keys),
        "confidence": found.confidence,
        "reason": found.flow_set.reason,
        "flows": [
            {
                "flow": contract.flow_object(one.flow, scales),
                "errors": {NUMBERS[n].symbol: contract.finite(by(n) * error) for n, (_, error) in one.numbers.items()},
                "profiles": {
                    "z": (by("height") * one.height).tolist(),
                    **{
                        name: {"value": _numbers(by(name) * pair[0]), "error": _numbers(by(name) * pair[1])}
                        for name, pair in one.profiles.items()
                    },
                },
            }
            for one in found.flows
        ],
        "curve": [
            {
                "Q": (by("mass_flux") * np.exp(band.points[:, 0])).tolist(),
                "h": (by("centre_of_mass") * np.exp(band.points[:, 1])).tolist(),
                "normal": band.normals.tolist(),
                "error": _numbers(band.errors),
            }
            for band in found.bands
        ],
        "folds": [
            {
                "kind": one.kind,
                "value": by(CONDITIONS[one.turns].quantity) * one.value,
                "relative_error": contract.finite(one.error),
            }
            for one in found.folds
        ],
        "warnings": found.warnings,
    }


def design_object(found: Design, scales: Scales | None = None) -> dict[str, Any]:
    """What ``chuteflow design --json`` prints; flows in SI units where there are scales, what is wanted without."""
    return {
        **contract.units_object(scales, NUMBERS),
        "wanted": dict(found.wanted),
        "solutions": [
            {
                "values": dict(zip((p.key for p in found.unknown), one.values.tolist(), strict=True)),
                "chute": contract.chute_object(one.flow.chute),
                "flow": contract.flow_object(one.flow, scales),
            }
            for one in found.solutions
        ],
        "starts": found.starts,
        "reason": found.reason,
    }


def design_rows(found: Design, scales: Scales | None = None) -> Iterator[list[Any]]:
    """The chutes and their flows as rows of a table."""
    units = {name: "" if scales is None else f" [{one.unit}]" for name, one in NUMBERS.items()}
    yield [*BY_KEY, *(f"{one.symbol}{units[name]}" for name, one in NUMBERS.items())]
    for one in found.solutions:
        chute = one.flow.chute
        numbers = [getattr(one.flow, name) * contract.factor(name, chute, scales) for name in NUMBERS]
        yield [*(getattr(chute, parameter.name) for parameter in BY_KEY.values()), *numbers]


def prediction_rows(found: Prediction, scales: Scales | None = None) -> Iterator[list[Any]]:
    """The profiles with their errors as rows of a table, in SI units where there are scales."""
    names = [name for name in FIELDS if name != "height"]
    by = {name: contract.factor(name, found.calibration.chute, scales) for name in FIELDS}
    units = {name: "" if scales is None else f" [{one.unit}]" for name, one in FIELDS.items()}
    cells = [f"{FIELDS[name].symbol}{what}{units[name]}" for name in names for what in ("", "_error")]
    yield ["flow", f"z{units['height']}", *cells]
    for i, one in enumerate(found.flows, 1):
        columns = [by[name] * values for name in names for values in one.profiles[name]]
        yield from ([i, *row] for row in np.column_stack([by["height"] * one.height, *columns]).tolist())


def _numbers(values: Any) -> list[float | None]:
    return [contract.finite(value) for value in values]


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


def _direct(one: DirectMeasurement) -> dict[str, Any]:
    parts = {"g1": one.g1, "g2": one.g2, "slip_ratio": one.slip}
    return {
        "name": one.name,
        "z": one.height.tolist(),
        "nu": one.nu.tolist(),
        **{
            name: None
            if part is None
            else {"value": _numbers(part.value), "error": _numbers(part.error), "law": _numbers(part.law)}
            for name, part in parts.items()
        },
    }


def _rows(matrix: Any) -> list[list[float | None]]:
    return [[contract.finite(value) for value in row] for row in matrix]


def save_fit(found: Fit, path: str | os.PathLike[str]) -> None:
    """Write a fit to ``path``: .nc (NetCDF 4) with its estimates and residuals, or .json; predictions are made from
    either.

    Raises:
        InputError: for another ending, or a file that cannot be written.
    """

    def write_json(stream: BinaryIO) -> None:
        stream.write(_kept(found) + b"\n")

    def write_netcdf(stream: BinaryIO) -> None:
        from chuteflow.io.netcdf_file import write_groups

        write_groups(stream, _dataset(found))

    write_file(path, {".nc": write_netcdf, ".json": write_json})


def _kept(found: Fit) -> bytes:
    return contract.text({"format": FORMAT, "kind": KIND, "fit": fit_object(found)}).encode()


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """What predictions are made from, of the fit that :func:`save_fit` wrote to ``path``.

    Raises:
        InputError: for a file that is missing, damaged, of another kind or of a later version.
    """
    suffix = require_suffix(path, SAVED)
    with loading(path, "holds no fit of chuteflow"):
        content = Path(path).read_bytes() if suffix == ".json" else _content(Path(path))
        kept = contract.parsed(content)
        records.require_format(kept)
        if kept["kind"] != KIND:
            raise InputError("it holds no fit")
        return _calibration(kept["fit"])


def _calibration(kept: Mapping[str, Any]) -> Calibration:
    chute = records.chute_from(kept)
    keys = tuple(free_parameter(chute, key).key for key in kept["estimates"]) if chute.law.known else ()
    covariance = np.array([records.numbers("the covariance", row) for row in kept["covariance"]])
    if covariance.shape != (len(kept["estimates"]), len(kept["estimates"])):
        raise InputError("its covariance does not fit its parameters")
    left = tuple(key for key, one in kept["estimates"].items() if not one["determined"])
    return Calibration(chute, keys, covariance.reshape(len(keys), len(keys)), left)


def _content(path: Path) -> bytes:
    import h5py

    with h5py.File(path, "r") as file:
        stored: Any = file["fit"]
        if stored.size > _LARGEST:
            raise InputError(f"it claims {stored.size} bytes")
        return bytes(stored[...].tobytes())


def _dataset(found: Fit) -> Dataset:
    """The estimates, the residuals and, as bytes, all that predictions are made from."""
    from chuteflow import __version__

    names = " ".join(p.key for p in found.free)
    attributes = {
        "Conventions": "CF-1.11",
        "title": "Parameters of a chute from measurements",
        "source": f"chuteflow {__version__}",
        "parameters": names,
        "chi2": found.chi2,
        "values": found.count,
        "unknowns": found.unknowns,
        **found.chute.as_dict(),
    }
    ends = np.array([[one.interval.low, one.interval.high] for one in found.estimates], dtype=float)
    intervals = ends.reshape(len(found.free), 2)
    variables = {
        "estimate": variable(("parameter",), found.values.astype(float), f"estimates of {names}"),
        "interval": variable(("parameter", "end"), intervals, f"intervals of confidence {found.confidence:g}"),
        "covariance": variable(("parameter", "parameter_2"), found.covariance, "covariance of the estimates"),
    }
    for i, one in enumerate(found.experiments, 1):
        for series, residual in one.profiles:
            name, where = f"experiment_{i}_{series.symbol}", f"{series.symbol} in experiment {one.name}"
            for part, values, said in (
                ("height", series.height, f"heights of {where}"),
                ("value", series.value, f"measured {where}"),
                ("residual", residual, "computed minus measured, in standard errors"),
            ):
                variables[f"{name}_{part}"] = variable((name,), values, said)
    content = np.frombuffer(_kept(found), dtype="u1")
    return Dataset({**variables, "fit": variable(("byte",), content, "everything, as a JSON text")}, attributes)
