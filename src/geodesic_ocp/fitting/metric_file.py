"""Fitted metrics as JSON files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import Any

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval, MetricFit
from geodesic_ocp.fitting.parameter import Parameter, with_parameters
from geodesic_ocp.manifold.adjustable_kinetic_energy import AdjustableKineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, decoding, read_record, write_file

FORMAT, _VERSION = "geodesic_ocp metric", 1


def save_metric(
    path: str | PathLike[str], fit: MetricFit, intervals: Sequence[ConfidenceInterval] = ()
) -> None:
    """Write the estimates, and their intervals if given, to a JSON file for `load_metric`.

    Fields of an `AdjustableKineticEnergy` that were not estimated, such as the armature of the
    models, are part of it.

    Raises:
        ValueError: such fields differ between the recordings.
        OSError: the file cannot be written.
    """
    if not isinstance(fit, MetricFit):
        raise ValueError(f"save_metric takes a path and a fit, got {path!r} and {fit!r}")
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
        "format": FORMAT,
        "version": _VERSION,
        "metric": type(fit.metric(fit.recordings[0].model)).__name__,
        "parameters": entries,
        "fixed": _fixed_fields(fit),
        "undetermined": list(fit.undetermined),
        "recordings": [each.name for each in fit.recordings],
        "rms_errors": fit.errors.tolist(),
    }
    write_file(path, json.dumps(record, indent=1) + "\n")


def _fixed_fields(fit: MetricFit) -> dict[str, Any]:
    """Fields of the metric that are not estimated, where they are not the defaults."""
    estimated = {each.field for each in fit.parameters}
    fixed: dict[str, Any] = {}
    for number, recording in enumerate(fit.recordings):
        metric = fit.metric(recording.model)
        if not isinstance(metric, AdjustableKineticEnergy):
            return {}
        usual = AdjustableKineticEnergy(recording.model.with_armature(0.0))
        own = {
            each.name: getattr(metric, each.name)
            for each in fields(metric)
            if each.name not in ("model", *estimated)
            and getattr(metric, each.name) != getattr(usual, each.name)
        }
        if number and own != fixed:
            raise ValueError(
                f"{recording.name}: its metric differs from that of {fit.recordings[0].name} in "
                f"what was not estimated ({own} and {fixed}); one file cannot hold both"
            )
        fixed = own
    return fixed


def _finite(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


@dataclass
class _ParameterRecord:
    name: str
    field: str
    joints: tuple[str, ...]
    value: float


@dataclass
class _MetricRecord:
    parameters: tuple[_ParameterRecord, ...]
    fixed: dict[str, float | tuple[float, ...]] = field(default_factory=dict)


def load_metric(path: str | PathLike[str], model: Model) -> AdjustableKineticEnergy:
    """The metric of a model with the parameters in a JSON file (`save_metric`).

    Raises:
        RecordingError: the file is missing or not of this format, its metric is a user's own class,
            or a parameter does not fit the model.
    """
    record = read_record(path, FORMAT, _VERSION, "a fitted metric")
    if record.get("metric") != AdjustableKineticEnergy.__name__:
        raise RecordingError(
            f"{path}: holds parameters of {record.get('metric')}; only those of "
            f"{AdjustableKineticEnergy.__name__} can be applied to a model from the file alone"
        )
    saved = convert(record, _MetricRecord, path)
    values = [each.value for each in saved.parameters]
    with decoding(path):
        parameters = [
            Parameter(each.field, each.value or 1.0, joints=each.joints, name=each.name)
            for each in saved.parameters
        ]
        start = AdjustableKineticEnergy(model, **saved.fixed)
        metric = with_parameters(start, parameters, values)
    assert isinstance(metric, AdjustableKineticEnergy)
    return metric
