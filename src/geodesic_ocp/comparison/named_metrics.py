"""The metrics of a comparison, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.metrics import as_analysis_metric
from geodesic_ocp.model.model import Model

# A metric, or a function of a model that returns one.
MetricOrFunction = Metric | Callable[[Model], Metric]


def as_named_metrics(metrics: Mapping[str, MetricOrFunction]) -> dict[str, MetricOrFunction]:
    """The metrics by name, checked.

    Raises:
        ValueError: there is none, they have no names, or one is neither a metric nor a function.
    """
    if not isinstance(metrics, Mapping):
        raise ValueError(
            "metrics must have names, as in {'kinetic energy': go.KineticEnergy(model)}, got "
            f"{metrics!r}"
        )
    if not metrics:
        raise ValueError("metrics must be at least one, got none")
    for name, given in metrics.items():
        if not isinstance(given, Metric) and not callable(given):
            raise ValueError(
                f"metrics: {name!r} must be a metric, or a function of a model that returns one, "
                f"got {given!r}"
            )
    return dict(metrics)


def metric_of(name: str, given: MetricOrFunction, model: Model) -> Metric:
    """The metric of a model.

    Raises:
        ValueError: a function has not returned a metric, or it is of other joints.
    """
    try:
        metric = as_metric(given if isinstance(given, Metric) else given(model))
        return as_analysis_metric(metric, model)
    except ValueError as error:
        raise ValueError(f"metrics: {name!r}: {error}") from None
