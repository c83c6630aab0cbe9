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
