"""SegmentOrientations: how the segments of a person are oriented over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.frame_motion import FrameMotion
from geodesic_ocp.trajectory.motion import Subject

#: Names of the segments; those of the arms begin with "right" or "left".
SEGMENTS = (
    "pelvis",
    "abdomen",
    "thorax",
    "right upper arm",
    "right forearm",
    "right hand",
    "left upper arm",
    "left forearm",
    "left hand",
)


@dataclass(frozen=True, eq=False, repr=False)
class SegmentOrientations:
    """Orientations of a person's segments over time, which every joint convention leads to.

    The axes of every segment are those of `human_arm`: when the person stands upright, with the
    arms hanging and the palms towards the body, all segments have x to the person's right, y
    forward and z up. The orientation of the forearm is that of its distal end at the wrist, so
    that it turns with the palm.

    Attributes:
        time: increasing times (k,) [s].
        rotations: by segment, from its axes to a space with z up, (k, 3, 3); a segment that the
            recording does not have is left out.
        trunk: pose of the thorax in that space, its origin midway between the shoulders; None if
            its position is not recorded.
        subject: the recorded person.
    """

    time: Array
    rotations: Mapping[str, Array]
    trunk: FrameMotion | None = None
    subject: Subject = field(default_factory=Subject)
