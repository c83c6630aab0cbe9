"""Analysis: a recorded motion, its geodesic synergies, and the metrics that are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.analysis_figure import INSTANTS, draw_analysis
from geodesic_ocp.figures.arms.arm_strip import StripArm, strip_instants
from geodesic_ocp.figures.arms.best_view import across, best_view
from geodesic_ocp.figures.arms.posture import Postures
from geodesic_ocp.figures.new_figure import new_figure, save_figure
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import AdjustableKineticEnergy, Euclidean, KineticEnergy
from geodesic_ocp.model.inertias import inertia_scale
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.scores import MotionErrors
from geodesic_ocp.synergies.synergy import Synergy, save_synergies
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

JOINT_INERTIA = "kinetic energy with joint inertia"
KINETIC_ENERGY = "kinetic energy"
STRAIGHT_LINES = "straight lines"
MetricName = Literal["joint-inertia", "kinetic", "euclidean"]
METRIC_NAMES: tuple[str, ...] = get_args(MetricName)
# Of m r^2: what `fit_metric` estimates from recordings of the KIT database and the bundled one,
# with 0.02 to 0.04 as its 95 % interval.
FRACTION = 0.03
# Functions of a model, in the order of the names: the kinetic energy with the model's or the
# default joint inertia, that of the links alone, and the Euclidean metric, whose geodesics are
# straight lines in joint space.
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
    metric = METRIC_NAMES[0] if metric is None else metric
    if isinstance(metric, str) and metric in METRIC_NAMES:
        return [*USUAL_METRICS.values()][METRIC_NAMES.index(metric)](model)
    if not isinstance(metric, Metric):
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


_METRICS = {
    "kinetic_energy": KINETIC_ENERGY,
    "joint_inertia": JOINT_INERTIA,
    "euclidean_same_segments": f"{STRAIGHT_LINES}, same segments",
}
_BASELINES = {
    "euclidean": f"{STRAIGHT_LINES}, zero-velocity segments",
    "ik": "inverse kinematics of the hand",
}
NOT_FOUND = "not found"
_UNITS = ("m", "rad")


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """A recorded motion, its geodesic synergies (see `Synergy`), and the baselines.

    Attributes:
        model: the arm, or a model with several hands, such as `human_upper_body`.
        motion: the observed motion, filtered.
        metric: in which the motion was cut and its synergies are geodesics.
        threshold: of the segmentation [rad]; None if the segments were given.
        segments: (start, stop) sample indices of the geodesic segmentation.
        synergies: one for each segment.
        predicted: the motion that the synergies predict.
        segment_counts: number of segments by method, for the methods that have segments.
        predictions: predicted motion by method.
        errors: mean errors by method, against the filtered motion: "riemannian", geodesics of the
            metric; on the same segments "kinetic_energy", geodesics without joint inertia,
            "joint_inertia", with joint inertia, and "euclidean_same_segments", straight lines (the
            like-for-like comparison); "euclidean", straight lines on zero-velocity segments (the
            paper's comparison); "ik", inverse kinematics of the hand. The first of these that is
            the metric itself is left out, unless it is straight lines.
        errors_unfiltered: the same against the unfiltered motion; empty if it is not known, as
            `Motion.filtered` was not used.
        not_found: methods of the comparison that have no geodesic for some segment.
    """

    model: Model
    motion: Motion
    metric: Metric
    threshold: float | None
    segments: tuple[tuple[int, int], ...]
    synergies: tuple[Synergy, ...]
    predicted: Motion
    segment_counts: Mapping[str, int]
    predictions: Mapping[str, Motion]
    errors: Mapping[str, MotionErrors]
    errors_unfiltered: Mapping[str, MotionErrors]
    not_found: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Analysis({self.model.name}, {self.motion.duration:.3f} s, {len(self.synergies)} "
            f"geodesic synergies{self._by_rule},\n  {self.metric_name},\n"
            f"  {self.errors['riemannian']})"
        )

    def _repr_markdown_(self) -> str:
        return self.table().markdown()

    @property
    def metric_name(self) -> str:
        """What the metric is, in words; of a metric that has no words, its `repr`."""
        if isinstance(self.metric, AdjustableKineticEnergy):
            return self.metric.description
        name = _METRICS.get(method_of(self.metric), repr(self.metric))
        return f"{name} {joint_inertia_of(self.metric)}".removesuffix(", same segments ").strip()

    @property
    def _by_rule(self) -> str:
        return "" if self.threshold is None else f" at a threshold of {self.threshold:g} rad"

    def table(self, *, unfiltered: bool = False) -> Table:
        """Number of segments and mean errors of all methods, of each hand if there are several.

        Args:
            unfiltered: take the errors against the unfiltered motion (`errors_unfiltered`).

        Raises:
            ValueError: the unfiltered motion is not known.
        """
        if unfiltered and not self.errors_unfiltered:
            raise ValueError("the unfiltered motion is not known: use Motion.filtered")
        errors = self.errors_unfiltered if unfiltered else self.errors
        columns = [f"{hand} [{unit}]" for hand in hand_labels(self.model.hands) for unit in _UNITS]
        rows: list[tuple[str | int | float, ...]] = []
        for method, label in self.labels().items():
            entries: list[str | float] = [NOT_FOUND] * (1 + len(columns))
            if method not in self.not_found:
                values = errors[method]
                hands = [(hand.position, hand.orientation) for hand in values.hands or [values]]
                entries = [values.joint, *chain(*hands)]
            rows.append((label, self.segment_counts.get(method, "-"), *entries))
        return Table(("method", "segments", "joints [rad]", *columns), tuple(rows))

    def labels(self) -> dict[str, str]:
        """What tables and figures call the methods, by method."""
        own = method_of(self.metric)
        straight = _METRICS["euclidean_same_segments"]
        name = _METRICS.get(own, self.metric.label or type(self.metric).__name__)
        labels = {"riemannian": name if name == straight else f"geodesics, {name}"}
        for method, label in _METRICS.items():
            if method != own and method in (*self.errors, *self.not_found):
                labels[method] = label if label == straight else f"geodesics, {label}"
        return labels | _BASELINES

    def on_same_segments(self) -> dict[str, str]:
        """Short labels, by method, of the predictions that have the segments of this analysis."""
        return {
            method: label.removeprefix("geodesics, ").removesuffix(", same segments")
            for method, label in self.labels().items()
            if method not in (*_BASELINES, *self.not_found)
        }

    def plot(self, curve: Callable[[Axes], object] | None = None) -> Figure:
        """The arm at some instants, errors over time on the same segments, and the hands' paths.

        Args:
            curve: draws the error against the number of synergies into a panel of its own, as
                `MetricComparison.draw` does; None leaves it out.
        """
        model, motion = self.model, self.motion
        labels = hand_labels(model.hands)
        joints: dict[str, Array] = {}
        distances: dict[str, dict[str, Array]] = {label: {} for label in labels}
        ways: dict[str, tuple[Array, Array]] = {}
        for method, name in self.on_same_segments().items():
            q = self.predictions[method].q
            joints[name] = np.mean(np.abs(q - motion.q), axis=1)
            for label, hand in zip(labels, model.hands, strict=True):
                seen, way = (model.frame_pose(hand, each)[1] for each in (motion.q, q))
                distances[label][name] = np.linalg.norm(way - seen, axis=1)
                if method == "riemannian":
                    ways[label] = seen, way
        several = len(labels) > 1
        # Both arms stretched out are twice as wide as one.
        instants = strip_instants(self.segments, INSTANTS // 2 + 1 if several else INSTANTS)
        name = f"predicted, {next(iter(joints))}"
        arms = (
            StripArm(Postures.of(model, motion.q[instants]), "observed", "observed"),
            StripArm(Postures.of(model, self.predicted.q[instants]), "predicted", name, False),
        )
        view = best_view(arms[0].postures, np.concatenate([seen for seen, _ in ways.values()]))
        figure = new_figure(10.0, 12.0 if several else 9.6)
        draw_analysis(
            figure,
            motion.time - motion.time[0],
            self.segments,
            instants,
            (view, across(view, arms[0].postures)),
            arms,
            ways,
            joints,
            distances,
            curve,
        )
        figure.suptitle(
            f"{model.name}: {len(self.segments)} geodesic synergies{self._by_rule},"
            + ("\n" if several else " ")
            + self.metric_name.replace("^2", "²")
        )
        return figure

    def save(
        self, folder: str | FilePath, *, curve: Callable[[Axes], object] | None = None
    ) -> list[FilePath]:
        """Write table.csv, table.md, figure.png, figure.pdf and synergies.json to the folder.

        With `errors_unfiltered` also table_unfiltered.csv and table_unfiltered.md. All are written
        to a temporary folder first and moved together; `load_synergies` reads the last.

        Args:
            folder: is made if there is none.
            curve: of the figure, see `plot`.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be created or written to.
        """
        return write_together(folder, partial(self._write, curve))

    def _write(self, curve: Callable[[Axes], object] | None, folder: FilePath) -> None:
        tables = {"table": self.table()}
        if self.errors_unfiltered:
            tables["table_unfiltered"] = self.table(unfiltered=True)
        for name, table in tables.items():
            (folder / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
            (folder / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
        save_figure(self.plot(curve), folder)
        save_synergies(
            folder / "synergies.json", self.synergies, self.motion.joint_names, self.model
        )
