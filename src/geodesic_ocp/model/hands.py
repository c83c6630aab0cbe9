"""The hands (end-effectors) of a model, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin

_SIDES = ("right", "left")


def as_hands(model: pin.Model, hand: str, hands: Sequence[str]) -> tuple[str, ...]:
    """Names of the hand frames, `hand` alone if there are no others.

    Raises:
        ValueError: one of them is no frame of the model or occurs twice, or `hand` is missing.
    """
    names = (hand,) if isinstance(hands, str) or not hands else tuple(hands)
    for name in (hand, *names):
        if not isinstance(name, str) or not model.existFrame(name):
            known = ", ".join(frame.name for frame in model.frames)
            raise ValueError(f"the model has no frame {name!r}; its frames are {known}")
    if hand not in names or len(set(names)) < len(names):
        raise ValueError(f"hands must differ and include the hand {hand!r}, got {', '.join(names)}")
    return names


def hand_labels(hands: Sequence[str]) -> tuple[str, ...]:
    """Names of the hands for tables and figures.

    A single one is "hand". Several are called as their frames; where `combine` has put the name of
    an arm before that of the frame, as in "human left arm/hand", its side takes that place.

    >>> from geodesic_ocp.model.hands import hand_labels
    >>> hand_labels(["human left arm/hand", "human right arm/hand"])
    ('left hand', 'right hand')
    """
    if len(hands) == 1:
        return ("hand",)
    labels = []
    for name in hands:
        arm, _, frame = name.rpartition("/")
        sides = [side for side in _SIDES if side in arm.lower().replace("_", " ").split()]
        labels.append(f"{sides[0]} {frame}" if len(sides) == 1 else name)
    return tuple(labels) if len(set(labels)) == len(hands) else tuple(hands)
