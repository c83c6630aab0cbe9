"""The metrics that synergies are compared under."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.inertias import inertia_scale
from geodesic_ocp.model.model import Model

JOINT_INERTIA = "kinetic energy with joint inertia"
KINETIC_ENERGY = "kinetic energy"
STRAIGHT_LINES = "straight lines"
MetricName = Literal["joint-inertia", "kinetic", "euclidean"]
METRIC_NAMES: tuple[str, ...] = get_args(MetricName)
_USUAL = dict(zip(METRIC_NAMES, (JOINT_INERTIA, KINETIC_ENERGY, STRAIGHT_LINES), strict=True))
# Of m r^2: what `fit_metric` estimates from recordings of the KIT database and the bundled one,
# with 0.02 to 0.04 as its 95 % interval.
FRACTION = 0.03
# Functions of a model: the kinetic energy with the model's or the default joint inertia, that of
# the links alone, and the Euclidean metric, whose geodesics are straight lines in joint space.
USUAL_METRICS: Mapping[str, Callable[[Model], Metric]] = {
    JOINT_INERTIA: lambda model: KineticEnergy(with_joint_inertia(model)),
    KINETIC_ENERGY: lambda model: KineticEnergy(
        model.with_armature(0.0) if np.any(model.armature) else model
    ),
    STRAIGHT_LINES: lambda model: Euclidean(model.dof),
}


def default_joint_inertia(model: Model) -> Array:
    """Joint inertia (n,) that `analyse` assumes of an arm [kg m^2, kg for prismatic joints].

    a = 0.03 m r^2 for revolute and 0.03 m for prismatic joints, with the moving mass m and the
    reach r of the model. The geodesics of G(q) + diag(a) depend on the ratio of a and G only, so
    that a constant in kg m^2 would make them depend on the body mass that a recording states, which
    is often a placeholder.

    >>> import geodesic_ocp as go
    >>> go.default_joint_inertia(go.human_arm(height=1.75, mass=70.0)).round(3)
    array([0.044, 0.044, 0.044, 0.044, 0.044, 0.044, 0.044])

    Raises:
        ValueError: the reach is infinite, as a prismatic joint has no limits, or zero.
    """
    if not has_default_joint_inertia(model):
        raise ValueError(
            f"{model.name!r}, with a reach of {model.reach:g} m and {model.mass:g} kg, has no "
            "default joint inertia: limit its joints (Model.with_limits), give the joint inertia "
            "(Model.with_armature), or choose another metric"
        )
    return np.asarray(FRACTION * inertia_scale(model))


def has_default_joint_inertia(model: Model) -> bool:
    """Whether mass and reach of the model are positive and finite, as far as its joints need."""
    scale = inertia_scale(model)
    return bool(np.all(np.isfinite(scale) & (scale > 0.0)))


def with_joint_inertia(model: Model) -> Model:
    """The model with its own armature if it has any, otherwise with the default joint inertia."""
    return model if np.any(model.armature) else model.with_armature(default_joint_inertia(model))


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
        chosen = metric.model.armature[[each == unit for each in metric.model.units]]
        if chosen.size:
            low, high = chosen.min(), chosen.max()
            shown = f"{low:.3g}" if np.isclose(low, high) else f"{low:.3g} to {high:.3g}"
            values[per_unit] = f"{shown} {per_unit}"
    return ", ".join(values.values())
