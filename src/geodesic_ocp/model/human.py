"""Models of a person: the right or left arm, and the upper body.

Kinematic chains, joint limits, tool centre points and inertias are those of the reference model of
the Master Motor Map (Terlemez et al., "Master Motor Map (MMM): framework and toolkit for capturing,
representing, and reproducing human motion on humanoid robots", Humanoids 2014).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.anthropometry import (
    Anthropometry,
    Segment,
    Sex,
    Side,
    TableName,
    anthropometry,
    trunk,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

DEFAULT_HEIGHT, DEFAULT_MASS = 1.75, 70.0  # [m], [kg]
_MAX_HEIGHT, _MAX_MASS = 3.0, 1000.0  # [m], [kg]: larger values are probably in other units
_TOOL_CENTRE = {"right": (-0.015, 0.0, -0.037), "left": (0.015, 0.0, -0.037)}  # [height]
# Winter, Biomechanics and Motor Control of Human Movement, tables of length and density.
_HAND_LENGTH = 0.108  # [height], to the fingertips
_DENSITY = {"upper arm": 1070.0, "forearm": 1130.0, "hand": 1160.0}  # [kg/m^3]
_RIGHT_LIMITS = {  # [rad]
    "Sx": (-1.22173, 3.31613),
    "Sz": (-1.0472, 1.22173),
    "Sy": (-2.79253, 0.0),
    "Ex": (0.0, 2.79253),
    "Ez": (-1.5708, 1.5708),
    "Wx": (-0.523599, 0.349066),
    "Wy": (-1.5708, 1.22173),
}
_LIMITS = {  # those of the left arm are mirrored
    "right": _RIGHT_LIMITS,
    "left": {
        joint: (low, high) if joint.endswith("x") else (0.0 - high, 0.0 - low)
        for joint, (low, high) in _RIGHT_LIMITS.items()
    },
}
# Winter, Biomechanics and Motor Control of Human Movement, table of densities: abdomen and pelvis,
# thorax, head and neck.
_UPPER_BODY_DENSITY = {"abdomen": 1010.0, "thorax": 920.0, "head": 1110.0}  # [kg/m^3]
_JOINTS = {"x": pin.JointModelRX, "z": pin.JointModelRZ, "y": pin.JointModelRY}
_SPINE_LIMITS = {  # [rad]
    "BP": {"x": (-0.872665, 0.610865), "z": (-0.785398, 0.785398), "y": (-0.349066, 0.349066)},
    "BT": {"x": (-0.610865, 0.471239), "z": (-0.628319, 0.628319), "y": (-0.349066, 0.349066)},
}
# The proportions of the tables differ by more than a hundredth from each other only in part: the
# nearest table is taken.
_TABLES = (("winter", None), ("de_leva", "male"), ("de_leva", "female"))


def as_stature(height: float, mass: float) -> tuple[float, float]:
    """Body height [m] and mass [kg] as floats; ValueError if they are not plausible."""
    height = as_positive("height", height, "m")
    mass = as_positive("mass", mass, "kg")
    if height > _MAX_HEIGHT or mass > _MAX_MASS:
        raise ValueError(
            f"height and mass must be at most {_MAX_HEIGHT:g} m and {_MAX_MASS:g} kg, "
            f"got {height:g} m and {mass:g} kg"
            + ("; is the height in cm?" if 50.0 < height < 100.0 * _MAX_HEIGHT else "")
        )
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
    """A human arm with shoulder (x, z, y), elbow (x, z) and wrist (x, y).

    The base frame is at the shoulder: x to the person's right, y forward, z up; at q = 0 the arm
    hangs down with the palm towards the body. The hand (end-effector) frame "hand" is at the tool
    centre point. Collision bodies are capsules along the links "right upper arm", "right forearm"
    and "right hand" (or left), with the radius of a cylinder of the segment's mass and density.

    >>> import geodesic_ocp as go
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
    bodies = add_arm(arm, 0, pin.SE3.Identity(), side, segments, height, mass)
    return Model(arm, "hand", backend, shapes=bodies).with_armature(armature)


def add_arm(
    model: pin.Model,
    parent: int,
    shoulder: pin.SE3,
    side: Side,
    segments: Anthropometry,
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
        segments: per unit of body height and mass.
        height, mass: body height [m] and mass [kg].
        hand: name of the frame at the tool centre point. If it is also that of the link, as "right
            hand" is, there is no frame of the link at the wrist.
    """
    chain = (  # joint, type, distance from the previous joint [height], segment
        ("Sx", pin.JointModelRX(), 0.0, None),
        ("Sz", pin.JointModelRZ(), 0.0, None),
        ("Sy", pin.JointModelRY(), 0.0, segments.upper_arm),
        ("Ex", pin.JointModelRX(), segments.upper_arm_length, None),
        ("Ez", pin.JointModelRZ(), 0.0, segments.forearm),
        ("Wx", pin.JointModelRX(), segments.forearm_length, None),
        ("Wy", pin.JointModelRY(), 0.0, segments.hand),
    )
    indices: list[int] = []
    for joint, joint_type, length, segment in chain:
        below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length * height]))
        placement = below if indices else shoulder
        name = f"{side[0].upper()}{joint}_joint"
        parent = add_joint(model, parent, joint_type, placement, name, _LIMITS[side][joint])
        indices.append(parent)
        if segment is not None:
            body = segment_inertia(segment, height, mass)
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    tool = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), height * np.array(_TOOL_CENTRE[side]))
    model.addFrame(pin.Frame(hand, parent, tool, pin.FrameType.OP_FRAME))
    lengths = {
        "upper arm": (segments.upper_arm_length, segments.upper_arm),
        "forearm": (segments.forearm_length, segments.forearm),
        "hand": (_HAND_LENGTH, segments.hand),
    }
    bodies = []
    for (name, (length, segment)), number in zip(lengths.items(), (2, 4, 6), strict=True):
        link, placement = f"{side} {name}", tool
        if link != hand:
            placement = pin.SE3.Identity()
            model.addFrame(pin.Frame(link, indices[number], placement, pin.FrameType.BODY))
        tip = np.array([0.0, 0.0, -length * height])
        start, end = (placement.actInv(point) for point in (np.zeros(3), tip))
        radius = cylinder_radius(segment.mass * mass, _DENSITY[name], length * height)
        bodies.append(Capsule(start, end, radius, link))
    return tuple(bodies)


def add_joint(
    model: pin.Model,
    parent: int,
    joint_type: object,
    placement: pin.SE3,
    name: str,
    limits: tuple[float, float],
) -> int:
    """Add a joint with its frame and limits [rad]; returns its index."""
    lower, upper = (np.array([limit]) for limit in limits)
    free = np.array([np.inf])
    index = int(model.addJoint(parent, joint_type, placement, name, free, free, lower, upper))
    model.addJointFrame(index)
    return index


def segment_inertia(segment: Segment, height: float, mass: float) -> pin.Inertia:
    """The inertia of a segment of a person of this height [m] and mass [kg]."""
    moments = mass * height**2 * np.diag(segment.inertia)
    return pin.Inertia(mass * segment.mass, height * np.array(segment.centre), moments)


def cylinder_radius(mass: float, density: float, length: float) -> float:
    """Radius [m] of a cylinder of this mass [kg], density [kg/m^3] and length [m]."""
    return float(np.sqrt(mass / density / (np.pi * length)))


def human_upper_body(
    height: float = DEFAULT_HEIGHT,
    mass: float = DEFAULT_MASS,
    *,
    armature: ArrayLike | Mapping[str, float] = 0.0,
    backend: str | None = None,
) -> Model:
    """A human trunk with six degrees of freedom and both arms with seven each.

    The base frame is at the pelvis: x to the person's right, y forward, z up; at q = 0 the person
    stands upright, and the arms hang down with the palms towards the body. The lumbar joint BP
    (rotations about x, z and y) connects pelvis and abdomen, the thoracic joint BT abdomen and
    thorax; the arms are those of `human_arm`. Neck, head and clavicles are fixed to the thorax,
    with their inertia. The hands are the frames "right hand" and "left hand" at the tool centre
    points; `Model.hand` is the right one. "thorax" is the frame midway between the shoulders.
    The pelvis is at rest: kinetic energy and poses are those relative to it.

    >>> import geodesic_ocp as go
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
    lumbar = _add_trunk_joint(person, 0, "BP", segments.pelvis * height)
    thoracic = _add_trunk_joint(person, lumbar, "BT", segments.abdomen_length * height)
    fixed = (segments.thorax, *segments.on_thorax)
    for joint, segment in ((lumbar, segments.abdomen), *((thoracic, each) for each in fixed)):
        body = segment_inertia(segment, height, mass)
        person.appendBodyToJoint(joint, body, pin.SE3.Identity())

    collar = pin.SE3(np.eye(3), np.array([0.0, 0.0, segments.thorax_length * height]))
    head = segments.on_thorax[-1]
    spans = (  # link, its joint and frame, its mass, from and to where [height]
        ("abdomen", lumbar, pin.SE3.Identity(), segments.abdomen, 0.0, segments.abdomen_length),
        ("thorax", thoracic, collar, segments.thorax, -segments.thorax_length, 0.0),
        ("head", thoracic, collar, head, *segments.head),
    )
    bodies = []
    for link, joint, frame, segment, low, high in spans:
        person.addFrame(pin.Frame(link, joint, frame, pin.FrameType.BODY))
        radius = cylinder_radius(
            segment.mass * mass, _UPPER_BODY_DENSITY[link], (high - low) * height
        )
        bodies.append(Capsule((0.0, 0.0, low * height), (0.0, 0.0, high * height), radius, link))
    hands = []
    for side in get_args(Side):
        across = segments.half_width * height * (1.0 if side == "right" else -1.0)
        shoulder = pin.SE3(np.eye(3), collar.translation + np.array([across, 0.0, 0.0]))
        arm = anthropometry(side, "winter", None)
        hands.append(f"{side} hand")
        bodies += add_arm(person, thoracic, shoulder, side, arm, height, mass, hands[-1])
    model = Model(person, hands[0], backend, shapes=tuple(bodies), hands=tuple(hands))
    return model.with_armature(armature)


def _add_trunk_joint(model: pin.Model, parent: int, name: str, distance: float) -> int:
    """Add rotations about x, z and y at a distance [m] above a joint; the last one's index."""
    for axis, joint_type in _JOINTS.items():
        placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, distance]))
        limits = _SPINE_LIMITS[name][axis]
        parent = add_joint(model, parent, joint_type(), placement, f"{name}{axis}_joint", limits)
        distance = 0.0
    return parent


def stature(model: Model) -> float | None:
    """Body height [m] of a model with the joints of `human_arm`; None for other models.

    It is read from the lengths of upper arm and forearm, by the anthropometric table whose
    proportion of the two is nearest.
    """
    for side in ("R", "L"):
        names = [f"{side}{joint}_joint" for joint in ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy")]
        if not all(model.pin.existJointName(name) for name in names):
            continue
        upper, fore = (
            float(np.linalg.norm(model.pin.jointPlacements[model.pin.getJointId(name)].translation))
            for name in (names[3], names[5])
        )
        if min(upper, fore) <= 0.0:
            continue
        tables = [anthropometry("right", table, sex) for table, sex in _TABLES]  # type: ignore[arg-type]
        nearest = min(
            tables, key=lambda t: abs(np.log(upper / fore * t.forearm_length / t.upper_arm_length))
        )
        return (upper + fore) / (nearest.upper_arm_length + nearest.forearm_length)
    return None
