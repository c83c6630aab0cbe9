"""Fitted metrics as JSON files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os import PathLike

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.fitting.metric_fit import Interval, MetricFit
from geodesic_ocp.fitting.parameter import Parameter, with_parameters
from geodesic_ocp.manifold.metrics.adjustable_kinetic_energy import AdjustableKineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import read_record, write_file

_FORMAT, _VERSION = "geodesic_ocp metric", 1


def save_metric(
    path: str | PathLike[str], fit: MetricFit, intervals: Sequence[Interval] = ()
) -> None:
    """Write the estimates, and their intervals if given, to a JSON file for `load_metric`.

    Raises:
        OSError: the file cannot be written.
    """
    bounds = {each.name: [each.low, each.high, each.confidence] for each in intervals}
    entries = []
    for parameter, estimate in zip(fit.parameters, fit.estimates, strict=True):
        entries.append(
            {
                "name": parameter.name,
                "field": parameter.field,
                "joints": list(parameter.joints),
                "value": estimate.value,
                "unit": estimate.unit,
                "standard_error": _finite(estimate.standard_error),
                "interval": [_finite(number) for number in bounds.get(parameter.name, [])],
            }
        )
    record = {
        "format": _FORMAT,
        "version": _VERSION,
        "metric": getattr(fit.family, "__name__", type(fit.family).__name__),
        "parameters": entries,
        "undetermined": list(fit.undetermined),
        "recordings": [each.name for each in fit.recordings],
        "rms_errors": fit.errors.tolist(),
    }
    write_file(path, json.dumps(record, indent=1) + "\n")


def _finite(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


def load_metric(path: str | PathLike[str], model: Model) -> AdjustableKineticEnergy:
    """The metric of a model with the parameters in a JSON file (`save_metric`).

    Raises:
        RecordingError: the file is missing or not of this format, its metric is a user's own class,
            or a parameter does not fit the model.
    """
    record = read_record(path, _FORMAT, _VERSION, "a fitted metric")
    if record.get("metric") != AdjustableKineticEnergy.__name__:
        raise RecordingError(
            f"{path}: holds parameters of {record.get('metric')}; only those of "
            f"{AdjustableKineticEnergy.__name__} can be applied to a model from the file alone"
        )
    try:
        values = [float(entry["value"]) for entry in record["parameters"]]
        parameters = [
            Parameter(
                str(entry["field"]),
                value or 1.0,
                joints=tuple(entry["joints"]),
                name=str(entry["name"]),
            )
            for entry, value in zip(record["parameters"], values, strict=True)
        ]
        metric = with_parameters(AdjustableKineticEnergy(model), parameters, values)
    except (KeyError, TypeError, ValueError) as failure:
        reason = f"{failure} is missing" if isinstance(failure, KeyError) else str(failure)
        raise RecordingError(f"{path}: {reason}") from None
    assert isinstance(metric, AdjustableKineticEnergy)
    return metric
