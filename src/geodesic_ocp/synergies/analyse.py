"""The analysis of a recorded motion: segmentation, planning, and comparison with baselines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geodesic_ocp.manifold.metrics.euclidean import Euclidean
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.as_model import as_model
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.analysis import Analysis
from geodesic_ocp.synergies.baselines.track_hand import track_hand
from geodesic_ocp.synergies.reconstruct import Reconstruction, reconstruct
from geodesic_ocp.synergies.scores.evaluate import evaluate
from geodesic_ocp.synergies.segmentation.segment import segment
from geodesic_ocp.synergies.segmentation.segment_zero_velocity import segment_zero_velocity
from geodesic_ocp.trajectory.motion import Motion

# Recordings exceed the joint limits by tenths; more than this means wrong units [rad or m].
_FAR_OUTSIDE = 2.0
Progress = Callable[[str, int, int], object]


def no_progress(label: str, done: int, total: int) -> None:
    """Report no progress."""
    del label, done, total


def analyse(
    model: Model, motion: Motion, threshold: float = 0.6, *, progress: Progress | None = None
) -> Analysis:
    """Cut a recorded motion into geodesic synergies, plan each, and compare with the baselines.

    A geodesic synergy is a segment of a recorded motion that follows a geodesic (Klein, Jaquier,
    Meixner, Asfour 2022), not a muscle synergy of motor control.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> short = go.Motion(motion.time[300:430], motion.q[300:430], motion.joint_names)
    >>> analysis = go.analyse(arm, short)
    >>> analysis.segments
    ((0, 72), (72, 129))
    >>> round(analysis.errors["riemannian"].position, 3)  # mean error of the hand [m]
    0.01

    Args:
        model: the arm; its joints are selected from the motion by name.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        threshold: of the segmentation [rad], see `segment`.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: a joint is missing, jumps or lies far outside its limits, the motion never
            moves or is too short to filter, or the threshold is out of range.
        NotConverged: no geodesic was found for a segment.
    """
    report = progress or no_progress
    motion = motion.select(as_model(model).joint_names)
    _check_plausible(model, motion)
    if motion.velocity is None:
        motion = motion.filtered()
    metric, flat = KineticEnergy(model), Euclidean(model.dof)
    report("cutting into segments", 0, 1)
    segments = segment(metric, motion, threshold)
    zero_velocity_segments = segment_zero_velocity(motion, joints=min(3, model.dof - 1))
    total = 2 * len(segments) + len(zero_velocity_segments) + 1

    finished = 0
    found: dict[str, Reconstruction] = {}
    for method, its_metric, its_segments, label in (
        ("riemannian", metric, segments, "planning geodesics"),
        ("euclidean", flat, zero_velocity_segments, "planning straight lines"),
        ("euclidean_same_segments", flat, segments, "planning straight lines"),
    ):

        def advance(done: int, label: str = label, finished: int = finished) -> None:
            report(label, finished + done, total)

        found[method] = reconstruct(its_metric, motion, its_segments, progress=advance)
        finished += len(its_segments)
    report("tracking the hand", finished, total)
    predictions = {method: found[method].predicted for method in found}
    predictions["ik"] = track_hand(model, motion)
    report("done", total, total)
    return Analysis(
        model=model,
        motion=motion,
        threshold=float(threshold),
        segments=tuple(segments),
        synergies=found["riemannian"].synergies,
        predicted=found["riemannian"].predicted,
        segment_counts={method: len(found[method].synergies) for method in found},
        predictions=predictions,
        errors={method: evaluate(model, motion, predictions[method]) for method in predictions},
    )


def _check_plausible(model: Model, motion: Motion) -> None:
    """ValueError where a joint is far outside its limits, or jumps: other units, or a spike."""
    for joint, low, high, q in zip(
        motion.joint_names, model.lower, model.upper, motion.q.T, strict=True
    ):
        outside = np.maximum(low - q, q - high)
        worst, jump = int(np.argmax(outside)), int(np.argmax(np.abs(np.diff(q))))
        if outside[worst] > _FAR_OUTSIDE:
            raise ValueError(
                f"{joint} is {q[worst]:.6g} at sample {worst}, far outside its limits "
                f"{low:.3g} to {high:.3g}: another unit, or a spike?"
            )
        if abs(q[jump + 1] - q[jump]) > _FAR_OUTSIDE:
            raise ValueError(f"{joint} jumps from {q[jump]:.6g} to {q[jump + 1]:.6g} at {jump}")
