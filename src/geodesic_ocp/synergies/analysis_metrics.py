"""The metrics of an analysis: the one that cuts and plans, and those that it is compared with."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.joint_inertia import has_default_joint_inertia
from geodesic_ocp.synergies.usual_metrics import (
    JOINT_INERTIA,
    KINETIC_ENERGY,
    STRAIGHT_LINES,
    USUAL_METRICS,
)

MetricName = Literal["joint-inertia", "kinetic", "euclidean"]
METRIC_NAMES: tuple[str, ...] = get_args(MetricName)
_USUAL = dict(zip(METRIC_NAMES, (JOINT_INERTIA, KINETIC_ENERGY, STRAIGHT_LINES), strict=True))


def as_analysis_metric(metric: Metric | str | None, model: Model) -> Metric:
    """The metric of an analysis, from its name or None, which is "joint-inertia".

    Raises:
        ValueError: an unknown name, no metric, or one of another dimension or of other joints.
    """
    if not isinstance(metric, Metric):
        name = METRIC_NAMES[0] if metric is None else metric
        if isinstance(name, str) and name in _USUAL:
            return USUAL_METRICS[_USUAL[name]](model)
        known = ", ".join(map(repr, METRIC_NAMES))
        raise ValueError(f"metric must be {known} or a Metric, got {metric!r}")
    if metric.dim != model.dof or (metric.joint_names or model.joint_names) != model.joint_names:
        joints = f" of the joints {', '.join(metric.joint_names)}" if metric.joint_names else ""
        raise ValueError(
            f"metric has dimension {metric.dim}{joints}, but {model.name!r} has {model.dof} "
            f"joints, {', '.join(model.joint_names)}"
        )
    return metric


def compared_metrics(metric: Metric, model: Model) -> dict[str, Metric]:
    """The metrics whose geodesics on the same segments are shown beside those of `metric`.

    By method: "kinetic_energy", without joint inertia; "joint_inertia", with the model's or the
    default one; "euclidean_same_segments". The metric itself is left out.
    """
    compared = {"kinetic_energy": USUAL_METRICS[KINETIC_ENERGY](model)}
    if np.any(model.armature) or has_default_joint_inertia(model):
        compared["joint_inertia"] = USUAL_METRICS[JOINT_INERTIA](model)
    compared["euclidean_same_segments"] = USUAL_METRICS[STRAIGHT_LINES](model)
    compared.pop(method_of(metric), None)
    return compared


def method_of(metric: Metric) -> str:
    """The method of `compared_metrics` that has a metric of this kind; "" for other metrics."""
    if isinstance(metric, Euclidean):
        return "euclidean_same_segments"
    if type(metric) is KineticEnergy:
        return "joint_inertia" if np.any(metric.model.armature) else "kinetic_energy"
    return ""


def joint_inertia_of(metric: Metric) -> str:
    """The joint inertia of a kinetic energy in words, such as "0.044 kg m^2"; empty without any."""
    if method_of(metric) != "joint_inertia":
        return ""
    assert isinstance(metric, KineticEnergy)
    values = {}
    for unit, per_unit in (("rad", "kg m^2"), ("m", "kg")):
        chosen = [
            value
            for value, each in zip(metric.model.armature, metric.model.units, strict=True)
            if each == unit
        ]
        if chosen:
            low, high = min(chosen), max(chosen)
            shown = f"{low:.3g}" if np.isclose(low, high) else f"{low:.3g} to {high:.3g}"
            values[per_unit] = f"{shown} {per_unit}"
    return ", ".join(values.values())
