"""The human arm, compared with its reference model and anthropometric tables."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.anthropometry import Sex

CHAIN = ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")


def numbers(node: ElementTree.Element, *names: str) -> np.ndarray:
    return np.array([float(node.get(name, "nan")) for name in names])


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_arm_agrees_with_the_reference_model(side: str, shared: Path) -> None:
    letter = side[0].upper()
    root = ElementTree.parse(shared / "data" / "models" / "mmm.xml").getroot()
    nodes = {node.get("name"): node for node in root.findall("RobotNode")}
    arm = go.human_arm(side, 1.0, 1.0)

    # Joints: order, axes and limits.
    assert arm.joint_names == tuple(f"{letter}{name}_joint" for name in CHAIN)
    children = {name: [c.get("name") for c in n.findall("Child")] for name, n in nodes.items()}
    for before, after in pairwise(CHAIN):
        below = children[f"{letter}{before}_joint"]
        segment = f"{letter}{after[0]}segment_joint"
        below = below + (children[segment] if segment in below else [])
        assert f"{letter}{after}_joint" in below
    for index, name in enumerate(arm.joint_names):
        joint = nodes[name].find("Joint")
        axis = numbers(joint.find("axis"), "x", "y", "z")
        data = arm.pin.joints[index + 1].createData()
        arm.pin.joints[index + 1].calc(data, np.zeros(7))
        assert np.array_equal(np.asarray(data.S).ravel()[3:], axis)
        limits = numbers(joint.find("limits"), "lo", "hi")
        assert np.array_equal([arm.lower[index], arm.upper[index]], limits)

    # Lengths: the segments' own joints shift along -z [mm for a height of 1 m].
    for joint, segment in ((4, "E"), (6, "W")):
        row = nodes[f"{letter}{segment}segment_joint"].find(".//row3")
        shift = float(row.get("c4")) / 1000.0
        assert arm.pin.jointPlacements[joint].translation[2] == pytest.approx(shift, abs=1e-15)

    # Bodies: mass, centre of mass and inertia. The upper arm and the forearm are stored at their
    # distal ends.
    bodies = {
        3: (f"{letter}Esegment_joint", -0.188),
        5: (f"{letter}Wsegment_joint", -0.145),
        7: (f"Hand {letter} Palm", 0.0),
    }
    for joint, (name, offset) in bodies.items():
        physics = nodes[name].find("Physics")
        body = arm.pin.inertias[joint]
        assert body.mass == pytest.approx(float(physics.find("Mass").get("value")), rel=1e-12)
        centre = numbers(physics.find("CoM"), "x", "y", "z") / 1000.0
        assert body.lever == pytest.approx(centre + np.array([0, 0, offset]), abs=1e-12)
        inertia = [
            numbers(physics.find(f"InertiaMatrix/{row}"), "c1", "c2", "c3")
            for row in ("row1", "row2", "row3")
        ]
        assert body.inertia == pytest.approx(np.array(inertia), abs=1e-18)

    # Tool centre point.
    transform = nodes[f"Hand {letter} TCP"].find("Transform")
    position = numbers(transform.find("Translation"), "x", "y", "z") / 1000.0
    frame = arm.pin.frames[arm.pin.getFrameId("hand")].placement
    assert frame.translation == pytest.approx(position, abs=1e-15)
    angles = transform.find("rollpitchyaw")
    assert [angles.get(name) for name in ("roll", "pitch", "yaw")] == ["180", "0", "0"]
    assert frame.rotation == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=1e-15)


def test_height_and_mass_scale_the_arm(rng: np.random.Generator) -> None:
    small, large = go.human_arm("left", 1.0, 1.0), go.human_arm("left", 1.5, 60.0)
    q = rng.uniform(small.lower, small.upper)
    assert large.mass_matrix(q) == pytest.approx(60 * 1.5**2 * small.mass_matrix(q), rel=1e-12)
    rotation, position = small.hand_pose(q)
    assert large.hand_pose(q)[0] == pytest.approx(rotation, abs=1e-14)
    assert large.hand_pose(q)[1] == pytest.approx(1.5 * position, abs=1e-14)


def test_zero_configuration_and_signs() -> None:
    arm = go.human_arm("right", 2.0, 70.0)
    reach = 2.0 * (0.188 + 0.145 + 0.037)
    assert arm.hand_pose(np.zeros(7))[1] == pytest.approx([-0.03, 0.0, -reach], abs=1e-12)
    forward = arm.hand_pose([math.pi / 2, 0, 0, 0, 0, 0, 0])[1]
    assert forward == pytest.approx([-0.03, reach, 0.0], abs=1e-12)
    elbow = arm.hand_pose([0, 0, 0, math.pi / 2, 0, 0, 0])[1]
    assert elbow == pytest.approx([-0.03, 2 * (0.145 + 0.037), -2 * 0.188], abs=1e-12)


def test_the_left_arm_mirrors_the_right(rng: np.random.Generator) -> None:
    """Left and right are mirror images, up to slightly different inertias of the hands."""
    right, left = go.human_arm("right"), go.human_arm("left")
    flip = np.array([1, -1, -1, 1, -1, 1, -1])
    q = rng.uniform(right.lower, right.upper)
    mirror = np.diag([-1.0, 1.0, 1.0])
    assert left.hand_pose(flip * q)[1] == pytest.approx(mirror @ right.hand_pose(q)[1], abs=1e-12)
    signs = np.outer(flip, flip)
    difference = left.mass_matrix(flip * q) - signs * right.mass_matrix(q)
    assert np.abs(difference).max() < 2e-3 * np.abs(right.mass_matrix(q)).max()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"side": "up"}, "side must be 'right' or 'left', got 'up'"),
        ({"height": 0.0}, r"height must be positive \[m\], got 0.0"),
        ({"height": float("nan")}, "height must be positive"),
        ({"mass": -70.0}, r"mass must be positive \[kg\], got -70.0"),
        (
            {"height": 178},
            r"height and mass must be at most 3 m and 1000 kg, got 178 m.*is the height in cm\?",
        ),
        ({"mass": 1e300}, "at most 3 m and 1000 kg"),
        ({"mass": "heavy"}, "mass must be a number, got 'heavy'"),
    ],
)
def test_implausible_arguments_are_rejected(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.human_arm(**arguments)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(
    ("sex", "stature", "lengths", "masses"),
    [
        ("male", 1.741, (0.2817, 0.2689), (2.71, 1.62, 0.61)),
        ("female", 1.735, (0.2751, 0.2643), (2.55, 1.38, 0.56)),
    ],
)
def test_the_mean_person_of_de_leva(
    side: Any, sex: Any, stature: float, lengths: tuple[float, ...], masses: tuple[float, ...]
) -> None:
    """De Leva (1996), table 4: segment lengths [m] and masses [% of the body's]."""
    arm = go.human_arm(side, height=stature, mass=100.0, table="de_leva", sex=sex)
    elbow, wrist = arm.pin.jointPlacements[4], arm.pin.jointPlacements[6]
    assert_allclose(elbow.translation, [0.0, 0.0, -lengths[0]], rtol=0, atol=1e-12)
    assert_allclose(wrist.translation, [0.0, 0.0, -lengths[1]], rtol=0, atol=1e-12)
    found = [arm.pin.inertias[joint].mass for joint in (3, 5, 7)]
    assert_allclose(found, masses, rtol=1e-12)


def test_moments_of_inertia_of_de_leva() -> None:
    arm = go.human_arm("right", height=1.741, mass=73.0, table="de_leva", sex="male")
    upper, hand = arm.pin.inertias[3], arm.pin.inertias[7]
    assert upper.lever[2] == pytest.approx(-0.5772 * 0.2817)
    # The sagittal axis of the upper arm is y, that of the hand, through the palm, is x.
    radii = np.sqrt(np.diag(upper.inertia) / upper.mass)
    assert_allclose(radii, np.array([0.269, 0.285, 0.158]) * 0.2817, rtol=1e-12)
    radii = np.sqrt(np.diag(hand.inertia) / hand.mass)
    assert_allclose(radii, np.array([0.628, 0.513, 0.401]) * 0.0862, rtol=1e-12)


def test_tables_and_sexes_differ() -> None:
    q = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    winter = go.human_arm().mass_matrix(q)
    men, women = (go.human_arm(table="de_leva", sex=sex).mass_matrix(q) for sex in get_args(Sex))
    assert np.abs(men - winter).max() > 0.1 * np.abs(winter).max()
    assert np.abs(women - men).max() > 0.1 * np.abs(men).max()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"table": "zatsiorsky"}, "table must be one of winter, de_leva, got 'zatsiorsky'"),
        ({"table": "de_leva"}, "needs sex='male' or 'female', got None"),
        ({"table": "de_leva", "sex": "f"}, "got 'f'"),
        ({"sex": "male"}, "'winter' does not differ by sex"),
    ],
)
def test_wrong_tables_are_named(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.human_arm(**arguments)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_capsules_connect_the_joints(side: str) -> None:
    arm = go.human_arm(side, height=1.8, mass=80.0)
    upper, fore, hand = arm.bodies
    q = np.array([0.4, 0.1, 0.0, 0.9, 0.0, 0.0, 0.0])
    ends = []
    for body in (upper, fore, hand):
        rotation, position = arm.frame_pose(str(body.link), q)
        ends.append([position + rotation @ np.array(end) for end in (body.start, body.end)])
    assert np.allclose(ends[0][0], 0.0, atol=1e-15)
    assert np.allclose(ends[0][1], ends[1][0], atol=1e-12)
    assert np.allclose(ends[1][1], ends[2][0], atol=1e-12)
    # A cylinder of the segment's mass and density: 0.027 of the mass, 1070 kg/m^3.
    length = np.linalg.norm(np.subtract(upper.end, upper.start))
    assert np.pi * upper.radius**2 * length * 1070.0 == pytest.approx(0.027 * 80.0)
    assert hand.end[2] == pytest.approx(-0.108 * 1.8)
