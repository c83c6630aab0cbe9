"""The human upper body, compared with its reference model and with the arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.anthropometry import trunk

TRUNK, RIGHT, LEFT = slice(0, 6), slice(6, 13), slice(13, 20)


@pytest.fixture(scope="module")
def person() -> go.Model:
    return go.human_upper_body(1.84, 70.0)


def test_it_agrees_with_the_reference_model_whose_other_joints_are_locked(
    person: go.Model, shared: Path, rng: np.random.Generator
) -> None:
    """Up to offsets of the centres of mass of 3e-11 of the height, which are rounding there."""
    file = shared / "data" / "models" / "mmm.xml"
    reference = go.load_model(
        file, hand="Hand R TCP", joints=person.joint_names, height=1.84, mass=70.0
    )
    order = [reference.joint_names.index(name) for name in person.joint_names]
    assert np.array_equal(person.lower, reference.lower[order])
    assert np.array_equal(person.upper, reference.upper[order])
    assert person.mass == pytest.approx(reference.mass, rel=1e-12)
    frames = {
        "right hand": "Hand R TCP",
        "left hand": "Hand L TCP",
        "thorax": "collarSegment_joint",
    }
    for q in rng.uniform(person.lower, person.upper, (5, 20)):
        other = np.empty(20)
        other[order] = q
        expected = reference.mass_matrix(other)[np.ix_(order, order)]
        assert_allclose(person.mass_matrix(q), expected, rtol=0, atol=1e-9 * expected.max())
        for frame, name in frames.items():
            rotation, position = reference.frame_pose(name, other)
            assert_allclose(person.frame_pose(frame, q)[0], rotation, rtol=0, atol=1e-13)
            assert_allclose(person.frame_pose(frame, q)[1], position, rtol=0, atol=1e-13)


def test_an_arm_has_the_metric_of_an_arm_whatever_the_trunk_does(
    person: go.Model, rng: np.random.Generator
) -> None:
    q = rng.uniform(person.lower, person.upper)
    matrix = person.mass_matrix(q)
    for side, part in (("right", RIGHT), ("left", LEFT)):
        alone = go.human_arm(side, 1.84, 70.0).mass_matrix(q[part])
        assert_allclose(matrix[part, part], alone, rtol=0, atol=1e-13)
    assert not matrix[RIGHT, LEFT].any()
    assert np.abs(matrix[TRUNK, RIGHT]).max() > 0.1


def test_upright_the_hands_hang_beside_the_body() -> None:
    person = go.human_upper_body(2.0)
    for side, sign in (("right", 1.0), ("left", -1.0)):
        _, position = person.frame_pose(f"{side} hand", np.zeros(20))
        height = 0.040 + 0.060 + 0.188 - 0.188 - 0.145 - 0.037
        assert position == pytest.approx([sign * 2 * (0.087 + 0.023 - 0.015), 0, 2 * height])
    bow = np.eye(20)[0] * -0.5  # about x, which points to the right: forwards is negative
    assert person.frame_pose("thorax", bow)[1][1] > 0.1


def test_its_mirror_image_is_itself(person: go.Model, rng: np.random.Generator) -> None:
    """Up to slightly different inertias of hands and clavicles."""
    flip = np.array([1, -1, -1] * 2 + [1, -1, -1, 1, -1, 1, -1] * 2)
    order = [*range(6), *range(13, 20), *range(6, 13)]
    q = rng.uniform(person.lower, person.upper)
    mirrored = (flip * q)[order]
    left = person.frame_pose("left hand", mirrored)[1]
    right = person.frame_pose("right hand", q)[1]
    assert left == pytest.approx([-right[0], right[1], right[2]], abs=1e-12)
    expected = (np.outer(flip, flip) * person.mass_matrix(q))[np.ix_(order, order)]
    difference = person.mass_matrix(mirrored) - expected
    assert np.abs(difference).max() < 1e-4 * np.abs(expected).max()


def test_inertias_are_those_of_bodies() -> None:
    """Principal moments obey the triangle inequality: each is at most the sum of the others."""
    segments = trunk()
    for segment in (segments.abdomen, segments.thorax, *segments.on_thorax):
        moments = np.array(segment.inertia)
        assert np.all(moments > 0.0)
        assert np.all(2.0 * moments <= moments.sum())


def test_bodies_move_with_their_links_and_the_hands_with_the_wrists(person: go.Model) -> None:
    names = {"abdomen", "thorax", "head"}
    names |= {f"{side} {part}" for side in ("right", "left") for part in _PARTS}
    assert {body.link for body in person.bodies} == names
    q = np.linspace(-0.2, 0.3, 20)
    ends = {}
    for body in person.bodies:
        rotation, position = person.frame_pose(str(body.link), q)
        assert isinstance(body, go.Capsule)
        ends[body.link] = [position + rotation @ np.array(end) for end in (body.start, body.end)]
    for side in ("right", "left"):
        upper, fore, hand = (ends[f"{side} {part}"] for part in _PARTS)
        assert_allclose(upper[1], fore[0], atol=1e-12)
        assert_allclose(fore[1], hand[0], atol=1e-12)
        assert np.linalg.norm(hand[1] - hand[0]) == pytest.approx(0.108 * 1.84)
    assert_allclose(ends["abdomen"][1], ends["thorax"][0], atol=1e-12)


_PARTS = ("upper arm", "forearm", "hand")


def test_default_joint_inertia_is_that_of_each_limb(person: go.Model) -> None:
    inertia = go.manifold.default_joint_inertia(person)
    for side, part in (("right", RIGHT), ("left", LEFT)):
        alone = go.manifold.default_joint_inertia(go.human_arm(side, 1.84, 70.0))
        assert inertia[part] == pytest.approx(alone, rel=1e-9)
    stretched = 0.06 + np.hypot(0.11, 0.188) + 0.188 + 0.145 + np.hypot(0.015, 0.037)
    assert np.all(inertia[TRUNK] == inertia[0])
    assert 0.9 < inertia[0] / (0.03 * person.mass * (1.84 * stretched) ** 2) <= 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"height": 184.0}, r"is the height in cm\?"),
        ({"mass": 0.0}, "mass must be positive"),
        ({"armature": -1.0}, "armature of joint 'BPx_joint' must be finite and not negative"),
        ({"armature": {"BNx_joint": 1.0}}, "'BNx_joint' is not one of the joints"),
    ],
)
def test_implausible_arguments_are_rejected(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.human_upper_body(**arguments)
