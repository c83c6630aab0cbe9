"""Models with several hands."""

from __future__ import annotations

import pytest

import geodesic_ocp as go
from geodesic_ocp.model.model import hand_labels


def test_an_arm_has_one_hand(arm: go.Model) -> None:
    assert arm.hands == ("hand",) == (arm.hand,)
    other = arm.with_hand("right forearm")
    assert other.hands == ("right forearm",) == (other.hand,)


def test_a_combined_model_has_the_hands_of_its_parts_and_one_of_them_is_selected() -> None:
    arms = go.model.combine(go.human_arm("left"), go.human_arm("right"))
    assert arms.hands == ("human left arm/hand", "human right arm/hand")
    right = arms.with_hand("human right arm/hand")
    assert (right.hand, right.hands) == ("human right arm/hand", arms.hands)
    assert arms.with_hand("left forearm").hands == ("left forearm",)
    elbows = arms.with_hand("left forearm", "right forearm")
    assert (elbows.hand, elbows.hands) == ("left forearm", ("left forearm", "right forearm"))
    assert "hand `human left arm/hand`, `human right arm/hand`, mass" in arms._repr_markdown_()
    three = go.model.combine(arms, go.human_arm("right"))
    assert len(three.hands) == 3
    for derived in (arms.with_armature(0.1), arms.with_limits(), arms.with_bodies()):
        assert derived.hands == arms.hands


@pytest.mark.parametrize(
    ("hands", "labels"),
    [
        (["gripper"], ("hand",)),
        (["human left arm/hand", "human right arm/hand"], ("left hand", "right hand")),
        (["right hand", "left hand"], ("right hand", "left hand")),
        (["Right_TCP", "left_TCP"], ("Right_TCP", "left_TCP")),
        (["left_arm/tool", "RIGHT_arm/tool"], ("left tool", "right tool")),
        (["panda 1/hand", "panda 2/hand"], ("panda 1/hand", "panda 2/hand")),
        (["left arm 1/hand", "left arm 2/hand"], ("left arm 1/hand", "left arm 2/hand")),
        (["left and right/hand", "left/hand"], ("left and right/hand", "left hand")),
        (["left forearm", "right forearm"], ("left forearm", "right forearm")),
    ],
)
def test_hands_are_called_by_their_side_or_their_frame(
    hands: list[str], labels: tuple[str, ...]
) -> None:
    assert hand_labels(hands) == labels


def test_wrong_hands_are_named(arm: go.Model) -> None:
    with pytest.raises(ValueError, match="has no frame 'paw'; its frames are universe"):
        go.Model(arm.pin, "hand", hands=("hand", "paw"))
    with pytest.raises(ValueError, match="hands must differ"):
        arm.with_hand("hand", "hand")
    with pytest.raises(ValueError, match="hands must differ and include the hand 'hand', got"):
        go.Model(arm.pin, "hand", hands=("hand", "hand"))
    with pytest.raises(ValueError, match="include the hand 'hand', got right forearm"):
        go.Model(arm.pin, "hand", hands=("right forearm",))
