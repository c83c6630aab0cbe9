"""Optimal cuts: exact on the grid of candidates, refined to the sample."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from smooth_motions import reversing

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic
from geodesic_ocp.synergies import segment_costs
from geodesic_ocp.synergies.optimal_segmentations import OptimalSegmentations

TIME = reversing().time
GRID = list(range(0, 46, 5))  # every 0.1 s
OPTIONS = {"spacing": 0.1, "max_duration": 0.5}
MEASURES = ("joint", "position", "orientation")


@pytest.fixture(scope="module")
def motion() -> go.Motion:
    return reversing()


@pytest.fixture(scope="module")
def costs(
    arm: go.Model, arm_metric: go.KineticEnergy, motion: go.Motion
) -> dict[str, dict[tuple[int, int], float]]:
    """Sums of errors over the samples of every segment, each reconstructed by itself."""
    found: dict[str, dict[tuple[int, int], float]] = {measure: {} for measure in MEASURES}
    for start, stop in combinations(GRID, 2):
        if stop - start <= 25:
            part = slice(start, stop + 1)
            names = motion.joint_names
            alone = go.Motion(TIME[part], motion.q[part], names, motion.velocity[part])
            predicted = go.synergies.reconstruct(arm_metric, alone, [(0, stop - start)]).predicted
            errors = go.synergies.motion_errors(arm, alone, predicted)
            for measure in MEASURES:
                found[measure][start, stop] = len(alone) * getattr(errors, measure)
    return found


@pytest.fixture(scope="module")
def found(arm_metric: go.KineticEnergy, motion: go.Motion) -> dict[str, OptimalSegmentations]:
    return {
        measure: go.synergies.optimal_segmentations(arm_metric, motion, measure=measure, **OPTIONS)
        for measure in MEASURES
    }


def all_partitions(costs: dict[tuple[int, int], float]) -> dict[tuple[int, ...], float]:
    """Mean errors of all ways to cut at samples of the grid."""
    result = {}
    for number in range(len(GRID) - 1):
        for inner in combinations(GRID[1:-1], number):
            cuts = (0, *inner, GRID[-1])
            if all(pair in costs for pair in pairwise(cuts)):
                result[cuts] = sum(costs[pair] for pair in pairwise(cuts)) / len(TIME)
    return result


@pytest.mark.slow
@pytest.mark.parametrize("measure", MEASURES)
def test_cuts_on_the_grid_are_the_best_of_all(
    measure: str,
    found: dict[str, OptimalSegmentations],
    costs: dict[str, dict[tuple[int, int], float]],
) -> None:
    partitions = all_partitions(costs[measure])
    result = found[measure]
    least = {}
    for cuts, error in partitions.items():
        least[len(cuts) - 1] = min(error, least.get(len(cuts) - 1, np.inf))
    assert result.counts.tolist() == sorted(least) == list(range(2, 10))
    assert result.errors == pytest.approx([least[count] for count in result.counts], rel=1e-6)
    for count in result.counts:
        segments = result.segments(count, refined=False)
        cuts = (0, *(stop for _, stop in segments))
        assert len(segments) == count
        assert partitions[cuts] == pytest.approx(least[count], rel=1e-6)
        assert result.error(count, refined=False) == pytest.approx(least[count], rel=1e-6)
    for penalty in (0.0, 1e-4, 1e-3, 1e-2, 1.0):
        best = min(partitions, key=lambda cuts: partitions[cuts] + penalty * (len(cuts) - 1))
        assert result.count_for(penalty=penalty) == len(best) - 1
    for error in (1.5 * least[9], 1.001 * least[4], 1.001 * least[2]):
        enough = [len(cuts) - 1 for cuts, value in partitions.items() if value <= error]
        assert result.count_for(error=error) == min(enough)


@pytest.mark.slow
@pytest.mark.parametrize("measure", MEASURES)
def test_error_is_that_of_the_reconstruction(
    measure: str,
    found: dict[str, OptimalSegmentations],
    arm: go.Model,
    arm_metric: go.KineticEnergy,
    motion: go.Motion,
) -> None:
    for refined in (False, True):
        segments = found[measure].segments(4, refined=refined)
        predicted = go.synergies.reconstruct(arm_metric, motion, segments).predicted
        error = getattr(go.synergies.motion_errors(arm, motion, predicted), measure)
        assert found[measure].error(4, refined=refined) == pytest.approx(error, rel=1e-6)
        own = found[measure].predicted(4, refined=refined)
        assert own.q == pytest.approx(predicted.q, abs=1e-8)


@pytest.mark.slow
def test_no_cut_can_be_moved_by_a_sample_for_the_better(
    found: dict[str, OptimalSegmentations], arm: go.Model, motion: go.Motion
) -> None:
    result = found["joint"]
    segments = result.segments(4)
    error = result.error(4)
    assert error <= result.error(4, refined=False)
    cuts = [0, *(stop for _, stop in segments)]
    for index in (1, 2, 3):
        for move in (-1, 1):
            moved = [*cuts[:index], cuts[index] + move, *cuts[index + 1 :]]
            if np.diff(TIME[moved]).max() <= 0.5 + 1e-9:
                predicted = go.synergies.reconstruct(
                    result.metric, motion, list(pairwise(moved))
                ).predicted
                assert go.synergies.motion_errors(arm, motion, predicted).joint >= error * (
                    1.0 - 1e-6
                )


@pytest.mark.slow
def test_one_run_or_one_call_cut_alike(
    found: dict[str, OptimalSegmentations],
    arm_metric: go.KineticEnergy,
    motion: go.Motion,
) -> None:
    wanted = found["joint"].segments(3)
    assert go.synergies.segment_optimal(arm_metric, motion, count=3, **OPTIONS) == wanted
    error = found["joint"].errors[1] * 1.0001
    assert go.synergies.segment_optimal(arm_metric, motion, error=error, **OPTIONS) == wanted


def test_corners_between_geodesics_are_found(arm: go.Model, arm_metric: go.KineticEnergy) -> None:
    """Two geodesics at constant speed, the corner between candidates: no error remains."""
    v = np.array([1.2, -0.3, 0.6, 0.9, -0.5, 0.2, 0.4])
    q = np.array([0.2, 0.1, -0.6, 0.7, 0.1, -0.1, 0.2])
    first = sample_geodesic(arm_metric, q, 0.3 * v, np.linspace(0.0, 1.0, 24), tolerance=1e-11)
    turned = 0.3 * v[::-1]
    second = sample_geodesic(
        arm_metric, first[0][-1], turned, np.linspace(0.0, 22.0 / 23.0, 23), tolerance=1e-11
    )
    # A corner has no speed: that of both geodesics is made the same.
    scale = arm_metric.norm(q, 0.3 * v) / arm_metric.norm(first[0][-1], turned)
    fractions = np.linspace(0.0, scale * 22.0 / 23.0, 23)
    second = sample_geodesic(arm_metric, first[0][-1], turned, fractions, tolerance=1e-11)
    rows = np.vstack([first[0], second[0][1:]])
    rates = np.vstack([first[1], scale * second[1][1:]]) / (23 * 0.02)
    cornered = go.Motion(TIME, rows, arm.joint_names, rates)
    result = go.synergies.optimal_segmentations(arm_metric, cornered, spacing=0.1)
    assert result.errors[0] > 1e-2  # one geodesic
    assert result.segments(2, refined=False) != [(0, 23), (23, 45)]
    assert result.segments(2) == [(0, 23), (23, 45)]
    assert result.error(2) < 1e-7


def test_segments_without_a_geodesic_are_avoided_and_counted(
    motion: go.Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    flat = go.Euclidean(7)
    with_all = go.synergies.optimal_segmentations(flat, motion, **OPTIONS)
    lost = set(with_all.segments(3, refined=False))
    plan = segment_costs.predict_segment

    def fail(metric: go.Metric, seen: go.Motion, speed: np.ndarray, *pair: int) -> np.ndarray:
        if pair in lost:
            raise go.NotConverged("no geodesic was found")
        return plan(metric, seen, speed, *pair)

    monkeypatch.setattr(segment_costs, "predict_segment", fail)
    with pytest.warns(RuntimeWarning, match=r"3 log maps of 35 failed; .* not available"):
        rest = go.synergies.optimal_segmentations(flat, motion, **OPTIONS)
    assert not lost & set(rest.segments(3, refined=False))
    assert rest.error(3, refined=False) > with_all.error(3, refined=False)
    lost.update(combinations(range(46), 2))
    with pytest.raises(go.NotConverged, match="35 of 35 log maps failed"):
        go.synergies.optimal_segmentations(flat, motion, **OPTIONS)


def test_a_motion_of_fewer_samples_than_candidates_is_cut_at_its_samples(
    motion: go.Motion,
) -> None:
    short = go.Motion(TIME[:4], motion.q[:4], motion.joint_names, motion.velocity[:4])
    result = go.synergies.optimal_segmentations(go.Euclidean(7), short, spacing=0.001)
    assert result.counts.tolist() == [1, 2, 3]
    assert result.segments(3) == [(0, 1), (1, 2), (2, 3)]
    assert result.error(3) == pytest.approx(0.0, abs=1e-12)


def test_progress_and_repr(motion: go.Motion) -> None:
    seen: list[tuple[str, int, int]] = []
    result = go.synergies.optimal_segmentations(
        go.Euclidean(7), motion, **OPTIONS, progress=lambda *args: seen.append(args)
    )
    assert seen == [("planning segments", done, 35) for done in range(1, 36)]
    assert repr(result).startswith("OptimalSegmentations(measure='joint', counts=[2")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "exactly one of count, penalty and error"),
        ({"count": 3, "penalty": 0.1}, "exactly one of count, penalty and error"),
        ({"count": 1}, r"count must be 2 to 9 .* at most 0\.5 s, got 1"),
        ({"count": 10}, "count must be 2 to 9 .* got 10"),
        (
            {"count": 3, "spacing": 0.9, "max_duration": 2.0},
            "count must be 1, the only number possible with these candidates .* got 3",
        ),
        ({"count": 2.5}, "count must be a positive integer, got 2.5"),
        ({"error": -1.0}, "error must be at least .*, which 9 segments reach, got -1.0"),
        ({"penalty": -1.0}, "penalty must not be negative, got -1.0"),
        ({"count": 3, "measure": "hand"}, "measure must be one of joint, .* got 'hand'"),
        ({"count": 3, "measure": "position"}, "measure 'position' needs a model"),
        ({"count": 3, "spacing": 0.0}, r"spacing must be positive \[s\], got 0.0"),
        ({"count": 3, "max_duration": 0.05}, r"max_duration must be at least 0\.1 s"),
    ],
)
def test_wrong_arguments_are_named(
    options: dict[str, object], message: str, motion: go.Motion
) -> None:
    with pytest.raises(ValueError, match=message):
        go.synergies.segment_optimal(go.Euclidean(7), motion, **{**OPTIONS, **options})
    bare = go.Motion(motion.time, motion.q, motion.joint_names)
    with pytest.raises(ValueError, match="has no velocities"):
        go.synergies.segment_optimal(go.Euclidean(7), bare, count=3)
