"""A human arm with seven degrees of freedom, scaled by body height and mass.

Kinematic chain, joint limits and tool centre point follow the reference model of the Master Motor
Map (Terlemez et al., "Master Motor Map (MMM): framework and toolkit for capturing, representing,
and reproducing human motion on humanoid robots", Humanoids 2014).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.human.anthropometry import (
    Anthropometry,
    Segment,
    Sex,
    Side,
    TableName,
    anthropometry,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

DEFAULT_HEIGHT, DEFAULT_MASS = 1.75, 70.0  # [m], [kg]
_MAX_HEIGHT, _MAX_MASS = 3.0, 1000.0  # [m], [kg]: larger values are probably in other units
_TOOL_CENTRE = {"right": (-0.015, 0.0, -0.037), "left": (0.015, 0.0, -0.037)}  # [height]
# Winter, Biomechanics and Motor Control of Human Movement, tables of length and density.
_HAND_LENGTH = 0.108  # [height], to the fingertips
_DENSITY = {"upper arm": 1070.0, "forearm": 1130.0, "hand": 1160.0}  # [kg/m^3]
_LIMITS = {  # [rad]
    "right": {
        "Sx": (-1.22173, 3.31613),
        "Sz": (-1.0472, 1.22173),
        "Sy": (-2.79253, 0.0),
        "Ex": (0.0, 2.79253),
        "Ez": (-1.5708, 1.5708),
        "Wx": (-0.523599, 0.349066),
        "Wy": (-1.5708, 1.22173),
    },
    "left": {
        "Sx": (-1.22173, 3.31613),
        "Sz": (-1.22173, 1.0472),
        "Sy": (0.0, 2.79253),
        "Ex": (0.0, 2.79253),
        "Ez": (-1.5708, 1.5708),
        "Wx": (-0.523599, 0.349066),
        "Wy": (-1.22173, 1.5708),
    },
}


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
