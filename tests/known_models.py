"""Small mechanisms with known motions, and properties of capsules."""

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
    """Links [m] that rotate about z; inertias [kg m^2] are about the centres of mass."""
    model = pin.Model()
    model.name = f"planar arm with {len(lengths)} links"
    parent, offset = 0, 0.0
    links = zip(lengths, masses, centres, inertias, strict=True)
    for index, (length, mass, centre, inertia) in enumerate(links):
        placement = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{index + 1}")
        # Only the moment about z matters in the plane; the others make the body physical.
        moments = np.diag([inertia / 2, inertia / 2, inertia])
        body = pin.Inertia(mass, np.array([centre, 0.0, 0.0]), moments)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        offset = length
    tip = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", parent, tip, pin.FrameType.OP_FRAME))
    return go.Model(model, "tip")


def free_rotor(moments: tuple[float, float, float]) -> go.Model:
    """A rigid body that rotates about its centre of mass, with joints about z, x and z."""
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
    """A branching mechanism with joints of all types with one degree of freedom.

    Joints are numbered depth first, as in models from files, or in the order of a random parent.
    """
    types = [
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
        joint_type = types[int(rng.integers(len(types)))]()
        joint = model.addJoint(parent, joint_type, placement, f"joint{index + 1}")
        moments = rng.normal(size=(3, 3))
        inertia = pin.Inertia(rng.uniform(0.5, 2.0), rng.normal(size=3), moments @ moments.T)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    tool = pin.SE3(pin.Quaternion(_direction(rng, 4)).matrix(), rng.normal(size=3))
    model.addFrame(pin.Frame("tool", joints, tool, pin.FrameType.OP_FRAME))
    return model


def configuration(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """Pinocchio's vector, with cosine and sine of the angle of a continuous joint."""
    entries: list[float] = []
    for joint in list(model.joints)[1:]:
        coordinate = q[joint.idx_v]
        entries += [coordinate] if joint.nq == 1 else [np.cos(coordinate), np.sin(coordinate)]
    return np.array(entries)


def _direction(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


def contains(capsule: go.Capsule, points: np.ndarray) -> bool:
    """Whether all points (k, 3) are in the capsule."""
    start, along = np.array(capsule.start), np.subtract(capsule.end, capsule.start)
    fraction = np.clip((points - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    distances = np.linalg.norm(points - start - fraction[:, None] * along, axis=1)
    return bool(np.all(distances <= capsule.radius))


def capsule_volume(capsule: go.Capsule) -> float:
    length = float(np.linalg.norm(np.subtract(capsule.end, capsule.start)))
    return np.pi * capsule.radius**2 * (length + 4.0 / 3.0 * capsule.radius)
