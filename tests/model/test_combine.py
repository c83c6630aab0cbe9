"""Several models as one system, such as both arms."""

from __future__ import annotations

import numpy as np
import pytest
from known_models import planar_arm
from numpy.testing import assert_allclose

import geodesic_ocp as go

SHOULDERS = [(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)]  # [m]


@pytest.fixture(scope="module")
def arms() -> tuple[go.Model, go.Model]:
    return go.human_arm("left"), go.human_arm("right")


def test_both_arms_move_independently(
    arms: tuple[go.Model, go.Model], rng: np.random.Generator
) -> None:
    both = go.model.combine(*arms, placements=SHOULDERS)
    assert both.dof == 14
    assert both.joint_names == (*arms[0].joint_names, *arms[1].joint_names)
    assert both.name == "human left arm and human right arm"
    assert np.array_equal(both.lower, np.concatenate([arm.lower for arm in arms]))
    q, v = rng.uniform(-1.0, 1.0, (2, 14))
    matrix = np.zeros((14, 14))
    for arm, part, base, side in zip(
        arms, (slice(0, 7), slice(7, 14)), SHOULDERS, ("left", "right"), strict=True
    ):
        matrix[part, part] = arm.mass_matrix(q[part])
        rotation, position = both.with_hand(f"human {side} arm/hand").hand_pose(q)
        expected = arm.hand_pose(q[part])
        assert_allclose(rotation, expected[0], rtol=0, atol=1e-14)
        assert_allclose(position, expected[1] + base, rtol=0, atol=1e-14)
    assert_allclose(both.mass_matrix(q), matrix, rtol=0, atol=1e-12)
    assert both.hand == "human left arm/hand"
    arrival = go.exp(go.KineticEnergy(both), q, v)
    for arm, part in zip(arms, (slice(0, 7), slice(7, 14)), strict=True):
        alone = go.exp(go.KineticEnergy(arm), q[part], v[part])
        assert_allclose(arrival[part], alone, rtol=0, atol=2e-9)  # each to 1e-9


def test_a_rotated_base_rotates_the_hand(arms: tuple[go.Model, go.Model]) -> None:
    rotation_of_base = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    both = go.model.combine(
        *arms, placements=[(rotation_of_base, (1.0, 2.0, 3.0)), (0.0, 0.0, 0.0)]
    )
    q = np.linspace(-0.5, 0.5, 14)
    rotation, position = arms[0].hand_pose(q[:7])
    assert_allclose(both.hand_pose(q)[0], rotation_of_base @ rotation, rtol=0, atol=1e-14)
    assert_allclose(
        both.hand_pose(q)[1], rotation_of_base @ position + [1.0, 2.0, 3.0], rtol=0, atol=1e-14
    )


def test_models_of_one_name_are_numbered() -> None:
    arm = planar_arm((1.0,), (1.0,), (0.5,), (0.1,))
    three = go.model.combine(arm, arm, arm)
    title = "planar arm with 1 links"
    assert three.joint_names == tuple(f"{title} {number}/joint1" for number in (1, 2, 3))
    assert three.with_hand(f"{title} 3/tip").hand_pose([0.0, 0.0, np.pi / 2])[1][1] == 1.0


def test_errors_of_combine(arms: tuple[go.Model, go.Model]) -> None:
    with pytest.raises(ValueError, match="two or more models"):
        go.model.combine(arms[0])
    with pytest.raises(ValueError, match="placements must be one for each of 2 models"):
        go.model.combine(*arms, placements=[(0.0, 0.0, 0.0)])
    with pytest.raises(ValueError, match=r"placements\[1\] must be a rotation"):
        go.model.combine(*arms, placements=[(0, 0, 0), (2 * np.eye(3), (0, 0, 0))])
    with pytest.raises(ValueError, match=r"placements\[0\] must have shape \(3,\)"):
        go.model.combine(*arms, placements=[(0, 0), (0, 0, 0)])
    over = np.diag([1.0, -1.0, -1.0])
    with pytest.raises(ValueError, match="in the common base frame gravity is"):
        go.model.combine(*arms, placements=[(0, 0, 0), (over, (0, 0, 0))])


@pytest.mark.parametrize(
    "placements", [[1, 2], [[], []], [np.eye(4), np.eye(4)], {0: (0, 0, 0)}, "ab"]
)
def test_wrong_placements_are_named(arms: tuple[go.Model, go.Model], placements: object) -> None:
    with pytest.raises(ValueError, match="placements"):
        go.model.combine(*arms, placements=placements)  # type: ignore[arg-type]


def test_combined_models_can_be_combined_again(arms: tuple[go.Model, go.Model]) -> None:
    couple = go.model.combine(go.model.combine(*arms), *arms)
    assert couple.dof == 28
    frames = [frame.name for frame in couple.pin.frames]
    assert len(set(frames)) == len(frames)
    assert len(set(couple.joint_names)) == 28
    grounded = arms[0].with_hand("universe")
    assert go.model.combine(grounded, arms[1]).hand == "universe"


def test_both_arms_keep_their_bodies() -> None:
    arms = go.model.combine(
        go.human_arm("left"), go.human_arm("right"), placements=((-0.2, 0, 0), (0.2, 0, 0))
    )
    links = [body.link for body in arms.bodies]
    assert links == [
        f"{side} {part}" for side in ("left", "right") for part in ("upper arm", "forearm", "hand")
    ]
    hanging = go.distances.signed_distances(arms, np.zeros(14), pairs=[("left hand", "right hand")])
    hand = arms.bodies[2]
    assert hanging["left hand to right hand"] == pytest.approx(0.4 - 2.0 * hand.radius)
    twice = go.model.combine(go.human_arm("left"), go.human_arm("left"))
    assert "human left arm 1/left hand" in {body.link for body in twice.bodies}
