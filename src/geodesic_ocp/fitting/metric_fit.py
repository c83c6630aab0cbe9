"""MetricFit: estimated parameters of a metric, and how certain they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.fitting.parameter import Parameter, with_parameters
from geodesic_ocp.fitting.program.curvature import LeastErrors
from geodesic_ocp.fitting.program.metric_program import MetricProgram
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.table import Table


@dataclass(frozen=True)
class Estimate:
    """An estimated parameter.

    Attributes:
        name: of the parameter.
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


@dataclass(frozen=True)
class ConfidenceInterval:
    """A confidence interval of a parameter.

    Attributes:
        name: of the parameter.
        low, high: ends, in the parameter's unit; 0 or inf where resampled estimates leave the range
            of values that were tried; NaN for one of several parameters that is at its bound.
        confidence: such as 0.95.
        unit: that was resampled, "recording" or "subject".
        count: number of units.
    """

    name: str
    low: float
    high: float
    confidence: float
    unit: str
    count: int

    def __repr__(self) -> str:
        return (
            f"{self.name}: {self.low:.4g} to {self.high:.4g} ({100 * self.confidence:g} %, "
            f"bootstrap over {self.count} {self.unit}s)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class MetricFit:
    """Parameters of a metric estimated from recordings.

    Attributes:
        estimates: with standard errors from the Hessian.
        parameters: as given.
        undetermined: sentences on parameters, or combinations, that the data do not determine.
        program: the nonlinear program.
        outcome: its solution.
        derivatives: of the recordings' least errors at the solution.
        family: gives the metric of a model, with the parameters as fields.
    """

    estimates: tuple[Estimate, ...]
    parameters: tuple[Parameter, ...]
    undetermined: tuple[str, ...]
    program: MetricProgram = field(repr=False)
    outcome: Outcome = field(repr=False)
    derivatives: LeastErrors = field(repr=False)
    family: Callable[[Model], Metric] = field(repr=False)

    def __repr__(self) -> str:
        lines = ["MetricFit(" + ", ".join(map(repr, self.estimates))]
        count = len(self.recordings)
        lines.append(f"{count} recording{'s'[: count - 1]}, rms error {self._rms_shown()})")
        lines += [f"not determined: {len(self.undetermined)}"] if self.undetermined else []
        return "\n  ".join(lines)

    def _rms_shown(self) -> str:
        return f"{float(np.sqrt(np.mean(self.errors**2))):.4g} {self.error_unit}"

    @property
    def error_unit(self) -> str:
        """Unit of the errors, "rad" or "m"."""
        return "rad" if self.program.parts[0].functions.measure == "joint" else "m"

    def _repr_markdown_(self) -> str:
        notes = "".join(f"\n- {sentence}" for sentence in self.undetermined)
        return self.table().markdown() + notes

    @property
    def values(self) -> dict[str, float]:
        """Estimates by name."""
        return {each.name: each.value for each in self.estimates}

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The recordings, in the order of `errors`."""
        return tuple(part.observed.recording for part in self.program.parts)

    @property
    def errors(self) -> Array:
        """Root mean square error of each recording, of a joint [rad] or of the hand [m]."""
        return self.root_mean_squares(2.0 * self.derivatives.values)

    def root_mean_squares(self, squares: Array) -> Array:
        """Root mean square errors from the program's mean squares."""
        part = self.program.parts[0]
        entries = part.functions.dim if part.functions.measure == "joint" else 1
        return np.asarray(part.deviation * np.sqrt(squares / entries))

    def metric(self, model: Model) -> Metric:
        """The metric of a model with the estimated parameters."""
        return with_parameters(self.family(model), self.parameters, list(self.values.values()))

    def table(self, intervals: tuple[ConfidenceInterval, ...] = ()) -> Table:
        """Estimates, standard errors, and bootstrap intervals if given (`bootstrap_fit`)."""
        header = ["parameter", "unit", "estimate", "standard error"]
        if intervals:
            header += [f"{100 * intervals[0].confidence:g} % from", "to"]
        rows = []
        for index, each in enumerate(self.estimates):
            error: str | float = "at its bound" if each.at_bound else each.standard_error
            row: list[str | int | float] = [each.name, each.unit, each.value, error]
            if intervals:
                own = intervals[index]
                row += ["-", "-"] if np.isnan(own.low) else [own.low, own.high]
            rows.append(tuple(row))
        return Table(tuple(header), tuple(rows))
