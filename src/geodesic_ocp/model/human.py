"""The human arm with seven degrees of freedom, scaled by height and mass.

Chain, lengths, limits and inertias are those of the Master Motor Map's reference model (Terlemez
et al., "Master Motor Map (MMM): framework and toolkit for capturing, representing, and reproducing
human motion on humanoid robots", Humanoids 2014), whose segment masses and centres of mass are
Winter's (*Biomechanics and Motor Control of Human Movement*).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.model import Model

Side = Literal["right", "left"]


@dataclass(frozen=True)
class _Segment:
    """Figures per unit of body height and mass; the origin is the proximal joint."""

    mass: float  # [body mass]
    centre: float  # of mass, along the segment's z axis [height]
    inertia: tuple[float, float, float]  # about the centre of mass [body mass * height^2]


_TALLEST, _HEAVIEST = 3.0, 1000.0  # [m], [kg]: more is another unit, not a person
# Offset of every centre of mass from its segment's axis, in x and y [height]. The source's left
# arm has none in x but rounding noise of 1e-14.
_CENTRE_OFFSET = {"right": (2.03848e-5, 3.81383e-8), "left": (0.0, 3.81383e-8)}
_UPPER_ARM_LENGTH = 0.188  # [height]
_FOREARM_LENGTH = 0.145  # [height]
_UPPER_ARM = _Segment(0.027, -0.082, (5.90063e-5, 5.90086e-5, 3.96211e-6))
_FOREARM = _Segment(0.016, -0.0624, (2.35586e-5, 2.33400e-5, 1.50684e-6))
_HAND = {
    "right": _Segment(0.006, -0.0546, (5.18800e-6, 3.90222e-6, 1.41993e-6)),
    "left": _Segment(0.006, -0.0546, (5.19630e-6, 3.91221e-6, 1.41814e-6)),
}
_TOOL_CENTRE = {"right": (-0.015, 0.0, -0.037), "left": (0.015, 0.0, -0.037)}  # [height]
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


def human_arm(
    side: Side = "right", height: float = 1.75, mass: float = 70.0, *, backend: str | None = None
) -> Model:
    """A person's arm: shoulder (x, z, y), elbow (x, z) and wrist (x, y), with the tool centre.

    The base frame sits in the shoulder: x to the person's right, y forward, z up; at q = 0 the arm
    hangs down with the palm towards the body. The hand's frame is "hand".

    Args:
        side: "right" or "left"; joints are named as in MMM files (RSx_joint, ..., LWy_joint).
        height: of the person [m]; lengths scale with it, inertias with its square.
        mass: of the person [kg]; it scales the metric and leaves geodesics alone.
        backend: of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: an unknown side, height or mass not positive, or above 3 m or 1000 kg.
    """
    if side not in get_args(Side):
        raise ValueError(f"side must be 'right' or 'left', got {side!r}")
    height = as_positive("height", height, "m")
    mass = as_positive("mass", mass, "kg")
    if height > _TALLEST or mass > _HEAVIEST:
        raise ValueError(
            f"height and mass must be at most {_TALLEST:g} m and {_HEAVIEST:g} kg, "
            f"got {height:g} m and {mass:g} kg"
        )

    arm = pin.Model()
    arm.name = f"human {side} arm"
    chain = (  # joint, its type, segment between the joint before and this one, body it carries
        ("Sx", pin.JointModelRX(), 0.0, None),
        ("Sz", pin.JointModelRZ(), 0.0, None),
        ("Sy", pin.JointModelRY(), 0.0, _UPPER_ARM),
        ("Ex", pin.JointModelRX(), _UPPER_ARM_LENGTH, None),
        ("Ez", pin.JointModelRZ(), 0.0, _FOREARM),
        ("Wx", pin.JointModelRX(), _FOREARM_LENGTH, None),
        ("Wy", pin.JointModelRY(), 0.0, _HAND[side]),
    )
    parent = 0
    for joint, kind, length, segment in chain:
        lower, upper = (np.array([limit]) for limit in _LIMITS[side][joint])
        unlimited = np.array([np.inf])
        placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length * height]))
        name = f"{side[0].upper()}{joint}_joint"
        parent = arm.addJoint(parent, kind, placement, name, unlimited, unlimited, lower, upper)
        if segment is not None:
            centre = height * np.array([*_CENTRE_OFFSET[side], segment.centre])
            inertia = mass * height**2 * np.diag(segment.inertia)
            body = pin.Inertia(mass * segment.mass, centre, inertia)
            arm.appendBodyToJoint(parent, body, pin.SE3.Identity())
    tool = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), height * np.array(_TOOL_CENTRE[side]))
    arm.addFrame(pin.Frame("hand", parent, tool, pin.FrameType.OP_FRAME))
    return Model(arm, "hand", backend)
