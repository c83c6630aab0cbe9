"""The body that markers are fitted to: its segments and lengths, and where its thorax is."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.adjustable_lengths import (
    frame_place,
    joint_index,
    joint_offset,
    joint_poses,
    with_lengths,
)
from geodesic_ocp.model.anthropometry import trunk
from geodesic_ocp.model.human import stature
from geodesic_ocp.model.model import Model

# Joints that carry the segments of a person, by the first letter of the side.
_CARRIERS = {"upper arm": "Sy", "elbow": "Ex", "forearm": "Ez", "hand": "Wy"}
_LENGTHS = {"upper arm": "Ex", "forearm": "Wx"}
SHOULDERS = "shoulder half width"
_SIDES = {"right": "R", "left": "L"}
_TRUNK = ("thorax", "abdomen", "pelvis", "trunk", "right shoulder", "left shoulder")


def on_trunk(segment: str) -> bool:
    """Return whether this is a segment of a person's trunk, shoulders included."""
    return segment in _TRUNK


def is_segment(name: str) -> bool:
    """Return whether this is the name of a person's segment, of either side."""
    side, _, part = name.partition(" ")
    return on_trunk(name) or (side in _SIDES and part in _CARRIERS)


@dataclass(frozen=True, eq=False)
class Attachment:
    """Place of a point on a body: its joint's index, its segment's rotation and origin.

    Index 0 is the base of the model, -1 the thorax that carries an arm's base.
    """

    joint: int
    rotation: Array = field(default_factory=lambda: np.eye(3))
    origin: Array = field(default_factory=lambda: np.zeros(3))
    length: int | None = None  # index of the length along which the segment's z axis is scaled
    # sides of the shoulder's half width by which the point is moved along x: 1, -1 or 0
    across: float = 0.0


def _above_pelvis() -> float:
    """Return height of the shoulders above the pelvis' origin, as a fraction of body height."""
    segments = trunk()
    return segments.pelvis + segments.abdomen.length + segments.thorax.length


@dataclass(frozen=True, eq=False)
class MarkedBody:
    """A model with lengths that can be adjusted, whose root is fixed or moves.

    The root is the thorax (its origin midway between the shoulders) if the model is a single arm
    of a person, else the model's base.
    """

    model: Model

    @cached_property
    def height(self) -> float | None:
        """Body height [m] to which a person's model is scaled; None for other models."""
        return stature(self.model)

    @cached_property
    def lone_side(self) -> str | None:
        """Side of the arm, "right" or "left", if the model is one arm of a person."""
        if self.height is None or self.model.pin.existFrame("thorax"):
            return None
        found = [side for side, letter in _SIDES.items() if self._has(f"{letter}Sx_joint")]
        return found[0] if len(found) == 1 else None

    def base(self, lengths: Any) -> Any:
        """Return the vector from the root to the model's base (3,) [m], for relative lengths."""
        if self.lone_side is None or self.height is None:
            return np.zeros(3)
        across = trunk().half_width * self.height * (1.0 if self.lone_side == "right" else -1.0)
        return np.array([across, 0.0, 0.0]) * lengths[1]

    @cached_property
    def _limbs(self) -> dict[str, int]:
        """Joints at the far ends of the segments whose lengths can be adjusted."""
        every = itertools.product(_SIDES.items(), _LENGTHS.items())
        return {
            f"{side} {segment}": joint_index(self.model, f"{letter}{joint}_joint")
            for (side, letter), (segment, joint) in every
            if self._has(f"{letter}{joint}_joint")
        }

    @cached_property
    def lengths(self) -> tuple[str, ...]:
        """Names of the lengths that can be adjusted; the first is the body height."""
        if self.height is None:
            return ()
        shoulders = [SHOULDERS] if self.lone_side or self.model.pin.existFrame("thorax") else []
        return ("height", *shoulders, *self._limbs)

    @cached_property
    def nominal(self) -> Array:
        """The lengths as the model has them [m]."""
        if self.height is None:
            return np.zeros(0)
        shoulder = [self.base(np.ones(2))] if self.lone_side else []
        if self.model.pin.existFrame("thorax"):
            shoulder = [joint_offset(self.model, joint_index(self.model, "RSx_joint"))]
        limbs = (joint_offset(self.model, joint) for joint in self._limbs.values())
        lengths = (np.linalg.norm(each) for each in limbs)
        return np.array([self.height, *(abs(each[0]) for each in shoulder), *lengths])

    def _has(self, joint: str) -> bool:
        return bool(self.model.pin.existJointName(joint))

    def factors(self, lengths: ca.SX) -> ca.SX:
        """Return factors of the joints' translations (3, n + 1) from those of the lengths."""
        count = self.model.pin.njoints
        if not self.lengths:
            return ca.SX.ones(3, count)
        factors = ca.repmat(lengths[0], 3, count)
        for name, joint in self._limbs.items():
            factors[:, joint] = lengths[self.lengths.index(name)]
        if SHOULDERS in self.lengths and not self.lone_side:
            for letter in _SIDES.values():
                factors[0, joint_index(self.model, f"{letter}Sx_joint")] = lengths[1]
        return factors

    def attachment(self, segment: str) -> Attachment:
        """Return the place of a segment, or of a frame or joint of the model.

        Raises:
            ValueError: the model has none of that name.
        """
        side, _, part = segment.partition(" ")
        joint = f"{_SIDES.get(side)}{_CARRIERS.get(part)}_joint"
        if self.height is not None:
            if self._has(joint):
                length = self.lengths.index(segment) if segment in self.lengths else None
                return Attachment(joint_index(self.model, joint), length=length)
            if part == "shoulder" and self._has(f"{_SIDES.get(side)}Sx_joint"):
                return Attachment(joint_index(self.model, f"{_SIDES[side]}Sx_joint"))
            if self.lone_side and segment in ("thorax", "trunk", "right shoulder", "left shoulder"):
                below = np.array([0.0, 0.0, -_above_pelvis() * self.height])
                return Attachment(
                    joint=-1,
                    origin=below if segment == "trunk" else np.zeros(3),
                    across=-1.0 if part == "shoulder" else 0.0,
                )
            if segment in ("pelvis", "trunk") and self._has("BPx_joint"):
                return Attachment(0)
        if self.model.pin.existFrame(segment):
            return Attachment(*frame_place(self.model, segment))
        raise ValueError(f"the model {self.model.name!r} has no segment or frame {segment!r}")

    def has(self, segment: str) -> bool:
        """Return whether markers on this segment can be fitted."""
        try:
            self.attachment(segment)
        except ValueError:
            return False
        return True

    def stretch(self, place: Attachment, lengths: Any) -> list[Any]:
        """Get factors of the three components of offsets there; lengths relative to the model's."""
        common = lengths[0] if self.lengths else 1.0
        return [common, common, common if place.length is None else lengths[place.length]]

    def points(
        self, q: ca.SX, lengths: ca.SX, attachments: list[Attachment], offsets: ca.SX
    ) -> ca.SX:
        """Return positions (3, m) [m], relative to the root, of points at offsets (3, m) [m].

        The lengths are relative to those of the model; offsets are those at the model's height.
        """
        poses = joint_poses(self.model, q, self.factors(lengths))
        base = self.base(lengths)
        points = []
        for place, offset in zip(attachments, ca.horzsplit(offsets), strict=True):
            common, *_ = stretch = self.stretch(place, lengths)
            own = ca.SX(place.rotation) @ (ca.vertcat(*stretch) * offset) + common * place.origin
            own += place.across * base
            if place.joint >= 0:
                rotation, position = poses[place.joint]
                own = base + position + rotation @ own
            points.append(own)
        positions: ca.SX = ca.horzcat(*points)
        return positions

    def trunk_points(self, segments: Sequence[str], offsets: Array) -> Array:
        """Return positions (m, 3) [m] of points at offsets (m, 3) [m] of a person who stands
        upright.

        Args:
            segments: segments of the trunk that they are fixed to.
        """
        places = [self.attachment(segment) for segment in segments]
        lengths = ca.SX.ones(max(1, len(self.lengths)))
        points = self.points(ca.SX(self.model.dof, 1), lengths, places, ca.SX(offsets.T))
        return np.asarray(ca.evalf(points).full().T)

    def scaled(self, lengths: Array) -> Model:
        """Return the model with these lengths, relative to those that it has."""
        if not self.lengths or np.all(lengths == 1.0):
            return self.model
        factors = ca.evalf(self.factors(ca.SX(lengths))).full().T
        bodies = np.full(self.model.pin.njoints, lengths[0])
        for name in self._limbs:
            bodies[self.attachment(name).joint] = lengths[self.lengths.index(name)]
        return with_lengths(self.model, factors, bodies)
