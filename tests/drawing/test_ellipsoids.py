"""Mobility ellipsoids at the hand."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_models import planar_arm
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.drawing.scene import EllipsoidTrack
from geodesic_ocp.drawing.surroundings import (
    SIZE,
    inverse_tensors,
    mobility_ellipsoids,
    scaled_ellipsoids,
)

ARM = go.human_arm()
Q = np.linspace([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [0.9, 0.3, -0.2, 1.5, 0.0, 0.1, 0.0], 21)


def test_hand_velocities_of_unit_energy_lie_in_the_ellipsoid() -> None:
    """Velocities of unit length in the metric; some of them reach its surface."""
    metric = go.KineticEnergy(ARM)
    (track,) = mobility_ellipsoids(ARM, Q, metric)
    rng = np.random.default_rng(0)
    for q, axes in zip(Q[::10], track.axes[::10], strict=True):
        jacobian = ARM.hand_jacobian(q)[:3]
        velocities = rng.normal(size=(200, 7))
        velocities /= [[metric.norm(q, v)] for v in velocities]
        # Velocities along G^-1 J' u are the best ones in the direction u.
        best = np.linalg.solve(metric.matrix(q), jacobian.T @ rng.normal(size=(3, 200))).T
        best /= [[metric.norm(q, v)] for v in best]
        inside, on = (np.linalg.solve(axes, jacobian @ v.T) for v in (velocities, best))
        radii = np.linalg.norm(on, axis=0)
        assert_allclose(radii, radii[0], rtol=1e-9)  # all scaled alike
        assert np.linalg.norm(inside, axis=0).max() <= radii[0] * (1.0 + 1e-9)


def test_one_scale_holds_for_all_times() -> None:
    (track,) = mobility_ellipsoids(ARM, Q)
    lengths = semi_axes(track)
    assert lengths.max() == pytest.approx(SIZE * ARM.reach)
    hand = ARM.hand_jacobian(Q[0])[:3], ARM.hand_jacobian(Q[-1])[:3]
    metric = go.KineticEnergy(ARM)
    longest = [
        np.sqrt(np.linalg.eigvalsh(j @ np.linalg.inv(metric.matrix(q)) @ j.T)[-1])
        for j, q in zip(hand, Q[[0, -1]], strict=True)
    ]
    drawn = lengths[[0, -1]].max(axis=1)
    assert drawn[0] / drawn[1] == pytest.approx(longest[0] / longest[1])


def test_directions_of_no_motion_are_thin() -> None:
    """A planar arm cannot leave its plane; stretched out, it cannot move along itself."""
    arm = planar_arm((1.0, 0.8), (1.0, 1.0), (0.5, 0.4), (0.1, 0.1))
    (track,) = mobility_ellipsoids(arm, np.array([[0.3, 1.2], [0.3, 0.0]]))
    lengths = semi_axes(track)
    thin = 0.02 * lengths.max()
    assert_allclose(lengths[0, 0], thin)
    assert lengths[0, 1] > 5.0 * thin
    assert_allclose(lengths[1, :2], thin)


@pytest.mark.slow
def test_a_motion_with_both_hands_has_two() -> None:
    arms = go.human_upper_body()
    assert len(mobility_ellipsoids(arms, np.zeros((1, arms.dof)))) == 2


@given(st.lists(st.floats(0.1, 3.0), min_size=3, max_size=3), st.integers(0, 100))
def test_axes_turn_steadily(lengths: list[float], seed: int) -> None:
    """Of an ellipsoid that turns by small steps, also where its semi-axes are equally long."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    turns = rotations_about(axis / np.linalg.norm(axis), np.linspace(0.0, 3.0, 60))
    images = turns @ np.diag(np.square(lengths)) @ turns.transpose(0, 2, 1)
    (track,) = scaled_ellipsoids([("ball", np.zeros((60, 3)), images)], max(lengths))
    assert_allclose(track.axes @ track.axes.transpose(0, 2, 1), images, rtol=0, atol=1e-9)
    steps = np.abs(np.diff(track.axes, axis=0)).max()
    assert steps <= 2.0 * (3.0 / 59.0) * np.ptp(lengths) + 1e-9


def test_a_nearly_singular_sample_leaves_the_others_their_size() -> None:
    """It is cut at three times the median, in place of making all others thin."""
    images = np.tile(np.diag([1.0, 0.25, 0.09]), (9, 1, 1))
    images[4] *= 1e8
    (track,) = scaled_ellipsoids([("ball", np.zeros((9, 3)), images)], 0.3)
    lengths = semi_axes(track)
    assert_allclose(np.delete(lengths, 4, axis=0), np.tile([0.03, 0.05, 0.1], (8, 1)))
    assert_allclose(lengths[4], 0.3)


def test_between_the_samples_of_a_long_motion_they_are_close_to_the_exact_ones() -> None:
    turns = np.linspace(0.0, 20.0 * np.pi, 6001)[:, None] + np.arange(7)  # ten turns in 60 s
    q = Q[0] + 0.3 * np.sin(turns)
    (track,) = mobility_ellipsoids(ARM, q)
    shown = np.arange(0, 6001, 7)
    (exact,) = mobility_ellipsoids(ARM, q[shown])
    scale = SIZE * ARM.reach
    assert len(track.axes) == len(track.centres) == len(q)
    assert np.abs(track.axes[shown] - exact.axes).max() < 0.01 * scale


def test_inverses_are_zero_where_there_is_no_metric() -> None:
    class Indefinite(go.Metric):
        dim = 2

        def matrix(self, q: Any) -> Any:
            return ca.diag(ca.vertcat(q[0], 2.0))

    found = inverse_tensors(Indefinite(), np.array([[4.0, 0.0], [-1.0, 0.0], [0.0, 0.0]]))
    assert_allclose(found, [np.diag([0.25, 0.5]), np.zeros((2, 2)), np.zeros((2, 2))])


def semi_axes(track: EllipsoidTrack) -> np.ndarray:
    """Lengths (k, 3) [m] in increasing order."""
    return np.linalg.svd(track.axes, compute_uv=False)[:, ::-1]


def rotations_about(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Rotations (k, 3, 3) about an axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sines, cosines = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sines * cross + (1.0 - cosines) * (cross @ cross)
