"""Numbers that stand for gaps are told from rests, limits, coarse sensors and fast motion."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.trajectory.gaps import gap_samples, smallest_step

TIME = np.arange(300) / 100.0  # [s]
Q = np.column_stack([0.5 + np.sin(3.0 * TIME), 1.5 + 0.4 * np.cos(4.0 * TIME), 0.02 * TIME])
REVOLUTIONS = 4.0 * np.pi  # [rad]


def gaps(q: np.ndarray) -> list[list[int]]:
    """Samples of each joint that are found."""
    found = gap_samples(q[:, :, None], REVOLUTIONS)
    return [np.flatnonzero(column).tolist() for column in found.T]


@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize(
    "rows", [range(2), range(100, 114), range(298, 300), [*range(60, 62), *range(64, 90)]]
)
def test_rows_of_zeros_are_a_gap_of_every_joint(rows: list[int], noise: float) -> None:
    """Also of the third joint, which is near zero anyway and does not jump."""
    q = Q + noise * np.random.default_rng(0).normal(size=Q.shape)
    q[rows] = 0.0
    assert gaps(q) == 3 * [list(rows)]


@pytest.mark.parametrize("number", [0.0, -99.0, 9999999.0, -3.697314e28])
def test_one_joint_alone_has_a_gap(number: float) -> None:
    q = Q.copy()
    q[100:114, 1] = number
    assert gaps(q) == [[], list(range(100, 114)), []]


def test_one_sample_is_a_gap_where_nothing_moves_so_far_and_back() -> None:
    q = Q.copy()
    q[[150, 152], 0] = 9999.0
    q[200] = 0.0  # may be a spike, which is interpolated
    assert gaps(q) == [[150, 152], [], []]
    q[0] = 0.0  # at the ends nothing tells a spike
    assert gaps(q) == [[0, 150, 152], [0], [0]]


def minimum_jerk(start: float, duration: float) -> np.ndarray:
    s = np.clip((TIME - start) / duration, 0.0, 1.0)
    return 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5


def test_rests_limits_and_coarse_sensors_are_no_gaps() -> None:
    """Motions of up to 15 rad/s, the fastest of an arm, in joints at rest before and after."""
    moves = np.column_stack([2.4 * minimum_jerk(1.0, 0.3), minimum_jerk(1.3, 0.4), 0.0 * TIME])
    there_and_back = moves - np.column_stack([2.4 * minimum_jerk(2.0, 0.4), *moves.T[1:]])
    for q in (moves, there_and_back, -moves):
        assert gaps(q) == [[], [], []]  # from rest at zero, and to it
        assert gaps(np.clip(q, -0.7, 0.7)) == [[], [], []]  # held at a limit
        for step in (1e-3, 0.05, 0.2):
            assert gaps(step * np.round(q / step)) == [[], [], []]  # coarse
        assert gaps(np.repeat(q[::4], 4, axis=0)) == [[], [], []]  # every sample four times


def test_the_rest_beside_a_gap_is_none() -> None:
    q = 1.0 + np.column_stack([2.4 * minimum_jerk(1.0, 0.3), minimum_jerk(1.3, 0.4)])
    for rows in (slice(50, 60), slice(180, 220)):
        q[rows] = 0.0
    assert gaps(q) == 2 * [[*range(50, 60), *range(180, 220)]]


def test_the_smallest_step() -> None:
    counts = np.random.default_rng(1).integers(0, 4096, 500)
    assert smallest_step(2.0 * np.pi / 4096.0 * counts) == pytest.approx(2.0 * np.pi / 4096.0)
    assert smallest_step(np.full(9, 0.3)) == 0.0


def test_gaps_in_arrays_are_named_and_kept() -> None:
    q = Q.copy()
    q[100:114] = 0.0
    q[200:210, 1] = 0.0
    motion = go.Motion(TIME, q, ("shoulder", "elbow", "wrist"))
    with pytest.warns(RuntimeWarning, match=r"all joints from 1\.000 to 1\.130 s jumps .*\(gap"):
        cleaned = motion.without_outliers()
    found = [(each.kind, each.joint, each.start, each.stop) for each in cleaned.outliers]
    assert found == [("gap", "all joints", 1.0, 1.13), ("gap", "elbow", 2.0, 2.09)]
    assert np.array_equal(cleaned.q, q)
