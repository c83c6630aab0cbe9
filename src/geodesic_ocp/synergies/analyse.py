"""The analysis of a recorded motion: segmentation, planning, and comparison with baselines."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.recordings.plausible import check_plausible
from geodesic_ocp.synergies.analysis import (
    Analysis,
    MetricName,
    as_analysis_metric,
    compared_metrics,
)
from geodesic_ocp.synergies.baselines import track_hand
from geodesic_ocp.synergies.scores import evaluate
from geodesic_ocp.synergies.segment import segment, segment_zero_velocity
from geodesic_ocp.synergies.synergy import Reconstruction, as_segments, reconstruct
from geodesic_ocp.trajectory.motion import Motion


def analyse(
    model: Model,
    motion: Motion,
    threshold: float = 0.6,
    *,
    metric: Metric | MetricName | None = None,
    segments: Sequence[tuple[int, int]] | None = None,
    rest: float = 0.02,
    rest_duration: float = 0.1,
    min_duration: float = 0.1,
    hysteresis: float = 0.1,
    progress: Progress | None = None,
) -> Analysis:
    """Cut a recorded motion into geodesic synergies, plan each, and compare with the baselines.

    A geodesic synergy is a segment of a recorded motion that follows a geodesic (Klein, Jaquier,
    Meixner, Asfour 2022), not a muscle synergy of motor control.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> short = go.Motion(motion.time[300:450], motion.q[300:450], motion.joint_names)
    >>> analysis = go.analyse(arm, short)
    >>> analysis.segments
    ((0, 128), (128, 149))
    >>> round(analysis.errors["riemannian"].position, 3)  # mean error of the hand [m]
    0.023

    Args:
        model: the arm, or arms and trunk (`human_upper_body`, `combine`); its joints are selected
            from the motion by name. The base is taken to be at rest.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        threshold: of the segmentation [rad], see `segment`.
        metric: in which the motion is cut and planned. None or "joint-inertia": the kinetic energy
            with the model's joint inertia (`Model.armature`), or, if the model has none, with the
            default one (`default_joint_inertia`). "kinetic": the kinetic energy without joint
            inertia, also if the model has some, which is the paper's metric. "euclidean": straight
            lines. Or any metric on the model's joints, such as `KineticEnergy(model)`.
        segments: (start, stop) sample indices from the first sample to the last, as found by
            `segment_optimal`, in place of those that `segment` finds.
        rest, rest_duration, min_duration, hysteresis: of the segmentation, see `segment`.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: a joint is missing, jumps or lies far outside its limits, the motion never
            moves or is too short to filter, a number is out of range, the metric is unknown or not
            on the model's joints, or the segments do not cover the motion.
        NotConverged: no geodesic of the metric was found for a segment.

    Warns:
        RuntimeWarning: a metric that is only compared has no geodesic for a segment; see
            `Analysis.not_found`.
    """
    report = progress or no_progress
    motion = motion.select(as_model(model).joint_names)
    check_plausible(model, motion)
    metric = as_analysis_metric(metric, model)
    if motion.velocity is None:
        motion = motion.filtered()
    report("cutting into segments", 0, 1)
    if segments is None:
        rests = {"rest": rest, "rest_duration": rest_duration}
        noise = {"min_duration": min_duration, "hysteresis": hysteresis}
        cut = segment(metric, motion, threshold, **rests, **noise)
    else:
        cut = as_segments(motion, segments)
    # Three of the seven joints of an arm, in proportion: of 20, three reverse at once by chance.
    reversing = min(3, model.dof - 1) if len(model.hands) == 1 else round(3 * model.dof / 7)
    zero_velocity = segment_zero_velocity(motion, joints=reversing)
    compared = compared_metrics(metric, model)
    planned = [("riemannian", metric, cut), *((name, its, cut) for name, its in compared.items())]
    planned.append(("euclidean", Euclidean(model.dof), zero_velocity))
    counts = {method: len(its_segments) for method, _, its_segments in planned}
    total, finished, done, label = sum(counts.values()) + 1, 0, 0, ""

    def advance(number: int) -> None:
        nonlocal done
        done = number
        report(label, finished + number, total)

    found: dict[str, Reconstruction] = {}
    for method, its_metric, its_segments in planned:
        lines, done = isinstance(its_metric, Euclidean), 0
        label = "planning straight lines" if lines else "planning geodesics"
        try:
            found[method] = reconstruct(its_metric, motion, its_segments, progress=advance)
        except GeodesicOcpError as error:
            if method not in compared:
                raise
            start, stop = its_segments[done]
            warnings.warn(
                f"{method.replace('_', ' ')}: no geodesic was found for the segment from "
                f"{motion.time[start]:.3f} to {motion.time[stop]:.3f} s (samples {start} to "
                f"{stop}), so that it is left out of the comparison: {error}",
                RuntimeWarning,
                stacklevel=2,
            )
        finished += len(its_segments)
    found.setdefault("euclidean_same_segments", found["riemannian"])
    report("tracking the hand", finished, total)
    predictions = {method: found[method].predicted for method in found}
    predictions["ik"] = track_hand(model, motion)
    report("done", total, total)
    observed = [motion]
    if motion.unfiltered is not None:
        observed.append(Motion(motion.time, motion.unfiltered, motion.joint_names))
    errors = [
        {method: evaluate(model, seen, each) for method, each in predictions.items()}
        for seen in observed
    ]
    return Analysis(
        model=model,
        motion=motion,
        metric=metric,
        threshold=float(threshold) if segments is None else None,
        segments=tuple(cut),
        synergies=found["riemannian"].synergies,
        predicted=found["riemannian"].predicted,
        segment_counts=counts | {method: len(found[method].synergies) for method in found},
        predictions=predictions,
        errors=errors[0],
        errors_unfiltered=errors[1] if len(errors) > 1 else {},
        not_found=tuple(method for method in compared if method not in found),
    )
