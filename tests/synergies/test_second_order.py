"""Riemannian cubics and splines as predictions of a recorded motion."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.manifold.metrics import default_joint_inertia
from geodesic_ocp.synergies.second_order import cubic_spline, riemannian_cubics, riemannian_spline

ARM = go.human_arm()
HUMAN = go.KineticEnergy(ARM.with_armature(default_joint_inertia(ARM)))
TIME = np.linspace(0.0, 1.0, 51)
SEGMENTS = [(0, 20), (20, 35), (35, 50)]


def wave() -> go.Motion:
    phase = TIME[:, None] * np.linspace(1.0, 3.0, 7)
    return go.Motion(TIME, np.sin(phase), ARM.joint_names, np.linspace(1.0, 3.0, 7) * np.cos(phase))


def test_cubics_of_a_constant_metric_are_minimum_acceleration() -> None:
    motion = wave()
    predicted = riemannian_cubics(go.Euclidean(7), motion, SEGMENTS)
    expected = go.baselines.minimum_acceleration(motion, SEGMENTS)
    np.testing.assert_allclose(predicted.q, expected.q, atol=1e-12)
    splines = riemannian_spline(go.Euclidean(7), motion, SEGMENTS), cubic_spline(motion, SEGMENTS)
    np.testing.assert_allclose(splines[0].q, splines[1].q, atol=1e-12)
    np.testing.assert_allclose(splines[0].velocity, splines[1].velocity, atol=1e-11)


def test_predictions_meet_what_they_receive() -> None:
    motion = wave()
    edges = [0, 20, 35, 50]
    cubics = riemannian_cubics(HUMAN, motion, SEGMENTS)
    np.testing.assert_allclose(cubics.q[edges], motion.q[edges], atol=1e-8)
    np.testing.assert_allclose(cubics.velocity[edges], motion.velocity[edges], atol=1e-8)
    through = riemannian_spline(HUMAN, motion, SEGMENTS)
    np.testing.assert_allclose(through.q[edges], motion.q[edges], atol=1e-8)
    np.testing.assert_allclose(through.velocity[[0, -1]], motion.velocity[[0, -1]], atol=1e-8)


def test_a_recorded_cubic_is_predicted_exactly() -> None:
    q0, q1 = np.zeros(7), np.linspace(0.5, -0.3, 7)
    recorded = go.cubic(HUMAN, q0, np.ones(7), q1, -np.ones(7), 0.8)
    t = np.linspace(0.0, 0.8, 41)
    motion = go.Motion(t, recorded(t), ARM.joint_names, recorded(t, 1))
    np.testing.assert_allclose(riemannian_cubics(HUMAN, motion, [(0, 40)]).q, motion.q, atol=1e-8)
    parts = riemannian_cubics(HUMAN, motion, [(0, 15), (15, 40)])
    np.testing.assert_allclose(parts.q, motion.q, atol=1e-8)


def test_segments_must_cover_the_motion() -> None:
    with pytest.raises(ValueError, match="segments"):
        riemannian_spline(HUMAN, wave(), SEGMENTS[:2])


@pytest.mark.slow
def test_optimal_cuts_of_cubics_find_where_a_motion_changes() -> None:
    """Two cubics that meet with equal velocities are found again from one cut."""
    q, turn = np.zeros(7), np.linspace(0.5, -0.3, 7)
    first = go.cubic(HUMAN, q, np.ones(7), turn, -np.ones(7), 0.6)
    second = go.cubic(HUMAN, turn, -np.ones(7), q, 2.0 * np.ones(7), 0.4)
    t = np.linspace(0.0, 1.0, 51)
    inside = t <= 0.6 + 1e-9
    rows = [
        np.vstack([first(t[inside], order), second(t[~inside] - 0.6, order)]) for order in (0, 1)
    ]
    motion = go.Motion(t, rows[0], ARM.joint_names, rows[1])
    found = go.synergies.optimal_segmentations(HUMAN, motion, curve="cubic", spacing=0.1)
    assert found.segments(2) == [(0, 30), (30, 50)]
    assert found.errors[found.counts == 2][0] < 1e-8
    assert found.errors[found.counts == 1][0] > 1e-3
    with pytest.raises(ValueError, match="curve must be one of geodesic, cubic"):
        go.synergies.segment_optimal(HUMAN, motion, count=2, curve="line")  # type: ignore[arg-type]


@pytest.mark.slow
def test_an_analysis_tells_what_each_method_receives() -> None:
    analysis = go.analyse(ARM, wave(), segments=SEGMENTS)
    table = analysis.second_order()
    assert list(table.index) == [
        "geodesics, kinetic energy with joint inertia",
        "Riemannian cubics",
        "minimum acceleration",
        "Riemannian spline",
        "cubic spline",
        "minimum jerk",
        "minimum jerk of the hand",
    ]
    assert table["receives for a segment"].iloc[1] == "2 configurations, 2 velocities"
    errors = go.synergies.motion_errors(
        ARM, analysis.motion, riemannian_cubics(analysis.metric, analysis.motion, SEGMENTS)
    )
    assert table["joints [rad]"].iloc[1] == errors.joint
    assert table["joints [rad]"].iloc[0] == analysis.table()["joints [rad]"].iloc[0]
    assert table["hand [m]"].iloc[1] == errors.position


@pytest.mark.slow
def test_motions_of_least_effort_are_predicted_when_asked_for() -> None:
    analysis = go.analyse(ARM, wave(), segments=SEGMENTS)
    usual, all_of_them = (set(analysis.second_order(effort=given).index) for given in (False, True))
    assert all_of_them - usual == {
        *("least torque", "least torque change", "least work", "least work and acceleration")
    }
    torque = analysis.second_order_predictions(effort=True)["least torque"]
    cubics = analysis.second_order_predictions()["Riemannian cubics"]
    assert np.abs(torque.q - cubics.q).max() > 1e-3


@pytest.mark.slow
def test_knots_of_a_spline_are_found_again() -> None:
    points = np.array([[0.0, 1.0], [0.8, 0.2], [-0.5, 0.6], [0.4, 0.0]])
    original = go.spline(go.Euclidean(2), [0.0, 0.3, 0.6, 1.0], points, v0=[1.0, 0.0], v1=[0, 1])
    motion = go.Motion(TIME, original(TIME), ("x", "y"), original(TIME, 1))
    found = go.synergies.spline_knots(go.Euclidean(2), motion, spacing=0.1)
    assert found.counts.tolist() == list(range(1, 11))
    assert found.segments(3) == [(0, 15), (15, 30), (30, 50)]
    assert found.errors[2] < 1e-12 < 1e-3 < found.errors[1]
    assert found.count_for(1e-6) == 3
    with pytest.raises(ValueError, match="error must be at least"):
        found.count_for(-1.0)
    with pytest.raises(ValueError, match="count must be one of 1 to 10, got 11"):
        found.segments(11)
