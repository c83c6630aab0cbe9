"""From configurations of a person's arm to poses of a robot's hand."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.settings import RetargetingSettings


@dataclass(frozen=True, eq=False, repr=False)
class PoseMapping:
    """Maps configurations of a person's arm to poses of a robot's hand.

    Attributes:
        model: the person's arm.
        source, target: alignments of the person and of the robot.
        scale: factor of positions.
        mirror: whether left and right are exchanged.
    """

    model: Model
    source: Alignment
    target: Alignment
    scale: float
    mirror: bool

    def __repr__(self) -> str:
        mirrored = ", mirrored" if self.mirror else ""
        return f"PoseMapping(from {self.model.name}, scale {self.scale:.4g}{mirrored})"

    @classmethod
    def between(
        cls, model: Model, source: Alignment, target: Alignment, settings: RetargetingSettings
    ) -> PoseMapping:
        """By default scaled by the ratio of the arms' lengths, and mirrored if the sides differ."""
        mirror, scale = settings.mirror, settings.scale
        if mirror is None:
            mirror = None not in (source.side, target.side) and source.side != target.side
        if scale is None:
            scale = target.length / source.length
        return cls(model, source, target, float(scale), bool(mirror))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Rotations (k, 3, 3) and positions (k, 3) [m] in the robot's base, for q (k, n)."""
        rotation, position = self.source.to_person(*self.model.hand_pose(q))
        return self.target.to_robot(rotation, position, scale=self.scale, mirror=self.mirror)
