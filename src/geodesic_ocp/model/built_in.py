"""The built-in back end: symbolic rigid-body algorithms on CasADi SX, from a pin.Model.

Composite-rigid-body algorithm and forward kinematics for trees of one-degree-of-freedom joints
(revolute, prismatic, helical; any axis), in body coordinates: Featherstone, *Rigid Body Dynamics
Algorithms* (2008), table 6.2. Spatial vectors are ordered (linear, angular), as in Pinocchio.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace, without_noise


@dataclass(frozen=True)
class _Placement:
    """Rotation (3, 3) and translation (3, 1) of a frame relative to its parent."""

    rotation: ca.SX
    translation: ca.SX

    def __matmul__(self, other: _Placement) -> _Placement:
        return _Placement(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )


@dataclass(frozen=True)
class _Inertia:
    """Mass, first moment (3, 1) and second moment (3, 3) about the frame's origin."""

    mass: ca.SX
    first: ca.SX
    second: ca.SX

    def __add__(self, other: _Inertia) -> _Inertia:
        return _Inertia(
            self.mass + other.mass, self.first + other.first, self.second + other.second
        )

    def in_parent(self, placement: _Placement) -> _Inertia:
        """The same inertia in the parent frame, with the second moment about its origin."""
        first = placement.rotation @ self.first
        arm, moment = ca.skew(placement.translation), ca.skew(first)
        second = placement.rotation @ self.second @ placement.rotation.T
        second -= arm @ moment + moment @ arm + self.mass * (arm @ arm)
        return _Inertia(self.mass, first + self.mass * placement.translation, second)


def _constant(matrix: Array) -> ca.SX:
    return ca.SX(np.asarray(matrix, dtype=float))


def _constant_placement(placement: pin.SE3) -> _Placement:
    clean = without_noise(placement)
    return _Placement(_constant(clean.rotation), _constant(clean.translation))


def _screw_motion(subspace: Array, q: ca.SX) -> _Placement:
    """exp(S q) for a constant twist S = (linear, angular): rotation, translation or screw."""
    linear, angular = subspace[:3], subspace[3:]
    rate = float(np.linalg.norm(angular))
    if rate == 0.0:
        return _Placement(ca.SX.eye(3), _constant(linear) * q)
    axis, angle = angular / rate, rate * q
    cos, sin = ca.cos(angle), ca.sin(angle)
    projection = np.outer(axis, axis)
    cross = np.array(ca.DM(ca.skew(ca.DM(axis))))
    # R = a a' + cos (1 - a a') + sin [a] has exact zeros and ones for a coordinate axis.
    normal = np.eye(3) - projection
    rotation = _constant(projection) + cos * _constant(normal) + sin * _constant(cross)
    slide = linear / rate
    translation = (
        angle * _constant(projection @ slide)
        + sin * _constant(normal @ slide)
        + (1 - cos) * _constant(cross @ slide)
    )
    return _Placement(rotation, translation)


def _joint_placements(model: pin.Model, q: ca.SX) -> list[_Placement]:
    """Placement of every joint relative to its parent; index 0 is the universe."""
    placements = [_constant_placement(pin.SE3.Identity())]
    for index in range(1, model.njoints):
        moved = _screw_motion(motion_subspace(model, index), q[model.joints[index].idx_v])
        placements.append(_constant_placement(model.jointPlacements[index]) @ moved)
    return placements


def _body_inertia(inertia: pin.Inertia) -> _Inertia:
    lever = ca.skew(ca.DM(inertia.lever))
    about_origin = inertia.inertia - inertia.mass * np.array(ca.DM(lever @ lever))
    return _Inertia(
        ca.SX(inertia.mass), _constant(inertia.mass * inertia.lever), _constant(about_origin)
    )


def mass_matrix(model: pin.Model, q: ca.SX) -> ca.SX:
    """Joint-space mass-inertia matrix (nv, nv) at the joint coordinates q (nv, 1)."""
    placements = _joint_placements(model, q)
    subspaces = [np.zeros(6)] + [motion_subspace(model, i) for i in range(1, model.njoints)]
    composite = [_body_inertia(inertia) for inertia in model.inertias]
    matrix = ca.SX(model.nv, model.nv)
    for index in range(model.njoints - 1, 0, -1):
        body, row = composite[index], model.joints[index].idx_v
        linear, angular = (_constant(part) for part in np.split(subspaces[index], 2))
        force = body.mass * linear + ca.cross(angular, body.first)
        torque = ca.cross(body.first, linear) + body.second @ angular
        matrix[row, row] = ca.dot(linear, force) + ca.dot(angular, torque) + model.armature[row]
        ancestor = index
        while model.parents[ancestor] > 0:
            placement = placements[ancestor]
            force = placement.rotation @ force
            torque = placement.rotation @ torque + ca.cross(placement.translation, force)
            ancestor = model.parents[ancestor]
            linear, angular = (_constant(part) for part in np.split(subspaces[ancestor], 2))
            column = model.joints[ancestor].idx_v
            matrix[row, column] = ca.dot(linear, force) + ca.dot(angular, torque)
            matrix[column, row] = matrix[row, column]
        parent = model.parents[index]
        composite[parent] = composite[parent] + body.in_parent(placements[index])
    return ca.cse(ca.densify(matrix))


def frame_pose(model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
    """Rotation (3, 3) and position (3, 1) [m] of a frame in the base frame."""
    placements = _joint_placements(model, q)
    pose = _constant_placement(model.frames[frame].placement)
    joint = model.frames[frame].parentJoint
    while joint > 0:
        pose = placements[joint] @ pose
        joint = model.parents[joint]
    return ca.densify(pose.rotation), ca.densify(pose.translation)


def potential_energy(model: pin.Model, q: ca.SX) -> ca.SX:
    """Gravitational potential energy (1, 1) [J], zero at the height of the base."""
    gravity, energy = _constant(model.gravity.linear), ca.SX(1, 1)
    poses = _joint_placements(model, q)
    for index in range(1, model.njoints):
        poses[index] = poses[model.parents[index]] @ poses[index]
        body = model.inertias[index]
        moment = poses[index].rotation @ _constant(body.mass * body.lever)
        energy -= ca.dot(gravity, moment + body.mass * poses[index].translation)
    return ca.densify(energy)
