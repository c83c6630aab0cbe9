"""Robots by name, and models of all formats against numeric Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from gadget import MJCF, urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder

MMM = Path("data") / "models" / "mmm.xml"


def loaded(robot: str, backend: str) -> go.Model:
    if folder(ROBOTS[robot].package) is None:
        pytest.skip(f"{ROBOTS[robot].package} is not installed (make robots)")
    if robot.startswith("armar6"):
        with pytest.warns(UserWarning, match=r"armar6.urdf, line (232|526): the comma"):
            return go.load_model(robot, backend=backend)
    return go.load_model(robot, backend=backend)


# A waist or lift of 3, 2, 1 and 1 joints, and both arms.
DOF = {"g1": 17, "talos": 16, "tiago-pro": 15, "armar6": 17}
DOF |= {"ur5": 6, "armar6-left": 8, "armar6-right": 8}


@pytest.mark.parametrize("robot", ROBOTS)
def test_known_robots_can_be_loaded(robot: str) -> None:
    model = loaded(robot, "built-in")
    assert model.dof == DOF.get(robot, 7)
    assert len(model.hands) == len(ROBOTS[robot].hands)
    assert np.all(np.isfinite([model.lower, model.upper]))
    assert model.name == robot
    assert len(model.continuous) == (
        3 if robot.startswith("armar6-") else 6 if robot == "armar6" else 0
    )
    if ROBOTS[robot].raised:  # a hanging hand is above the ground
        ground = model.frame_pose("base_footprint", np.zeros(model.dof))[1][2]
        retargeting = pytest.importorskip("geodesic_ocp.retargeting")
        assert retargeting.align(model).shoulder[2] - ground > model.reach
    if robot.endswith(("left", "left-arm")):  # with x forward, or y for the torso of ARMAR-6
        side = 0 if robot.startswith("armar6") else 1
        assert model.pin.jointPlacements[1].translation[side] * (-1) ** (1 - side) > 0.0


def both_arms(backend: str, shared: Path) -> go.Model:
    left = go.human_arm("left", table="de_leva", sex="female", backend=backend)
    return go.model.combine(
        left, go.human_arm("right", backend=backend).with_payload(2.0, [0, 0, 0.1])
    )


def mmm_body(backend: str, shared: Path) -> go.Model:
    return go.load_model(shared / MMM, hand="Hand L TCP", base="BPx_joint", backend=backend)


MODELS: dict[str, Callable[[str, Path], go.Model]] = {
    **{robot: lambda backend, shared, robot=robot: loaded(robot, backend) for robot in ROBOTS},
    "both arms, one with a load": both_arms,
    "MMM": mmm_body,
    "URDF": lambda backend, shared: go.load_model(urdf(), hand="grip", backend=backend),
    "MJCF": lambda backend, shared: go.load_model(MJCF, hand="tip", base="trunk", backend=backend),
}


def configurations(model: go.Model, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(np.maximum(model.lower, -3.0), np.minimum(model.upper, 3.0), (5, model.dof))


@pytest.mark.parametrize("source", MODELS)
def test_models_of_every_source_agree_with_numeric_pinocchio(
    source: str, backend: str, request: pytest.FixtureRequest, rng: np.random.Generator
) -> None:
    model = MODELS[source](
        backend, request.getfixturevalue("shared") if source == "MMM" else Path()
    )
    data, frame = model.pin.createData(), model.pin.getFrameId(model.hand)
    for q in configurations(model, rng):
        upper = np.triu(pin.crba(model.pin, data, q))
        expected = upper + np.triu(upper, 1).T
        atol = 1e-11 * np.abs(expected).max()
        assert_allclose(model.mass_matrix(q), expected, rtol=0, atol=atol)
        pin.framesForwardKinematics(model.pin, data, q)
        assert_allclose(model.hand_pose(q)[1], data.oMf[frame].translation, rtol=0, atol=1e-12)
        assert_allclose(model.hand_pose(q)[0], data.oMf[frame].rotation, rtol=0, atol=1e-12)
        energy = pin.computePotentialEnergy(model.pin, data, q)
        assert model.potential_energy(q) == pytest.approx(energy, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize(
    ("name", "hand", "message"),
    [
        ("armar4", "armr_wri2", "link 'armr_sho3', 0.51 kg, has an inertia that is not positive"),
        ("icub_reduced", "r_foot", "link 'r_hip_1', 0.754 kg, has an inertia"),
        ("romeo_laas_small", "l_ankle", "link 'LHipPitch_link', 4.71 kg, .*moments -0.00272"),
        ("panda", "panda_tool", "hand 'panda_tool' is not a frame of 'panda'"),
    ],
)
def test_robots_with_invalid_inertia_are_rejected_by_name(
    name: str, hand: str, message: str
) -> None:
    needed = "armar" if name == "armar4" else "example-robot-data"
    if folder(needed) is None:
        pytest.skip(f"{needed} is not installed (make robots)")
    with pytest.raises(ValueError, match=message):
        go.load_model(name, hand=hand)


def test_massless_fingers_of_a_robot_are_named() -> None:
    if (root := folder("example-robot-data")) is None:
        pytest.skip("example-robot-data is not installed (make robots)")
    file = root / "romeo_description" / "urdf" / "romeo.urdf"
    native = pin.buildModelFromUrdf(str(file))  # mimic joints become independent
    with pytest.raises(
        ValueError, match=r"link 'LFinger2\dLink' moves with joint 'LFinger2\d', but"
    ):
        go.load_model(native, hand="LFinger22Link")
    assert go.load_model(file, hand="l_wrist", base="torso").dof == 7
