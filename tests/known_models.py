"""Small mechanisms, built with Pinocchio, whose motions are known."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import geodesic_ocp as go


def planar_arm(
    lengths: tuple[float, ...],
    masses: tuple[float, ...],
    centres: tuple[float, ...],
    inertias: tuple[float, ...],
) -> go.Model:
    """Links [m] turning about z in a plane; inertias [kg m^2] are about the centres of mass."""
    model = pin.Model()
    model.name = f"planar arm with {len(lengths)} links"
    parent, offset = 0, 0.0
    figures = zip(lengths, masses, centres, inertias, strict=True)
    for index, (length, mass, centre, inertia) in enumerate(figures):
        placement = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{index + 1}")
        # Only the moment about z counts in the plane; the others make a physical body of it.
        moments = np.diag([inertia / 2, inertia / 2, inertia])
        body = pin.Inertia(mass, np.array([centre, 0.0, 0.0]), moments)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        offset = length
    tip = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", parent, tip, pin.FrameType.OP_FRAME))
    return go.Model(model, "tip")


def free_rotor(moments: tuple[float, float, float]) -> go.Model:
    """A rigid body that turns about its centre of mass, on joints about z, x and z."""
    model = pin.Model()
    model.name = "free rotor"
    parent = 0
    for index, joint in enumerate((pin.JointModelRZ(), pin.JointModelRX(), pin.JointModelRZ())):
        parent = model.addJoint(parent, joint, pin.SE3.Identity(), f"joint{index + 1}")
    body = pin.Inertia(2.0, np.zeros(3), np.diag(moments))
    model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("body", parent, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return go.Model(model, "body")


def random_tree(
    rng: np.random.Generator, joints: int = 8, *, depth_first: bool = True
) -> pin.Model:
    """A branching mechanism of every kind of joint with one degree of freedom.

    Numbered depth first every joint follows its own branch, as in models from files; otherwise
    branches grow in turns.
    """
    kinds = [
        lambda: pin.JointModelRX(),
        lambda: pin.JointModelRY(),
        lambda: pin.JointModelRZ(),
        lambda: pin.JointModelPX(),
        lambda: pin.JointModelPY(),
        lambda: pin.JointModelPZ(),
        lambda: pin.JointModelRUBX(),
        lambda: pin.JointModelRUBY(),
        lambda: pin.JointModelRUBZ(),
        lambda: pin.JointModelRevoluteUnaligned(*_direction(rng)),
        lambda: pin.JointModelPrismaticUnaligned(*_direction(rng)),
        lambda: pin.JointModelHelicalUnaligned(_direction(rng), 0.3),
        lambda: pin.JointModelHX(0.2),
        lambda: pin.JointModelHY(-0.1),
        lambda: pin.JointModelHZ(0.4),
    ]
    model = pin.Model()
    for index in range(joints):
        candidates = list(model.supports[index]) if depth_first else range(index + 1)
        parent = int(rng.choice(candidates))
        placement = pin.SE3(pin.Quaternion(_direction(rng, 4)).matrix(), rng.normal(size=3))
        kind = kinds[int(rng.integers(len(kinds)))]()
        joint = model.addJoint(parent, kind, placement, f"joint{index + 1}")
        moments = rng.normal(size=(3, 3))
        inertia = pin.Inertia(rng.uniform(0.5, 2.0), rng.normal(size=3), moments @ moments.T)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    tool = pin.SE3(pin.Quaternion(_direction(rng, 4)).matrix(), rng.normal(size=3))
    model.addFrame(pin.Frame("tool", joints, tool, pin.FrameType.OP_FRAME))
    return model


def _direction(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)
