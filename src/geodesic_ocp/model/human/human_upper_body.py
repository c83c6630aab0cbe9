"""A human trunk with both arms, scaled by body height and mass.

Kinematic chain, joint limits and inertias are those of the reference model of the Master Motor Map
(Terlemez et al., "Master Motor Map (MMM): framework and toolkit for capturing, representing, and
reproducing human motion on humanoid robots", Humanoids 2014).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.model.human.anthropometry import Side, anthropometry, trunk
from geodesic_ocp.model.human.human_arm import (
    DEFAULT_HEIGHT,
    DEFAULT_MASS,
    add_arm,
    add_joint,
    as_stature,
    cylinder_radius,
    segment_inertia,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

# Winter, Biomechanics and Motor Control of Human Movement, table of densities: abdomen and pelvis,
# thorax, head and neck.
_DENSITY = {"abdomen": 1010.0, "thorax": 920.0, "head": 1110.0}  # [kg/m^3]
_JOINTS = {"x": pin.JointModelRX, "z": pin.JointModelRZ, "y": pin.JointModelRY}
_LIMITS = {  # [rad]
    "BP": {"x": (-0.872665, 0.610865), "z": (-0.785398, 0.785398), "y": (-0.349066, 0.349066)},
    "BT": {"x": (-0.610865, 0.471239), "z": (-0.628319, 0.628319), "y": (-0.349066, 0.349066)},
}


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
        radius = cylinder_radius(segment.mass * mass, _DENSITY[link], (high - low) * height)
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
        limits = _LIMITS[name][axis]
        parent = add_joint(model, parent, joint_type(), placement, f"{name}{axis}_joint", limits)
        distance = 0.0
    return parent
