"""Models of a person: the right or left arm, and the upper body.

Kinematic chains, joint limits, tool centre points and inertias are those of the reference model of
the Master Motor Map (Terlemez et al., "Master Motor Map (MMM): framework and toolkit for capturing,
representing, and reproducing human motion on humanoid robots", Humanoids 2014).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.anthropometry import (
    Segment,
    Sex,
    Side,
    TableName,
    anthropometry,
    trunk,
)
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

DEFAULT_HEIGHT = 1.75  # [m], [kg]
DEFAULT_MASS = 70.0  # [m], [kg]
_MAX_HEIGHT = 3.0  # [m], [kg]: larger values are probably in other units
_MAX_MASS = 1000.0  # [m], [kg]: larger values are probably in other units
_TOOL_CENTRE = {"right": (-0.015, 0.0, -0.037), "left": (0.015, 0.0, -0.037)}  # [height]
# Winter, Biomechanics and Motor Control of Human Movement, table of densities; those of the trunk:
# abdomen and pelvis, thorax, head and neck.
_DENSITY = {  # [kg/m^3]
    **{"upper arm": 1070.0, "forearm": 1130.0, "hand": 1160.0},
    **{"abdomen": 1010.0, "thorax": 920.0, "head": 1110.0},
}
_JOINTS = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
_JOINTS_BEFORE = {"upper arm": ("Sx", "Sz", "Sy"), "forearm": ("Ex", "Ez"), "hand": ("Wx", "Wy")}
_LIMITS = {  # [rad]
    "RSx": (-1.22173, 3.31613),
    "RSz": (-1.0472, 1.22173),
    "RSy": (-2.79253, 0.0),
    "REx": (0.0, 2.79253),
    "REz": (-1.5708, 1.5708),
    "RWx": (-0.523599, 0.349066),
    "RWy": (-1.5708, 1.22173),
    "BPx": (-0.872665, 0.610865),
    "BPz": (-0.785398, 0.785398),
    "BPy": (-0.349066, 0.349066),
    "BTx": (-0.610865, 0.471239),
    "BTz": (-0.628319, 0.628319),
    "BTy": (-0.349066, 0.349066),
}
_LIMITS |= {  # those of the left arm are mirrored
    f"L{joint[1:]}": (low, high) if joint.endswith("x") else (0.0 - high, 0.0 - low)
    for joint, (low, high) in _LIMITS.items()
    if joint.startswith("R")
}
# The proportions of the tables differ by more than a hundredth from each other only in part: the
# nearest table is taken.
_TABLES = (("winter", None), ("de_leva", "male"), ("de_leva", "female"))


def as_stature(height: float, mass: float) -> tuple[float, float]:
    """Return body height [m] and mass [kg] as floats; ValueError if they are not plausible."""
    height = as_positive("height", height, "m")
    mass = as_positive("mass", mass, "kg")
    if height > _MAX_HEIGHT or mass > _MAX_MASS:
        allowed = f"height and mass must be at most {_MAX_HEIGHT:g} m and {_MAX_MASS:g} kg"
        hint = "; is the height in cm?" if 50.0 < height < 100.0 * _MAX_HEIGHT else ""
        raise ValueError(f"{allowed}, got {height:g} m and {mass:g} kg{hint}")
    return height, mass


def human_arm(
    side: Side = "right",
    height: float = DEFAULT_HEIGHT,
    mass: float = DEFAULT_MASS,
    *,
    table: TableName = "winter",
    sex: Sex | None = None,
    armature: ArrayLike | Mapping[str, float] = 0.0,
    backend: str | None = None,
) -> Model:
    """Return a human arm with shoulder (x, z, y), elbow (x, z) and wrist (x, y).

    The base frame is at the shoulder: x to the person's right, y forward, z up; at q = 0 the arm
    hangs down with the palm towards the body. The hand (end-effector) frame "hand" is at the tool
    centre point. Collision bodies are capsules along the links "right upper arm", "right forearm"
    and "right hand" (or left), with the radius of a cylinder of the segment's mass and density.

    >>> arm = go.human_arm("right", height=1.8, mass=80.0)
    >>> arm.dof, round(arm.mass, 2)
    (7, 3.92)
    >>> arm.hand_pose([0.0, 0.0, 0.0, 1.57, 0.0, 0.0, 0.0])[1].round(2)  # elbow flexed by 90 deg
    array([-0.03,  0.33, -0.34])

    Args:
        side: "right" or "left"; joints are named as in MMM files (RSx_joint, ..., LWy_joint).
        height: body height [m]; lengths scale with it, inertias with its square.
        mass: body mass [kg]; without armature it scales the metric and does not change geodesics.
        table: lengths, masses and inertias of the Master Motor Map ("winter") or of de Leva
            ("de_leva").
        sex: "male" or "female", for the table "de_leva" only.
        armature: joint inertia [kg m^2], as for `Model.with_armature`: one number, 7 numbers, or
            some by joint name. It is not scaled with height and mass.
        backend: back end of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: an unknown side, table or sex; height or mass not positive, or above 3 m or
            1000 kg; an armature that `Model.with_armature` rejects.
    """
    if side not in get_args(Side):
        raise ValueError(f"side must be 'right' or 'left', got {side!r}")
    height, mass = as_stature(height, mass)
    segments = anthropometry(side, table, sex)

    arm = pin.Model()
    arm.name = f"human {side} arm"
    bodies = _add_arm(arm, 0, pin.SE3.Identity(), side, segments, height, mass)
    return Model(arm, "hand", backend, shapes=bodies).with_armature(armature)


def _add_arm(
    model: pin.Model,
    parent: int,
    shoulder: pin.SE3,
    side: Side,
    segments: Sequence[Segment],
    height: float,
    mass: float,
    hand: str = "hand",
) -> tuple[Capsule, ...]:
    """Add an arm to a joint of a model; returns its capsules.

    Args:
        model: is changed.
        parent: index of the joint.
        shoulder: its pose in the joint's frame.
        side: "right" or "left".
        segments: upper arm, forearm and hand, per unit of body height and mass.
        height, mass: body height [m] and mass [kg].
        hand: name of the frame at the tool centre point. If it is also that of the link, as "right
            hand" is, there is no frame of the link at the wrist.
    """
    tool = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), height * np.array(_TOOL_CENTRE[side]))
    bodies = []
    links = []
    placement = shoulder
    for (name, joints), segment in zip(_JOINTS_BEFORE.items(), segments, strict=True):
        for joint in joints:
            parent = _add_joint(model, parent, placement, f"{side[0].upper()}{joint}")
            placement = pin.SE3.Identity()
        model.appendBodyToJoint(parent, _inertia(segment, height, mass), placement)
        link = f"{side} {name}"
        tip = np.array([0.0, 0.0, -segment.length * height])
        frame = tool if link == hand else placement
        if link != hand:
            links.append(pin.Frame(link, parent, frame, pin.FrameType.BODY))
        start, end = (frame.actInv(point) for point in (np.zeros(3), tip))
        radius = _cylinder_radius(segment.mass * mass, name, segment.length * height)
        bodies.append(Capsule(start, end, radius, link))
        placement = pin.SE3(np.eye(3), tip)
    for frame in (pin.Frame(hand, parent, tool, pin.FrameType.OP_FRAME), *links):
        model.addFrame(frame)
    return tuple(bodies)


def _add_joint(model: pin.Model, parent: int, placement: pin.SE3, name: str) -> int:
    """Add a joint of `_LIMITS` with its frame; returns its index."""
    lower, upper = (np.array([limit]) for limit in _LIMITS[name])
    free = np.array([np.inf])
    joint = _JOINTS[name[2]]()
    name = f"{name}_joint"
    index = int(model.addJoint(parent, joint, placement, name, free, free, lower, upper))
    model.addJointFrame(index)
    return index


def _inertia(segment: Segment, height: float, mass: float) -> pin.Inertia:
    """Return the inertia of a segment of a person of this height [m] and mass [kg]."""
    moments = mass * height**2 * np.diag(segment.inertia)
    return pin.Inertia(mass * segment.mass, height * np.array(segment.centre), moments)


def _cylinder_radius(mass: float, name: str, length: float) -> float:
    """Return radius [m] of a cylinder of this mass [kg] and length [m] with the density of a
    segment.
    """
    return float(np.sqrt(mass / _DENSITY[name] / (np.pi * length)))


def human_upper_body(
    height: float = DEFAULT_HEIGHT,
    mass: float = DEFAULT_MASS,
    *,
    armature: ArrayLike | Mapping[str, float] = 0.0,
    backend: str | None = None,
) -> Model:
    """Return a human trunk with six degrees of freedom and both arms with seven each.

    The base frame is at the pelvis: x to the person's right, y forward, z up; at q = 0 the person
    stands upright, and the arms hang down with the palms towards the body. The lumbar joint BP
    (rotations about x, z and y) connects pelvis and abdomen, the thoracic joint BT abdomen and
    thorax; the arms are those of `human_arm`. Neck, head and clavicles are fixed to the thorax,
    with their inertia. The hands are the frames "right hand" and "left hand" at the tool centre
    points; `Model.hand` is the right one. "thorax" is the frame midway between the shoulders.
    The pelvis is at rest: kinetic energy and poses are those relative to it.

    >>> person = go.human_upper_body(height=1.8, mass=80.0)
    >>> person.dof, person.hands, round(person.mass, 2)
    (20, ('right hand', 'left hand'), 40.32)
    >>> person.joint_names[:6]
    ('BPx_joint', 'BPz_joint', 'BPy_joint', 'BTx_joint', 'BTz_joint', 'BTy_joint')

    Collision bodies are capsules along the links "abdomen", "thorax" and "head" and those of the
    arms, with the radius of a cylinder of the segment's mass and density.

    Args:
        height: body height [m]; lengths scale with it, inertias with its square.
        mass: body mass [kg]; without armature it scales the metric and does not change geodesics.
        armature: joint inertia [kg m^2], as for `Model.with_armature`: one number, 20 numbers, or
            some by joint name. It is not scaled with height and mass.
        backend: back end of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: height or mass not positive, or above 3 m or 1000 kg; an armature that
            `Model.with_armature` rejects.
    """
    height, mass = as_stature(height, mass)
    segments = trunk()
    person = pin.Model()
    person.name = "human upper body"

    def above(distance: float) -> pin.SE3:
        return pin.SE3(np.eye(3), np.array([0.0, 0.0, distance * height]))

    joints = [0]
    for name, distance in (("BP", segments.pelvis), ("BT", segments.abdomen.length)):
        for axis, offset in (("x", distance), ("z", 0.0), ("y", 0.0)):
            joints.append(_add_joint(person, joints[-1], above(offset), f"{name}{axis}"))
    lumbar = joints[3]
    thoracic = joints[6]
    fixed = (segments.thorax, *segments.on_thorax)
    for joint, segment in ((lumbar, segments.abdomen), *((thoracic, each) for each in fixed)):
        person.appendBodyToJoint(joint, _inertia(segment, height, mass), pin.SE3.Identity())

    collar = above(segments.thorax.length)
    head = segments.on_thorax[-1]
    spans = (  # link, its joint and frame, its mass, from and to where [height]
        ("abdomen", lumbar, above(0.0), segments.abdomen, 0.0, segments.abdomen.length),
        ("thorax", thoracic, collar, segments.thorax, -segments.thorax.length, 0.0),
        ("head", thoracic, collar, head, *segments.head),
    )
    bodies = []
    for link, joint, frame, segment, low, high in spans:
        person.addFrame(pin.Frame(link, joint, frame, pin.FrameType.BODY))
        radius = _cylinder_radius(segment.mass * mass, link, (high - low) * height)
        bodies.append(Capsule((0.0, 0.0, low * height), (0.0, 0.0, high * height), radius, link))
    hands = []
    for side in get_args(Side):
        across = segments.half_width * height * (1.0 if side == "right" else -1.0)
        shoulder = pin.SE3(np.eye(3), collar.translation + np.array([across, 0.0, 0.0]))
        arm = anthropometry(side, "winter", None)
        hands.append(f"{side} hand")
        bodies += _add_arm(person, thoracic, shoulder, side, arm, height, mass, hands[-1])
    model = Model(person, hands[0], backend, shapes=tuple(bodies), hands=tuple(hands))
    return model.with_armature(armature)


def both_arms(arms: Sequence[Model], height: float) -> Model:
    """Return the right and the left arm of a person of this height [m], the base between them."""
    across = trunk().half_width * height
    return combine(*arms, placements=[(across, 0.0, 0.0), (-across, 0.0, 0.0)])


def stature(model: Model) -> float | None:
    """Return body height [m] of a model with the joints of `human_arm`; None for other models.

    It is read from the lengths of upper arm and forearm, by the anthropometric table whose
    proportion of the two is nearest.
    """
    for side in "RL":
        names = [f"{joint}_joint" for joint in _LIMITS if joint.startswith(side)]
        if not all(model.pin.existJointName(name) for name in names):
            continue
        upper, fore = (
            float(np.linalg.norm(model.pin.jointPlacements[model.pin.getJointId(name)].translation))
            for name in (f"{side}Ex_joint", f"{side}Wx_joint")
        )
        if min(upper, fore) <= 0.0:
            continue
        tables = [anthropometry("right", table, sex)[:2] for table, sex in _TABLES]  # type: ignore[arg-type]
        lengths = [tuple(segment.length for segment in arm) for arm in tables]
        nearest = min(lengths, key=lambda each: abs(np.log(upper / fore * each[1] / each[0])))
        return (upper + fore) / sum(nearest)
    return None
