"""The analysis of a recorded motion: geodesic synergies, planned and compared with baselines."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from inspect import signature
from itertools import chain
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.errors import NotConverged
from geodesic_ocp.figures import save_figure
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import (
    JOINT_INERTIA,
    KINETIC_ENERGY,
    STRAIGHT_LINES,
    AdjustableKineticEnergy,
    Euclidean,
    MetricName,
    as_analysis_metric,
    compared_metrics,
    joint_inertia_of,
    method_of,
)
from geodesic_ocp.model.model import Model, as_model, hand_labels
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.baselines import track_hand
from geodesic_ocp.synergies.scores import MotionErrors, errors_between, motion_errors
from geodesic_ocp.synergies.second_order import OF_A_GEODESIC, SECOND_ORDER, second_order_names
from geodesic_ocp.synergies.segment import segment, segment_zero_velocity
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.synergy import (
    PlannedSegments,
    Synergy,
    as_segments,
    plan_segments,
    reconstruction,
    save_synergies,
)
from geodesic_ocp.synergies.uncertainty import Cutting, Uncertainty, bootstrap
from geodesic_ocp.tables import in_degrees, markdown, new_table, save_tables
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.noise import Noise
from geodesic_ocp.trajectory.recording import check_plausible, check_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

_METRICS = {
    "kinetic_energy": KINETIC_ENERGY,
    "joint_inertia": JOINT_INERTIA,
    "euclidean_same_segments": f"{STRAIGHT_LINES}, same segments",
}
_BASELINES = {
    "euclidean": f"{STRAIGHT_LINES}, zero-velocity segments",
    "ik": "inverse kinematics of the hand",
}
_UNITS = ("m", "rad")


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """A recorded motion, its geodesic synergies (see `Synergy`), and the baselines.

    Attributes:
        model: the arm, or a model with several hands, such as `human_upper_body`.
        motion: the observed motion, filtered.
        metric: in which the motion was cut and its synergies are geodesics.
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
        not_found: methods of the comparison that have no geodesic for some segment; their errors
            are means over the samples of the other segments, and there is no prediction of theirs.
        without_geodesic: of these methods, the indices of the segments that have none.
        cutting: how the motion was cut, from metric and motion; None if the segments were given.
        noise: noise of the motion; None is that of the residuals of its filter.
    """

    model: Model
    motion: Motion
    metric: Metric
    segments: tuple[tuple[int, int], ...]
    synergies: tuple[Synergy, ...]
    predicted: Motion
    segment_counts: Mapping[str, int]
    predictions: Mapping[str, Motion]
    errors: Mapping[str, MotionErrors]
    errors_unfiltered: Mapping[str, MotionErrors]
    not_found: tuple[str, ...] = ()
    cutting: Cutting | None = None
    noise: Noise | None = None
    without_geodesic: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Analysis({self.model.name}, {self.motion.duration:.3f} s, {len(self.synergies)} "
            f"geodesic synergies, {self.cuts},\n  {self.metric_name},\n"
            f"  {self.errors['riemannian']})"
        )

    def _repr_markdown_(self) -> str:
        return markdown(self.table())

    @property
    def metric_name(self) -> str:
        """The metric in words; its `repr` if it has no description."""
        if isinstance(self.metric, AdjustableKineticEnergy):
            return self.metric.description
        name = _METRICS.get(method_of(self.metric), repr(self.metric))
        return f"{name} {joint_inertia_of(self.metric)}".removesuffix(", same segments ").strip()

    @property
    def cuts(self) -> str:
        """How the motion was cut: developed, online, optimal or the name of another function, with
        the numbers that are not its defaults, as in "online, threshold 0.4"; or given.
        """
        if self.cutting is None:
            return "given"
        rule = getattr(self.cutting, "func", self.cutting)
        if rule is segment:
            name = "online"
        else:
            name = getattr(rule, "__name__", type(rule).__name__).removeprefix("segment_")
        usual = signature(rule).parameters
        chosen = getattr(self.cutting, "keywords", {}).items()
        own = [(k, v) for k, v in chosen if isinstance(v, int | float | str)]
        numbers = [f"{k} {v}" for k, v in own if k not in usual or v != usual[k].default]
        return ", ".join([name, *numbers])

    def table(self, *, unfiltered: bool = False) -> DataFrame:
        """Return number of segments and mean errors of all methods, of each hand if there are
        several.

        Args:
            unfiltered: take the errors against the unfiltered motion (`errors_unfiltered`).

        Raises:
            ValueError: the unfiltered motion is not known.
        """
        if unfiltered and not self.errors_unfiltered:
            raise ValueError("the unfiltered motion is not known: use Motion.filtered")
        errors = self.errors_unfiltered if unfiltered else self.errors
        rows = [
            (label, self._segments_of(method), *self._entries(errors.get(method)))
            for method, label in self.labels().items()
        ]
        lacking = "; ".join(map(self._lacking, self.not_found))
        notes = (f"Not found: {lacking}." if lacking else "", self.motion.caveat)
        note = " ".join(filter(None, notes))
        return new_table(("method", "segments", *self._columns), rows, note)

    def segments_found(self, method: str) -> int | None:
        """Return how many segments of a method have a geodesic; None if it has no segments."""
        count = self.segment_counts.get(method)
        return None if count is None else count - len(self.without_geodesic.get(method, ()))

    def _segments_of(self, method: str) -> int | str | None:
        """Return the number of segments of a method, as "7 of 8" if some have no geodesic."""
        count = self.segment_counts.get(method)
        found = self.segments_found(method)
        return count if found == count else f"{found} of {count}"

    def _lacking(self, method: str) -> str:
        """Return the name of a method that lacks geodesics, and of which segments."""
        label = self.labels()[method]
        spans = [
            "{:.2f} to {:.2f} s".format(*self.motion.time[list(self.segments[number])])
            for number in self.without_geodesic.get(method, ())
        ]
        if not spans or not self.segments_found(method):
            return label
        return f"{label} from {' and '.join(spans)}, where its errors do not count"

    @property
    def _columns(self) -> list[str]:
        hands = hand_labels(self.model.hands)
        return ["joints [rad]", *(f"{hand} [{unit}]" for hand in hands for unit in _UNITS)]

    def _entries(self, errors: MotionErrors | None) -> list[float]:
        """Return the errors in the order of the columns, NaN if there are none."""
        if errors is None:
            return [np.nan] * len(self._columns)
        hands = [(hand.position, hand.orientation) for hand in errors.hands or [errors]]
        return [errors.joint, *chain(*hands)]

    def second_order(self, *, effort: bool = False) -> DataFrame:
        """Return mean errors of other predictions on the same segments, beside the geodesics.

        Riemannian cubics and splines are those of the metric; minimum acceleration and cubic
        splines are their counterparts in a constant metric; then minimum jerk, of the joints and of
        the hand. Each row says what it receives for a segment, besides the duration. Takes some ms
        for a segment.

        Args:
            effort: also motions of least torque, torque change and work, with the inertia of the
                metric, which take seconds each.
        """
        errors = self.second_order_errors(effort=effort)
        own = self._entries(self.errors["riemannian"])
        rows: list[tuple[object, ...]] = [(self.labels()["riemannian"], OF_A_GEODESIC, *own)]
        rows += [(k, SECOND_ORDER[k].receives, *self._entries(e)) for k, e in errors.items()]
        lacking = ", ".join(name for name, found in errors.items() if found is None)
        note = f"Not found: {lacking}." if lacking else ""
        return new_table(("method", "receives for a segment", *self._columns), rows, note)

    def second_order_errors(
        self, *, unfiltered: bool = False, effort: bool = False
    ) -> dict[str, MotionErrors | None]:
        """Return mean errors by the names in `second_order`; None for what was not found.

        Args:
            unfiltered: against the unfiltered motion, if it is known.
            effort: see `second_order`.
        """
        seen = self.motion
        if unfiltered and seen.unfiltered is not None:
            seen = Motion(seen.time, seen.unfiltered, seen.joint_names)
        known = self.second_order_predictions(effort=effort)
        return {
            name: motion_errors(self.model, seen, known[name]) if name in known else None
            for name in second_order_names(effort)
        }

    def second_order_predictions(self, *, effort: bool = False) -> Mapping[str, Motion]:
        """Return the predictions on the same segments, by the names in `second_order`.

        Args:
            effort: see `second_order`.
        """
        every = {name: _second_order(self, name) for name in second_order_names(effort)}
        return {name: found for name, found in every.items() if found is not None}

    def uncertainty(
        self, replicates: int = 100, *, seed: int = 0, progress: Progress | None = None
    ) -> Uncertainty:
        """Return how far number, cuts and errors of the synergies vary under the recording's noise.

        Args:
            replicates: number of motions with noise of the recording's spectrum, which are filtered
                and cut as this one; 20 to 100 ms each.
            seed: of the noise; the same seed gives the same result.
            progress: called with what is done, the number of replicates so far, and the total.

        Raises:
            ValueError: the motion was not filtered and there is no `noise`, or the segments were
                given as sample indices.
        """
        if self.cutting is None:
            raise ValueError(
                "how the segments were found is not known: give analyse a function of metric and "
                "motion, such as segments=go.segment"
            )
        own = self.model, self.metric, self.motion, self.segments, self.cutting
        return bootstrap(
            *own, noise=self.noise, replicates=replicates, seed=seed, progress=progress
        )

    def labels(self) -> dict[str, str]:
        """Return the names of the methods in tables and figures, by method."""
        own = method_of(self.metric)
        straight = _METRICS["euclidean_same_segments"]
        name = _METRICS.get(own, self.metric.label or type(self.metric).__name__)
        labels = {"riemannian": name if name == straight else f"geodesics, {name}"}
        for method, label in _METRICS.items():
            if method != own and method in (*self.errors, *self.not_found):
                labels[method] = label if label == straight else f"geodesics, {label}"
        return labels | _BASELINES

    def on_same_segments(self) -> dict[str, str]:
        """Return short labels, by method, of the predictions that have the segments of this
        analysis.
        """
        return {
            method: label.removeprefix("geodesics, ").removesuffix(", same segments")
            for method, label in self.labels().items()
            if method not in (*_BASELINES, *self.not_found)
        }

    def save(
        self,
        folder: str | FilePath,
        *,
        figure: Figure | None = None,
        effort: bool = False,
        uncertainty: Uncertainty | None = None,
        degrees: bool = False,
    ) -> list[FilePath]:
        """Write table and second_order (.csv, .md), synergies.json and a figure (.png, .pdf).

        With `errors_unfiltered` also table_unfiltered.csv and table_unfiltered.md, and with an
        uncertainty cuts.csv and cuts.md. All are written to a temporary folder first and moved
        together; `load_synergies` reads the last.

        Args:
            folder: is made if there is none.
            figure: of the analysis, as `go.plot` draws it; None: none is written.
            effort: see `second_order`.
            uncertainty: of the cuts, see `uncertainty`.
            degrees: state angles in degrees in tables.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be created or written to.
        """

        def write(place: FilePath) -> None:
            tables = {"table": self.table(), "second_order": self.second_order(effort=effort)}
            if self.errors_unfiltered:
                tables["table_unfiltered"] = self.table(unfiltered=True)
            if uncertainty is not None:
                tables["cuts"] = uncertainty.table()
            if degrees:
                tables = {name: in_degrees(table) for name, table in tables.items()}
            save_tables(place, tables)
            if figure is not None:
                save_figure(figure, place)
            save_synergies(
                place / "synergies.json",
                synergies=self.synergies,
                joint_names=self.motion.joint_names,
                model=self.model,
                doubts=self.motion.doubts,
            )

        return write_together(folder, write)


@lru_cache(maxsize=64)
def _second_order(analysis: Analysis, name: str) -> Motion | None:
    """Return one of `SECOND_ORDER` on the segments of an analysis; None if it was not found."""
    with suppress(NotConverged):
        predict = SECOND_ORDER[name].predict
        return predict(analysis.metric, analysis.model, analysis.motion, analysis.segments)
    return None


@shows_progress
def analyse(
    model: Model,
    motion: Motion,
    *,
    metric: Metric | MetricName | None = None,
    segments: Sequence[tuple[int, int]] | Cutting = segment_developed,
    noise: Noise | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Cut a recorded motion into geodesic synergies, plan each, and compare with the baselines.

    A geodesic synergy is a segment of a recorded motion that follows a geodesic (Klein, Jaquier,
    Meixner, Asfour 2022), not a muscle synergy of motor control.

    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion.part(300, 449))
    >>> analysis.segments
    ((0, 72), (72, 131), (131, 149))
    >>> round(analysis.errors["riemannian"].position, 3)  # mean error of the hand [m]
    0.008

    Args:
        model: the arm, or arms and trunk (`human_upper_body`, `combine`); its joints are selected
            from the motion by name. The base is taken to be at rest.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        metric: in which the motion is cut and planned. None or "joint-inertia": the kinetic energy
            with the model's joint inertia (`Model.armature`), or, if the model has none, with the
            default one (`default_joint_inertia`). "kinetic": the kinetic energy without joint
            inertia, also if the model has some, which is the paper's metric. "euclidean": straight
            lines. Or any metric on the model's joints, such as `KineticEnergy(model)`.
        segments: a function of metric and motion that finds the segments: `segment_developed`,
            which cuts where geodesics explain the whole motion best; `segment`, the online rule of
            Klein et al.; or either with other numbers, as `partial(go.segment, threshold=0.4)`. Or
            (start, stop) sample indices from the first sample to the last.
        noise: noise of the motion for `Analysis.uncertainty`, such as `MarkerFit.noise`; None is
            that of the residuals of its filter.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: a joint is missing, jumps or lies far outside its limits, the motion never
            moves or is too short to filter, a number is out of range, the metric is unknown or not
            on the model's joints, or the segments do not cover the motion.
        NotConverged: no geodesic of the metric was found for a segment.

    Warns:
        RuntimeWarning: a metric that is only compared has no geodesic for a segment; see
            `Analysis.not_found`. Its errors are means over the other segments.
    """
    report = progress or no_progress
    if isinstance(model, Motion):
        raise ValueError("the model comes first, then the motion: analyse(model, motion)")
    if not hasattr(motion, "select"):
        name = type(motion).__name__
        raise ValueError(f"motion must be a Motion, as from go.read_motion, got {name}")
    motion = motion.select(as_model(model).joint_names)
    if motion.velocity is None:
        check_units(model, motion)
        motion = motion.without_outliers()
    check_plausible(model, motion)
    metric = as_analysis_metric(metric, model)
    if motion.velocity is None:
        motion = motion.filtered()
    report("cutting into segments", 0, 1)
    cutting = segments if callable(segments) else None
    given = segments(metric, motion) if callable(segments) else segments
    cut = as_segments(motion, given)
    # Three of the seven joints of an arm, in proportion: of 20, three reverse at once by chance.
    reversing = min(3, model.dof - 1) if len(model.hands) == 1 else round(3 * model.dof / 7)
    zero_velocity = segment_zero_velocity(motion, joints=reversing)
    compared = compared_metrics(metric, model)
    planned = [("riemannian", metric, cut), *((name, its, cut) for name, its in compared.items())]
    planned.append(("euclidean", Euclidean(model.dof), zero_velocity))
    counts = {method: len(its_segments) for method, _, its_segments in planned}
    total = sum(counts.values()) + 1
    finished = 0
    label = ""

    def advance(number: int) -> None:
        report(label, finished + number, total)

    found: dict[str, PlannedSegments] = {}
    for method, its_metric, its_segments in planned:
        lines = isinstance(its_metric, Euclidean)
        label = "planning straight lines" if lines else "planning geodesics"
        found[method] = plan_segments(
            its_metric, motion, its_segments, progress=advance, throw=method not in compared
        )
        if failures := found[method].failures:
            spans = [its_segments[number] for number in failures]
            named = ", ".join(
                f"{motion.time[start]:.3f} to {motion.time[stop]:.3f} s (samples {start} to {stop})"
                for start, stop in spans
            )
            rest = "its errors are means over the others"
            if not found[method].synergies:
                rest = "it is left out of the comparison"
            warnings.warn(
                f"{method.replace('_', ' ')}: no geodesic was found for {len(failures)} of "
                f"{len(its_segments)} segments, {named}, so that {rest}: "
                f"{next(iter(failures.values()))}",
                RuntimeWarning,
                stacklevel=2,
            )
        finished += len(its_segments)
    found.setdefault("euclidean_same_segments", found["riemannian"])
    report("tracking the hand", finished, total)
    predictions = {
        method: reconstruction(each, motion).predicted
        for method, each in found.items()
        if not each.failures
    }
    tracked = track_hand(model, motion)
    predictions["ik"] = tracked
    predicted = {method: each.q for method, each in found.items() if each.synergies}
    predicted["ik"] = tracked.q
    report("done", total, total)
    observed = [motion]
    if motion.unfiltered is not None:
        observed.append(Motion(motion.time, motion.unfiltered, motion.joint_names))
    errors = [
        {method: errors_between(model, seen.q, q) for method, q in predicted.items()}
        for seen in observed
    ]
    without_geodesic = {
        method: tuple(each.failures) for method, each in found.items() if each.failures
    }
    return Analysis(
        model=model,
        motion=motion,
        metric=metric,
        segments=tuple(cut),
        synergies=found["riemannian"].synergies,
        predicted=predictions["riemannian"],
        segment_counts=counts | {"euclidean_same_segments": len(cut)},
        predictions=predictions,
        errors=errors[0],
        errors_unfiltered=errors[1] if len(errors) > 1 else {},
        not_found=tuple(without_geodesic),
        cutting=cutting,
        noise=noise,
        without_geodesic=without_geodesic,
    )
