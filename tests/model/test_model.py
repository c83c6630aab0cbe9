"""Model: what it tells of itself, and what it refuses."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import geodesic_ocp as go


def test_model_keeps_a_copy(arm: go.Model) -> None:
    native = arm.pin.copy()
    model = go.Model(native, "hand")
    before = model.mass_matrix(np.zeros(7))
    native.inertias[7] = pin.Inertia.Random()
    assert np.array_equal(model.mass_matrix(np.zeros(7)), before)
    assert np.array_equal(go.Model(model.pin, "hand").mass_matrix(np.zeros(7)), before)


def test_model_and_path_are_shown_in_a_line(arm: go.Model) -> None:
    shown = f"Model('human right arm', 7 degrees of freedom, hand='hand', backend={arm.backend!r})"
    assert repr(arm) == shown
    path = go.Path(go.KineticEnergy(arm), go.Grid(1, 2), np.zeros((3, 7)))
    assert repr(path) == f"Path(metric=KineticEnergy(model={shown}), grid={path.grid!r})"


def test_unknown_hand_lists_the_frames(arm: go.Model) -> None:
    with pytest.raises(ValueError, match=r"no frame 'foot'.*hand"):
        go.Model(arm.pin, "foot")


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(6), r"q must have shape \(7,\), got \(6,\)"),
        ([0, 0, 0, 0, 0, 0, np.nan], "q must be finite"),
        ("posture", "q must be 7 numbers"),
    ],
)
def test_wrong_configurations_are_named(arm: go.Model, q: object, message: str) -> None:
    for function in (arm.mass_matrix, arm.hand_pose, arm.hand_jacobian):
        with pytest.raises(ValueError, match=message):
            function(q)


def test_hand_pose_of_many(arm: go.Model, rng: np.random.Generator) -> None:
    many = rng.uniform(-1.0, 1.0, (5, 7))
    rotations, positions = arm.hand_pose(many)
    for q, rotation, position in zip(many, rotations, positions, strict=True):
        assert np.array_equal(arm.hand_pose(q)[0], rotation)
        assert np.array_equal(arm.hand_pose(q)[1], position)
    with pytest.raises(ValueError, match=r"shape \(k, 7\)"):
        arm.hand_pose(many[:, :3])


def test_continuous_joints_have_no_limits() -> None:
    native = pin.Model()
    first = native.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "wheel")
    low, high = np.array([-1.0]), np.array([2.0])
    free = np.array([np.inf])
    second = native.addJoint(
        first, pin.JointModelRX(), pin.SE3.Identity(), "lever", free, free, low, high
    )
    native.addFrame(pin.Frame("end", second, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model = go.Model(native, "end")
    assert model.dof == 2
    assert model.joint_names == ("wheel", "lever")
    assert model.lower.tolist() == [-np.inf, -1.0]
    assert model.upper.tolist() == [np.inf, 2.0]


def test_payload_adds_its_kinetic_energy(backend: str, rng: np.random.Generator) -> None:
    """G + m J'J at its centre of mass, and the energy of its rotation."""
    empty = go.human_arm("right", backend=backend)
    position, moments = np.array([0.02, -0.03, 0.1]), rng.normal(size=(3, 3))
    inertia = 0.01 * moments @ moments.T
    loaded = empty.with_payload(1.5, position, inertia)
    assert loaded.name == "human right arm with 1.5 kg"
    assert loaded.backend == backend
    for q in rng.uniform(-1.0, 1.0, (5, 7)):
        rotation, hand = empty.hand_pose(q)
        linear, angular = np.split(empty.hand_jacobian(q), 2)
        centre = linear - np.cross(rotation @ position, angular.T).T
        turning = rotation @ inertia @ rotation.T
        expected = empty.mass_matrix(q) + 1.5 * centre.T @ centre + angular.T @ turning @ angular
        assert loaded.mass_matrix(q) == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert np.array_equal(loaded.hand_pose(q)[1], hand)
    point = empty.with_payload(1.5)
    assert point.mass_matrix(q) == pytest.approx(empty.mass_matrix(q) + 1.5 * linear.T @ linear)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), r"mass must be positive \[kg\], got 0.0"),
        ((1.0, (0.0, 0.1)), r"position must have shape \(3,\)"),
        ((1.0, (0.0, 0.0, 0.0), np.eye(2)), "inertia must be 3 x 3"),
        ((1.0, (0.0, 0.0, 0.0), np.diag([1.0, 1.0, -1.0])), "negative principal moment"),
        ((1.0, (0.0, 0.0, 0.0), np.tri(3)), "inertia must be symmetric"),
    ],
)
def test_objects_that_are_none_are_named(arguments: tuple, message: str, arm: go.Model) -> None:
    with pytest.raises(ValueError, match=message):
        arm.with_payload(*arguments)
