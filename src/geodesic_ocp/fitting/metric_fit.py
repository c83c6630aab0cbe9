"""Metrics that were fitted to recordings, and their files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.fitting.metric_program import LeastErrors, MetricProgram
from geodesic_ocp.fitting.parameter import Parameter, with_parameters
from geodesic_ocp.fitting.recording_part import DEVIATION
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import AdjustableKineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, decoding, read_record, write_record
from geodesic_ocp.synergies.segment_costs import Curve
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame

FORMAT = "geodesic_ocp metric"
_VERSION = 1


@dataclass(frozen=True)
class Estimate:
    """An estimated parameter.

    Attributes:
        name: name of the parameter.
        value: in `unit`.
        standard_error: from the Hessian of the errors; NaN at a bound, inf where the data do not
            determine the parameter.
        unit: "kg m^2", "kg", "m r^2" (the arm's moving mass times its squared reach), or empty.
        at_bound: whether a bound is active.
    """

    name: str
    value: float
    standard_error: float
    unit: str = ""
    at_bound: bool = False

    def __repr__(self) -> str:
        bound = ", at its bound" if self.at_bound else f" +- {self.standard_error:.2g}"
        return f"{self.name} = {self.value:.4g}{bound} {self.unit}".rstrip()


@dataclass(frozen=True, repr=False)
class ConfidenceInterval(ShortRepr):
    """A confidence interval of a parameter.

    Attributes:
        name: name of the parameter.
        low, high: ends, in the parameter's unit; 0 or inf where resampled estimates leave the range
            of values that were tried; NaN for one of several parameters that is at its bound.
        confidence: such as 0.95.
        unit: unit that was resampled, "recording" or "subject".
        count: number of units.
    """

    name: str
    low: float
    high: float
    confidence: float
    unit: str
    count: int


@dataclass(frozen=True, eq=False, repr=False)
class MetricFit:
    """Parameters of a metric estimated from recordings.

    Attributes:
        estimates: estimates with standard errors from the Hessian.
        parameters: as given.
        undetermined: sentences on parameters, or combinations, that the data do not determine.
        program: the nonlinear program.
        outcome: its solution.
        derivatives: derivatives of the recordings' least errors at the solution.
        family: gives the metric of a model, with the parameters as fields.
    """

    estimates: tuple[Estimate, ...]
    parameters: tuple[Parameter, ...]
    undetermined: tuple[str, ...]
    program: MetricProgram
    outcome: Outcome
    derivatives: LeastErrors
    family: Callable[[Model], Metric]

    def __repr__(self) -> str:
        count = len(self.recordings)
        error = float(np.sqrt(np.mean(self.errors**2)))
        number = f"{count} recording{'s'[: count - 1]}"
        lines = [
            f"MetricFit({', '.join(map(repr, self.estimates))}",
            f"{self.curve}s, {number}, rms error {error:.4g} {self.error_unit})",
        ]
        lines += [f"not determined: {len(self.undetermined)}"] if self.undetermined else []
        return "\n  ".join(lines)

    @property
    def curve(self) -> Curve:
        """What predicts a segment, "geodesic" or "cubic"."""
        return "geodesic" if self.program.parts[0].terms.is_geodesic else "cubic"

    @property
    def error_unit(self) -> str:
        """Unit of the errors, "rad" or "m"."""
        return "rad" if self.program.parts[0].terms.measure == "joint" else "m"

    def _repr_markdown_(self) -> str:
        notes = "".join(f"\n- {sentence}" for sentence in self.undetermined)
        return markdown(self.table()) + notes

    @property
    def values(self) -> dict[str, float]:
        """Estimates by name."""
        return {each.name: each.value for each in self.estimates}

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, in the order of `errors`."""
        return tuple(part.recording for part in self.program.parts)

    @property
    def errors(self) -> Array:
        """Root mean square error of each recording, of a joint [rad] or of the hand [m]."""
        return self.root_mean_squares(2.0 * self.derivatives.values)

    def root_mean_squares(self, squares: Array) -> Array:
        """Return root mean square errors from the program's mean squares."""
        entries = self.program.parts[0].terms.dim if self.error_unit == "rad" else 1
        return np.asarray(DEVIATION * np.sqrt(squares / entries))

    def metric(self, model: Model) -> Metric:
        """Return the metric of a model with the estimated parameters."""
        return with_parameters(self.family(model), self.parameters, list(self.values.values()))

    def table(self, intervals: tuple[ConfidenceInterval, ...] = ()) -> DataFrame:
        """Return estimates, standard errors, and bootstrap intervals if given (`bootstrap_fit`)."""
        header: tuple[str, ...] = ("parameter", "unit", "estimate", "standard error")
        rows: list[tuple[str | int | float, ...]] = []
        for each in self.estimates:
            error = "at its bound" if each.at_bound else each.standard_error
            rows.append((each.name, each.unit, each.value, error))
        if intervals:
            header += (f"{100 * intervals[0].confidence:g} % from", "to")
            for row, own in enumerate(intervals):
                rows[row] += (own.low, own.high)
        found = {each.name: each.motion.caveat for each in self.recordings}
        notes = [f"{name}: {caveat}" for name, caveat in found.items() if caveat]
        return new_table(header, rows, " ".join(notes))


def save_metric(
    path: str | PathLike[str], fit: MetricFit, intervals: Sequence[ConfidenceInterval] = ()
) -> None:
    """Write the estimates, and their intervals if given, to a JSON file for `load_metric`.

    Fields of an `AdjustableKineticEnergy` that were not estimated, such as the armature of the
    models, are part of it.

    >>> import tempfile
    >>> from pathlib import Path
    >>> recording = go.trajectory.bundled_recording()
    >>> fit = go.fitting.fit_metric(recording)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     go.fitting.save_metric(f"{folder}/metric.json", fit)
    ...     "joint_inertia" in Path(f"{folder}/metric.json").read_text()
    True

    Args:
        path: of the file.
        fit: fit whose estimates are written.
        intervals: of its parameters, as from `bootstrap_fit`.

    Raises:
        ValueError: such fields differ between the recordings.
        OSError: the file cannot be written.
    """
    if not isinstance(fit, MetricFit):
        raise ValueError(f"save_metric takes a path and a fit, got {path!r} and {fit!r}")
    bounds = {each.name: [each.low, each.high, each.confidence] for each in intervals}
    entries = [
        {
            "name": parameter.name,
            "field": parameter.field,
            "joints": list(parameter.joints),
            "value": estimate.value,
            "unit": estimate.unit,
            "standard_error": _finite(estimate.standard_error),
            "interval": [_finite(number) for number in bounds.get(parameter.name, [])],
        }
        for parameter, estimate in zip(fit.parameters, fit.estimates, strict=True)
    ]
    record = {
        "format": FORMAT,
        "version": _VERSION,
        "curve": fit.curve,
        "metric": type(fit.metric(fit.recordings[0].model)).__name__,
        "parameters": entries,
        "fixed": _fixed_fields(fit),
        "undetermined": list(fit.undetermined),
        "recordings": [each.name for each in fit.recordings],
        "rms_errors": fit.errors.tolist(),
    }
    write_record(path, record)


def _fixed_fields(fit: MetricFit) -> dict[str, Any]:
    """Return fields of the metric that are not estimated, where they are not the defaults."""
    estimated = {each.field for each in fit.parameters}
    found: list[dict[str, Any]] = []
    for recording in fit.recordings:
        metric = fit.metric(recording.model)
        if not isinstance(metric, AdjustableKineticEnergy):
            return {}
        usual = vars(AdjustableKineticEnergy(recording.model.with_armature(0.0)))
        names = (each.name for each in fields(metric) if each.name not in {"model"} | estimated)
        own = {name: getattr(metric, name) for name in names}
        found.append({name: value for name, value in own.items() if value != usual[name]})
        if found[-1] != found[0]:
            raise ValueError(
                f"{recording.name}: its metric differs from that of {fit.recordings[0].name} in "
                f"what was not estimated ({found[-1]} and {found[0]}); one file cannot hold both"
            )
    return found[0]


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
    """Return the metric of a model with the parameters in a JSON file (`save_metric`).

    >>> import tempfile
    >>> recording = go.trajectory.bundled_recording()
    >>> fit = go.fitting.fit_metric(recording)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     go.fitting.save_metric(f"{folder}/metric.json", fit)
    ...     metric = go.fitting.load_metric(f"{folder}/metric.json", recording.model)
    >>> round(go.distance(metric, recording.motion.q[0], recording.motion.q[75]), 4)
    0.1974

    Args:
        path: the JSON file.
        model: model whose metric it becomes.

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
