"""Segmentation of a motion into the synergies that reconstruct it best."""

from __future__ import annotations

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.synergies.segmentation.optimal_segmentations import optimal_segmentations
from geodesic_ocp.synergies.segmentation.segment_costs import Measure
from geodesic_ocp.trajectory.motion import Motion


def segment_optimal(
    metric: Metric,
    motion: Motion,
    *,
    count: int | None = None,
    penalty: float | None = None,
    error: float | None = None,
    measure: Measure = "joint",
    model: Model | None = None,
    spacing: float = 0.05,
    max_duration: float = 2.0,
    progress: Progress | None = None,
) -> list[tuple[int, int]]:
    """Cut a motion where `reconstruct` then has the least mean error.

    Exactly one of `count`, `penalty` and `error` says how many segments. The optimum over a grid of
    candidate cuts, every `spacing` seconds, is found by dynamic programming
    (`optimal_segmentations`); then each cut moves by single samples as long as that lowers the
    error. Where `segment` cuts as the motion unfolds, from its past alone, this function sees all
    of it.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv").filtered()
    >>> part = go.Motion(motion.time[:90], motion.q[:90], motion.joint_names, motion.velocity[:90])
    >>> segments = go.segment_optimal(go.Euclidean(7), part, count=3)
    >>> len(segments), segments[0][0], segments[-1][1]
    (3, 0, 89)

    Args:
        metric: of the motion's dimension.
        motion: with velocities, see `Motion.filtered`.
        count: number of segments.
        penalty: cost of a segment: the number of segments k minimizes (mean error of k segments) +
            penalty * k, in the unit of the measure, before the refinement.
        error: the smallest number of segments is taken whose mean error is at most this before the
            refinement, in the unit of the measure.
        measure: of the error: "joint" [rad], "position" or "orientation" of the hand [m, rad].
        model: whose hand is measured; None is the metric's, where it has one.
        spacing: of the candidates [s].
        max_duration: of a segment [s].
        progress: called with what is done, the number of segments planned, and the total.

    Returns:
        (start, stop) sample indices of every segment, as from `segment`.

    Raises:
        ValueError: not exactly one of count, penalty and error; a count or an error that is not
            possible, with the possible range; or see `optimal_segmentations`.
        NotConverged: see `optimal_segmentations`.
    """
    if sum(each is not None for each in (count, penalty, error)) != 1:
        raise ValueError("exactly one of count, penalty and error must be given")
    found = optimal_segmentations(
        metric,
        motion,
        measure=measure,
        model=model,
        spacing=spacing,
        max_duration=max_duration,
        progress=progress,
    )
    if count is None:
        count = found.count_for(penalty=penalty, error=error)
    return found.segments(count)
