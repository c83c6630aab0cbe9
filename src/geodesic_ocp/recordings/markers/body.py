"""The body that markers are fitted to: its segments and lengths, and where its thorax is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

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
_SIDES = {"right": "R", "left": "L"}


@dataclass(frozen=True, eq=False)
class Attachment:
    """Where a point is fixed: index of the joint, and rotation and origin of its segment on it.

    Index 0 is the base of the model, -1 the thorax that carries an arm's base.
    """

    joint: int
    rotation: Array
    origin: Array
    length: int | None  # index of the length along which the segment's z axis is scaled


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

    @cached_property
    def to_base(self) -> Array:
        """From the root to the model's base (3,) [m]."""
        if self.lone_side is None:
            return np.zeros(3)
        across = trunk().half_width * float(self.height or 0.0)
        return np.array([across if self.lone_side == "right" else -across, 0.0, 0.0])

    @cached_property
    def lengths(self) -> tuple[str, ...]:
        """Names of the lengths that can be adjusted; the first is the body height."""
        if self.height is None:
            return ()
        found = ["height"]
        if self.lone_side or self.model.pin.existFrame("thorax"):
            found.append("shoulder half width")
        for side, letter in _SIDES.items():
            found += [
                f"{side} {segment}"
                for segment, joint in _LENGTHS.items()
                if self._has(f"{letter}{joint}_joint")
            ]
        return tuple(found)

    @cached_property
    def nominal(self) -> Array:
        """The lengths as the model has them [m]."""
        values = []
        for name in self.lengths:
            side, _, segment = name.partition(" ")
            if name == "height":
                values.append(float(self.height or 0.0))
            elif name == "shoulder half width":
                values.append(abs(float(self._shoulder_offset[0])))
            else:
                joint = joint_index(self.model, f"{_SIDES[side]}{_LENGTHS[segment]}_joint")
                values.append(float(np.linalg.norm(joint_offset(self.model, joint))))
        return np.array(values)

    @property
    def _shoulder_offset(self) -> Array:
        if self.lone_side:
            return self.to_base
        return joint_offset(self.model, joint_index(self.model, "RSx_joint"))

    def _has(self, joint: str) -> bool:
        return bool(self.model.pin.existJointName(joint))

    def factors(self, lengths: ca.SX) -> ca.SX:
        """Factors of the joints' translations (3, n + 1) from those of the lengths."""
        count = self.model.pin.njoints
        if not self.lengths:
            return ca.SX.ones(3, count)
        factors = ca.repmat(lengths[0], 3, count)
        for index, name in enumerate(self.lengths):
            side, _, segment = name.partition(" ")
            if segment in _LENGTHS:
                joint = joint_index(self.model, f"{_SIDES[side]}{_LENGTHS[segment]}_joint")
                factors[:, joint] = lengths[index]
            elif name == "shoulder half width" and not self.lone_side:
                for letter in _SIDES.values():
                    factors[0, joint_index(self.model, f"{letter}Sx_joint")] = lengths[index]
        return factors

    def attachment(self, segment: str) -> Attachment:
        """Where a segment, or a frame or joint of the model, is.

        Raises:
            ValueError: the model has none of that name.
        """
        none, straight = np.zeros(3), np.eye(3)
        side, _, part = segment.partition(" ")
        if self.height is not None:
            if part in _CARRIERS and side in _SIDES:
                joint = f"{_SIDES[side]}{_CARRIERS[part]}_joint"
                if self._has(joint):
                    length = self.lengths.index(segment) if segment in self.lengths else None
                    return Attachment(joint_index(self.model, joint), straight, none, length)
            if segment == "thorax" and self.lone_side:
                return Attachment(-1, straight, none, None)
            if segment == "pelvis" and self._has("BPx_joint"):
                return Attachment(0, straight, none, None)
        if self.model.pin.existFrame(segment):
            joint_number, rotation, origin = frame_place(self.model, segment)
            return Attachment(joint_number, rotation, origin, None)
        raise ValueError(f"the model {self.model.name!r} has no segment or frame {segment!r}")

    def has(self, segment: str) -> bool:
        """Whether markers on this segment can be fitted."""
        try:
            self.attachment(segment)
        except ValueError:
            return False
        return True

    def points(
        self, q: ca.SX, lengths: ca.SX, attachments: list[Attachment], offsets: ca.SX
    ) -> ca.SX:
        """Positions (3, m) [m], relative to the root, of points at offsets (3, m) [m].

        The lengths are relative to those of the model; offsets are those at the model's height.
        """
        factors = self.factors(lengths)
        poses = joint_poses(self.model, q, factors)
        base = ca.SX(self.to_base)
        common = ca.SX(1)
        if self.lengths:
            common = lengths[0]
            if self.lone_side:
                base *= lengths[self.lengths.index("shoulder half width")]
        points = []
        for index, place in enumerate(attachments):
            along = common if place.length is None else lengths[place.length]
            stretch = ca.vertcat(common, common, along)
            own = common * ca.SX(place.origin) + ca.SX(place.rotation) @ (
                stretch * offsets[:, index]
            )
            if place.joint < 0:
                points.append(own)
            else:
                rotation, position = poses[place.joint]
                points.append(base + position + rotation @ own)
        return ca.horzcat(*points)

    def scaled(self, lengths: Array) -> Model:
        """The model with these lengths, relative to those that it has."""
        if not self.lengths or np.all(lengths == 1.0):
            return self.model
        factors = ca.evalf(self.factors(ca.SX(lengths))).full().T
        bodies = np.full(self.model.pin.njoints, lengths[0])
        for index, name in enumerate(self.lengths):
            side, _, segment = name.partition(" ")
            if segment in _LENGTHS:
                joint = f"{_SIDES[side]}{_CARRIERS[segment]}_joint"
                bodies[joint_index(self.model, joint)] = lengths[index]
        return with_lengths(self.model, factors, bodies)


def factors_by_name(body: MarkedBody, lengths: Array) -> Mapping[str, float]:
    """Lengths [m] by name, the body height left out."""
    found = zip(body.lengths, body.nominal * lengths, strict=True)
    return {name: float(value) for name, value in found if name != "height"}
