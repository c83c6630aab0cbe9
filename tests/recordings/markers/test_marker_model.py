"""Lengths that are adjusted, derivatives of samples, marker sets and lost markers."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from marked_motion import MMM_MARKERS

import geodesic_ocp as go
from geodesic_ocp.model.adjustable_lengths import joint_poses, with_lengths
from geodesic_ocp.model.human import human_upper_body, stature
from geodesic_ocp.recordings.markers.body import MarkedBody
from geodesic_ocp.recordings.markers.chosen_markers import rigid_poses, standing_height
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.fit_program import roughness
from geodesic_ocp.recordings.markers.marker_fit import lost_markers
from geodesic_ocp.recordings.markers.marker_set import MarkerSet, marker_sets
from geodesic_ocp.recordings.markers.markers import Markers


def test_an_arm_with_all_lengths_multiplied_is_the_arm_of_a_taller_person() -> None:
    arm, taller = go.human_arm("right", 1.6, 70.0), go.human_arm("right", 2.0, 70.0)
    count = arm.pin.njoints
    scaled = with_lengths(arm, np.full((count, 3), 1.25), np.full(count, 1.25))
    q = np.array([0.3, -0.2, -1.0, 1.2, 0.4, 0.1, -0.3])
    for got, expected in zip(scaled.hand_pose(q), taller.hand_pose(q), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12)
    np.testing.assert_allclose(scaled.mass_matrix(q), taller.mass_matrix(q), atol=1e-12)
    for body, expected in zip(scaled.bodies, taller.bodies, strict=True):
        assert isinstance(body, go.Capsule)
        assert isinstance(expected, go.Capsule)
        np.testing.assert_allclose(body.end, expected.end, atol=1e-12)
        assert body.radius == pytest.approx(expected.radius)
    assert arm.hand_pose(q)[1] == pytest.approx(go.human_arm("right", 1.6, 70.0).hand_pose(q)[1])


def test_symbolic_lengths_place_the_joints_as_the_model_with_these_lengths_does() -> None:
    arm = go.human_arm("left")
    factors = np.random.default_rng(0).uniform(0.8, 1.2, (arm.pin.njoints, 3))
    q = ca.SX.sym("q", arm.dof)
    poses = joint_poses(arm, q, ca.SX(factors.T))
    scaled = with_lengths(arm, factors, np.ones(arm.pin.njoints))
    at = np.array([0.3, -0.2, 1.0, 1.2, 0.4, 0.1, -0.3])
    for index, name in enumerate(arm.pin.names):
        if index == 0:
            continue
        rotation, position = ca.Function("f", [q], list(poses[index]))(at)
        expected = scaled.frame_pose(str(name), at)
        np.testing.assert_allclose(rotation.full(), expected[0], atol=1e-12)
        np.testing.assert_allclose(position.full()[:, 0], expected[1], atol=1e-12)


def test_stature_is_read_from_the_lengths() -> None:
    assert stature(go.human_arm("left", 1.63)) == pytest.approx(1.63)
    de_leva = go.human_arm("right", 1.63, table="de_leva", sex="female")
    assert stature(de_leva) == pytest.approx(1.63)
    assert stature(human_upper_body(1.9)) == pytest.approx(1.9)
    assert stature(go.model.combine(go.human_arm("right"), go.human_arm("left"))) == pytest.approx(
        1.75
    )
    assert MarkedBody(planar_arm()).height is None


def planar_arm() -> go.Model:
    """Two links that turn about z."""
    arm = pin.Model()
    for parent, name in enumerate(("first", "second")):
        placement = pin.SE3(np.eye(3), np.array([0.4 * parent, 0.0, 0.0]))
        index = arm.addJoint(parent, pin.JointModelRZ(), placement, name)
        arm.addJointFrame(index)
        arm.appendBodyToJoint(index, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
    arm.addFrame(pin.Frame("tip", 2, tip, pin.FrameType.OP_FRAME))
    return go.Model(arm, "tip")


@pytest.mark.slow
def test_any_model_is_fitted_to_points_on_its_frames() -> None:
    arm, time = planar_arm(), np.arange(80) / 40.0
    q = np.stack([np.sin(2.0 * time), 1.0 + 0.5 * np.cos(3.0 * time)], axis=1)
    positions = np.stack([arm.frame_pose(name, q)[1] for name in ("second", "tip")], axis=1)
    fit = fit_markers(arm, Markers(time, ("second", "tip"), positions), base="fixed")
    assert np.abs(fit.motion.q - q).max() < 0.005
    assert (fit.height, fit.lengths, fit.marker_set) == (None, {}, "frames of the model")
    # Markers on the base tell where it is.
    corners = [("universe", each) for each in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.5))]
    placed = dict(zip("abc", corners, strict=True))
    known = MarkerSet("rig", {**placed, "end": ("tip", (0.0, 0.0, 0.0))}, "m", 0.0)
    base = np.array([each for _, each in corners])
    seen = np.concatenate([np.tile(base, (80, 1, 1)), positions[:, 1:]], axis=1)
    lifted = Markers(time, ("a", "b", "c", "end"), seen + np.array([0.0, 0.0, 2.0]))
    found = fit_markers(arm, lifted, marker_set=known)
    assert found.base is not None
    np.testing.assert_allclose(found.base.positions, np.tile([0.0, 0.0, 2.0], (80, 1)), atol=1e-4)
    assert np.abs(found.motion.q - q).max() < 0.005
    with pytest.raises(ValueError, match="fractions of the body height"):
        fit_markers(arm, lifted, marker_set=MMM_MARKERS)
    with pytest.raises(ValueError, match="height is for models of people"):
        fit_markers(arm, lifted, marker_set=known, height=1.8)


def test_points_of_arm_and_upper_body_agree() -> None:
    """The arm on its thorax is that of the upper body, at the height of its shoulders."""
    arm, person = MarkedBody(go.human_arm("right")), MarkedBody(human_upper_body())
    q = np.array([0.3, -0.2, -1.0, 1.2, 0.4, 0.1, -0.3])
    names = list(person.model.joint_names)
    all_q = np.zeros(person.model.dof)
    all_q[[names.index(name) for name in arm.model.joint_names]] = q
    points = []
    for body, at in ((arm, q), (person, all_q)):
        segments = ["thorax", "right upper arm", "right elbow", "right forearm", "right hand"]
        places = [body.attachment(segment) for segment in segments]
        offsets = ca.SX(np.random.default_rng(0).normal(0.0, 0.1, (3, 5)))
        lengths = ca.SX.ones(len(body.lengths))
        points.append(ca.evalf(body.points(ca.SX(at), lengths, places, offsets)).full())
    np.testing.assert_allclose(np.diff(points[0]), np.diff(points[1]), atol=1e-12)


@given(
    coefficients=st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4),
    jitter=st.floats(0.0, 0.4),
)
def test_derivatives_of_polynomials_are_exact_for_uneven_samples(
    coefficients: list[float], jitter: float
) -> None:
    random = np.random.default_rng(1)
    time = (np.arange(50) + random.uniform(-jitter, jitter, 50)) / 25.0
    x = np.polynomial.Polynomial(coefficients)(time)
    jerk = 6.0 * coefficients[3]
    found = x @ (roughness(time, {3: 0.5}) @ x)
    assert found == pytest.approx((jerk / 0.5) ** 2 * (time[-1] - time[0]), rel=1e-6, abs=1e-3)


def test_rigid_poses_bridge_frames_with_too_few_points() -> None:
    random = np.random.default_rng(0)
    places, time = random.normal(size=(5, 3)), np.arange(6.0)
    turn = np.linspace(0.0, 1.0, 6)
    rotations = np.array(
        [[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in turn]
    )
    origins = np.stack([turn, -turn, 0 * turn], axis=1)
    observed = places @ np.swapaxes(rotations, 1, 2) + origins[:, None]
    observed[2, :3] = np.nan
    found, moved = rigid_poses(places, observed, time)
    np.testing.assert_allclose(found, rotations, atol=1e-9)
    np.testing.assert_allclose(moved, origins, atol=1e-9)


def test_marker_sets_ignore_case_and_the_subject_s_name() -> None:
    assert MMM_MARKERS.matching(("Anna:c7", "R_SHO", "nose")) == {
        "Anna:c7": "C7",
        "R_SHO": "RSHO",
    }
    for known in marker_sets().values():
        assert known.source
        for segment, (x, y, z) in known.places.values():
            if "right" in segment:
                mirrored = (segment.replace("right", "left"), (-x, y, z))
                assert mirrored in known.places.values()


def test_wrong_marker_sets_are_refused() -> None:
    with pytest.raises(ValueError, match="unit"):
        MarkerSet("a", {}, unit="cm")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="offset of x"):
        MarkerSet("a", {"x": ("thorax", (0.0, 1.0))})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="segment and an offset"):
        MarkerSet("a", {"x": "thorax"})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="'y' is not a marker"):
        MarkerSet("a", {"x": ("thorax", (0.0, 1.0, 0.0))}, uncertainty={"y": 0.1})
    with pytest.raises(ValueError, match="negative"):
        MarkerSet("a", {"x": ("thorax", (0.0, 1.0, 0.0))}, uncertainty=-0.1)


def test_lost_markers_are_found_across_gaps() -> None:
    time, places = np.arange(6) / 10.0, np.zeros((6, 2, 3))
    places[:, 1, 0] = 0.3
    observed = places.copy()
    observed[1:5, 0] = [0.28, 0.0, 0.0]
    observed[3, 0] = np.nan
    errors = np.linalg.norm(observed - places, axis=2)
    weights = 1.0 / (1.0 + (errors / 0.03) ** 2) ** 2
    (found,) = lost_markers(time, ("a", "b"), observed, places, weights)
    assert (found.marker, found.near) == ("a", "b")
    assert (found.start, found.end) == pytest.approx((0.1, 0.4))
    assert found.distance == pytest.approx(0.28)
    assert "where b should be" in str(found)


def test_the_height_of_a_standing_person_is_read_from_head_and_feet() -> None:
    names = ("LFHD", "RBHD", "LANK", "C7")
    heights = np.array([0.970, 0.955, 0.02075, 0.85]) * 1.7 + 0.3  # on a stage
    positions = np.zeros((20, 4, 3))
    positions[:, :, 2] = heights
    positions[:10, :2, 2] -= 0.2  # bends at first
    positions[12, 0] = np.nan
    markers = Markers(np.arange(20) / 10.0, names, positions)
    assert standing_height(markers) == pytest.approx(1.7)
    assert standing_height(Markers(markers.time, ("C7",), positions[:, 3:])) is None
