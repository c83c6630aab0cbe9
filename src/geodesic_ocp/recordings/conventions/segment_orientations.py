"""How the segments of a person are oriented over time, and the joint angles of arms and trunk.

With the upper arm U, the forearm F and the hand H relative to the thorax, and the joints of
`human_arm`,

    U = Rx(Sx) Rz(Sz) Ry(Sy),  H = U Rx(Ex) Rz(Ez) Rx(Wx) Ry(Wy).

Seven angles give the direction of the upper arm, that of the forearm and the orientation of the
hand, so that these are what is reproduced: the elbow and the forearm of another convention, which
may have a carrying angle, have one more angle than Rx(Ex) Rz(Ez). The axial rotation of the upper
arm is the one that brings the forearm into the plane in which the elbow flexes; at the extended
elbow, where the forearm has no such plane, it passes smoothly to the axial rotation of the recorded
upper arm, turned by the mean angle between the two where the elbow is flexed. There the forearm's
direction is not exact; the hand's orientation always is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy

from geodesic_ocp.arrays import Array, settle
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.conventions.continuous_angles import axis_rotation, continuous_angles
from geodesic_ocp.trajectory.motion import FrameMotion, Motion, Subject

ARM_JOINTS = ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")  # after R or L, before _joint
TRUNK_JOINTS = ("BPx", "BPz", "BPy", "BTx", "BTz", "BTy")  # before _joint
SIDES: tuple[Literal["right", "left"], ...] = ("right", "left")

TRUNK = ("pelvis", "abdomen", "thorax")
ARM = ("upper arm", "forearm", "hand")  # after a side
#: Names of the segments; those of the arms begin with "right" or "left".
SEGMENTS = (*TRUNK, *(f"{side} {part}" for side in SIDES for part in ARM))


@dataclass(frozen=True, eq=False, repr=False)
class SegmentOrientations:
    """Orientations of a person's segments over time, to which all joint conventions are converted.

    The axes of every segment are those of `human_arm`: when the person stands upright, with the
    arms hanging and the palms towards the body, all segments have x to the person's right, y
    forward and z up. The orientation of the forearm is that of its distal end at the wrist, so
    that it turns with the palm.

    Attributes:
        time: increasing times (k,) [s].
        rotations: rotations by segment, from its axes to a space with z up, (k, 3, 3); a segment
            that the recording does not have is left out.
        trunk: pose of the thorax in that space, its origin midway between the shoulders; None if
            its position is not recorded.
        subject: the recorded person.
        left_out: why other segments are left out, by segment, where the recording says so.

    Raises:
        ValueError: an unknown segment, shapes that do not match, values that are not finite, a
            matrix that is not a rotation, or time that does not increase.
    """

    time: Array
    rotations: Mapping[str, Array]
    trunk: FrameMotion | None = None
    subject: Subject = field(default_factory=Subject)
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        empty = np.zeros((np.size(self.time), 0))
        time = Motion(self.time, empty, (), trunk=self.trunk).time
        checked = {}
        for name, given in self.rotations.items():
            if name not in SEGMENTS:
                raise ValueError(f"there is no segment {name!r}; there are {', '.join(SEGMENTS)}")
            if np.shape(given) != (time.size, 3, 3):
                raise ValueError(
                    f"rotations of the {name} must have shape ({time.size}, 3, 3), got "
                    f"{np.shape(given)}"
                )
            try:
                checked[name] = FrameMotion(given, np.zeros((time.size, 3))).rotations
            except ValueError as failure:
                raise ValueError(f"{name}: {failure}") from None
        settle(self, time=time)
        settle(self, rotations=checked)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        names = ", ".join(self.rotations)
        return f"SegmentOrientations({len(self)} samples of {names or 'no segment'})"


def _needs() -> dict[str, tuple[str, ...]]:
    needs: dict[str, tuple[str, ...]] = {}
    for joint in TRUNK_JOINTS:
        needs[f"{joint}_joint"] = ("pelvis", "thorax")
    for side in SIDES:
        upper, forearm, hand = (f"{side} {name}" for name in ("upper arm", "forearm", "hand"))
        segments = {"S": ("thorax", upper), "E": (upper, forearm), "W": (upper, forearm, hand)}
        for joint in ARM_JOINTS:
            needs[f"{side[0].upper()}{joint}_joint"] = segments[joint[0]]
    return needs


#: Segments that each joint needs.
JOINTS = _needs()

# Sine of the elbow's flexion below which the recorded axial rotation of the upper arm counts, and
# its weight at full extension: both so that elbows extended beyond 0 by up to 15 degrees stay so.
_NEARLY_EXTENDED = 0.5
_AXIAL_WEIGHT = 0.5


def joint_angles(orientations: SegmentOrientations, joints: Sequence[str] | None = None) -> Motion:
    """Return the joint angles of arms and trunk with these orientations of the segments.

    The shoulders' angles are relative to the thorax. Trunk: pelvis to abdomen is BPx, BPz, BPy,
    abdomen to thorax BTx, BTz, BTy; without the abdomen's orientation each takes half of the
    rotation from pelvis to thorax. No angle is moved into a joint's limits, and none jumps by a
    branch: every sample continues the one before, and the first is within the limits where it can.

    >>> from scipy.spatial.transform import Rotation
    >>> bent = Rotation.from_euler("x", [[0.0], [0.5]]).as_matrix()
    >>> still = np.tile(np.eye(3), (2, 1, 1))
    >>> segments = {"thorax": still, "right upper arm": still, "right forearm": bent}
    >>> orientations = go.recordings.SegmentOrientations([0.0, 1.0], segments)
    >>> go.recordings.joint_angles(orientations, ["REx_joint"]).q[1].round(6).tolist()
    [0.5]

    Args:
        orientations: orientations of the segments; the elbow needs upper arm and forearm, the wrist
            also the hand.
        joints: names of the joints, such as RSx_joint, LWy_joint or BTz_joint, in the order of the
            result; all that the segments give by default.

    Raises:
        RecordingError: a joint is not one of these, or a segment that it needs is missing.
    """
    segments = orientations.rotations
    lacking = {name: [each for each in JOINTS[name] if each not in segments] for name in JOINTS}
    wanted = [name for name, gap in lacking.items() if not gap] if joints is None else list(joints)
    if not wanted:
        raise RecordingError(
            "no joint of arms or trunk follows from the segments "
            f"{', '.join(segments) or '(none)'}{_reasons(orientations, orientations.left_out)}"
        )
    if unknown := [name for name in wanted if name not in JOINTS]:
        raise RecordingError(
            f"there is no joint {', '.join(unknown)}; segments give {', '.join(JOINTS)}"
        )
    if missing := dict.fromkeys(segment for name in wanted for segment in lacking[name]):
        raise RecordingError(
            f"{', '.join(name for name in wanted if lacking[name])}: the recording has no "
            f"orientation of {', '.join(missing)}; it has {', '.join(segments)}"
            f"{_reasons(orientations, missing)}"
        )
    columns = _trunk_angles(orientations)
    for side in SIDES:
        columns |= _arm_angles(orientations, side)
    return Motion(
        orientations.time,
        np.column_stack([columns[name] for name in wanted]),
        tuple(wanted),
        subject=orientations.subject,
        trunk=orientations.trunk,
    )


def _reasons(orientations: SegmentOrientations, segments: Iterable[str]) -> str:
    """Return why segments are left out, as the end of a message."""
    reasons = orientations.left_out
    return "".join(f"; {name}: {reasons[name]}" for name in segments if name in reasons)


def _relative(orientations: SegmentOrientations, parent: str, child: str) -> Array:
    rotations = orientations.rotations
    result: Array = np.swapaxes(rotations[parent], 1, 2) @ rotations[child]
    return result


def _trunk_angles(orientations: SegmentOrientations) -> dict[str, Array]:
    rotations = orientations.rotations
    if not {"pelvis", "thorax"} <= set(rotations):
        return {}
    if "abdomen" in rotations:
        lower = _relative(orientations, "pelvis", "abdomen")
        upper = _relative(orientations, "abdomen", "thorax")
    else:
        rotation = scipy.spatial.transform.Rotation
        whole = rotation.from_matrix(_relative(orientations, "pelvis", "thorax"))
        lower = upper = rotation.from_rotvec(0.5 * whole.as_rotvec()).as_matrix()
    angles = np.hstack([continuous_angles(part, "xzy") for part in (lower, upper)])
    return {f"{name}_joint": column for name, column in zip(TRUNK_JOINTS, angles.T, strict=True)}


def _arm_angles(
    orientations: SegmentOrientations, side: Literal["right", "left"]
) -> dict[str, Array]:
    rotations = orientations.rotations
    names = [f"{side[0].upper()}{joint}_joint" for joint in ARM_JOINTS]
    if f"{side} upper arm" not in rotations:
        return {}
    arm = human_arm(side)
    angles: dict[str, Array] = {}
    upper = rotations[f"{side} upper arm"]
    if f"{side} forearm" in rotations:
        forearm = _relative(orientations, f"{side} upper arm", f"{side} forearm")
        axial = axis_rotation("z", _axial_rotation(forearm[:, :, 2]))
        upper = upper @ axial
        forearm = np.swapaxes(axial, 1, 2) @ forearm
        flexion = np.unwrap(np.arctan2(-forearm[:, 1, 2], forearm[:, 2, 2]))
        elbow = upper @ axis_rotation("x", flexion)
        angles[names[3]] = flexion
        if f"{side} hand" in rotations:
            hand = np.swapaxes(elbow, 1, 2) @ rotations[f"{side} hand"]
            limits = arm.lower[4:], arm.upper[4:]
            angles |= zip(names[4:], continuous_angles(hand, "zxy", *limits).T, strict=True)
        else:
            turned = np.swapaxes(elbow, 1, 2) @ rotations[f"{side} forearm"]
            twist = np.arctan2(turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1])
            angles[names[4]] = np.unwrap(twist)
    if "thorax" in rotations:
        shoulder = np.swapaxes(rotations["thorax"], 1, 2) @ upper
        limits = arm.lower[:3], arm.upper[:3]
        angles |= zip(names[:3], continuous_angles(shoulder, "xzy", *limits).T, strict=True)
    return angles


def _axial_rotation(direction: Array) -> Array:
    """Return angles (k,) about the upper arm's z axis that bring the forearm into the plane of
    flexion.

    `direction` (k, 3) is the forearm's z axis in axes of the recorded upper arm; with the elbow
    flexed by e in the plane it is (0, -sin e, cos e).
    """
    x, y, z = direction.T
    flexed = np.maximum(0.0, x**2 + y**2 - _NEARLY_EXTENDED**2)
    usual = float(np.arctan2(np.sum(flexed * x), 0.0 - np.sum(flexed * y)))
    x, y = np.cos(usual) * x + np.sin(usual) * y, np.cos(usual) * y - np.sin(usual) * x
    extended = 1.0 - np.minimum(1.0, (x**2 + y**2) / _NEARLY_EXTENDED**2)
    weight = np.where(z > 0.0, _AXIAL_WEIGHT * extended**2, 0.0)
    result: Array = usual + np.arctan2(x, weight - y)
    return result
