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

    A single one is "hand". Several are "right hand" and "left hand" where the names of their frames
    tell the sides, as in "human left arm/hand"; otherwise they are called as their frames.

    >>> from geodesic_ocp.model.hands import hand_labels
    >>> hand_labels(["human left arm/hand", "human right arm/hand"])
    ('left hand', 'right hand')
    """
    if len(hands) == 1:
        return ("hand",)
    words = [name.replace("/", " ").replace("_", " ").lower().split() for name in hands]
    sides = [[side for side in _SIDES if side in each] for each in words]
    known = all(len(side) == 1 for side in sides) and len({*map(tuple, sides)}) == len(hands)
    return tuple(f"{side} hand" for (side,) in sides) if known else tuple(hands)
