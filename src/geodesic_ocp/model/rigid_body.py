"""Algorithms for trees of rigid bodies, as CasADi expressions: the built-in back end.

Composite-rigid-body algorithm, recursive Newton-Euler algorithm and forward kinematics for trees of
one-degree-of-freedom joints (revolute, prismatic, helical; any axis), in body coordinates:
Featherstone, *Rigid Body Dynamics Algorithms* (2008), tables 5.1 and 6.2. Spatial vectors are
ordered (linear, angular), as in Pinocchio.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace, without_noise


def constant(matrix: Array) -> ca.SX:
    """Return numbers as an expression."""
    return ca.SX(np.asarray(matrix, dtype=float))


@dataclass(frozen=True)
class Placement:
    """Rotation (3, 3) and translation (3, 1) of a frame relative to its parent."""

    rotation: ca.SX
    translation: ca.SX

    def __matmul__(self, other: Placement) -> Placement:
        translation = self.rotation @ other.translation + self.translation
        return Placement(self.rotation @ other.rotation, translation)


def constant_placement(placement: pin.SE3) -> Placement:
    """Return a fixed placement, without rounding errors in its rotation."""
    clean = without_noise(placement)
    return Placement(constant(clean.rotation), constant(clean.translation))


def joint_placements(model: pin.Model, q: ca.SX) -> list[Placement]:
    """Return placement of every joint relative to its parent; index 0 is the universe."""
    placements = [constant_placement(pin.SE3.Identity())]
    for index in range(1, model.njoints):
        fixed = without_noise(model.jointPlacements[index])
        coordinate = q[model.joints[index].idx_v]
        placements.append(_moved(fixed, motion_subspace(model, index), coordinate))
    return placements


def _moved(fixed: pin.SE3, subspace: Array, q: ca.SX) -> Placement:
    """Return a fixed placement times exp(S q) for a constant twist S = (linear, angular)."""
    linear = subspace[:3]
    angular = subspace[3:]
    start = fixed.rotation
    origin = constant(fixed.translation)
    rate = float(np.linalg.norm(angular))
    if rate == 0.0:
        return Placement(constant(start), origin + constant(start @ linear) * q)
    axis = angular / rate
    angle = rate * q
    cos = ca.cos(angle)
    sin = ca.sin(angle)
    # Rodrigues' formula a a' + cos (1 - a a') + sin [a], with exact zeros for a coordinate axis.
    along = start @ np.outer(axis, axis)
    across = start - along
    turned = start @ pin.skew(axis)
    rotation = constant(along) + cos * constant(across) + sin * constant(turned)
    if np.any(linear):
        slide = linear / rate
        origin += angle * constant(along @ slide)
        origin += sin * constant(across @ slide) + (1 - cos) * constant(turned @ slide)
    return Placement(rotation, origin)


def link_energies(model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
    """Return translational and rotational kinetic energy [J] of the link behind each joint, (nv,
    2).

    m |v_c|^2 / 2 of the centre of mass and w' I_c w / 2 about it, at joint velocities v (nv, 1), in
    the order of the coordinates. Joint inertia (armature) is not part of any link.
    """
    placements = joint_placements(model, q)
    # of the origins of the bodies
    linear = [ca.SX.zeros(3)]
    angular = [ca.SX.zeros(3)]
    energies = ca.SX.zeros(model.nv, 2)
    for index in range(1, model.njoints):
        placement = placements[index]
        parent = model.parents[index]
        body = model.inertias[index]
        row = model.joints[index].idx_v
        slide, turn = _axis(model, index)
        into_body = placement.rotation.T
        at_joint = linear[parent] + ca.cross(angular[parent], placement.translation)
        linear.append(into_body @ at_joint + slide * v[row])
        angular.append(into_body @ angular[parent] + turn * v[row])
        centre = linear[index] + ca.cross(angular[index], constant(body.lever))
        energies[row, 0] = body.mass * ca.sumsqr(centre) / 2
        rotational = ca.dot(angular[index], constant(body.inertia) @ angular[index])
        energies[row, 1] = rotational / 2
    return energies


@dataclass(frozen=True)
class _Inertia:
    """Mass, first moment (3, 1) and second moment (3, 3) about the frame's origin."""

    mass: ca.SX
    first: ca.SX
    second: ca.SX

    def __add__(self, other: _Inertia) -> _Inertia:
        first = self.first + other.first
        second = self.second + other.second
        return _Inertia(self.mass + other.mass, first, second)

    def in_parent(self, placement: Placement) -> _Inertia:
        """Return the same inertia in the parent frame, with the second moment about its origin."""
        first = placement.rotation @ self.first
        arm = ca.skew(placement.translation)
        moment = ca.skew(first)
        second = placement.rotation @ self.second @ placement.rotation.T
        second -= arm @ moment + moment @ arm + self.mass * (arm @ arm)
        # Symmetric; written so, half of its entries are computed once.
        second = ca.triu2symm(ca.triu(second))
        return _Inertia(self.mass, first + self.mass * placement.translation, second)


def _body_inertia(inertia: pin.Inertia) -> _Inertia:
    lever = pin.skew(inertia.lever)
    first = constant(inertia.mass * inertia.lever)
    about_origin = inertia.inertia - inertia.mass * lever @ lever
    return _Inertia(ca.SX(inertia.mass), first, constant(about_origin))


def _axis(model: pin.Model, index: int) -> tuple[ca.SX, ca.SX]:
    """Return linear and angular part, (3, 1) each, of a joint's motion subspace."""
    subspace = motion_subspace(model, index)
    return constant(subspace[:3]), constant(subspace[3:])


def mass_matrix(model: pin.Model, q: ca.SX) -> ca.SX:
    """Return joint-space mass-inertia matrix (nv, nv) at the joint coordinates q (nv, 1)."""
    placements = joint_placements(model, q)
    composite = [_body_inertia(inertia) for inertia in model.inertias]
    # Wrenches (force, torque) that accelerate the composite bodies of descendants, one column for
    # each joint.
    columns: list[list[int]] = [[] for _ in placements]
    wrenches = [ca.SX(6, 0)] * model.njoints
    matrix = ca.SX(model.nv, model.nv)
    for index in range(model.njoints - 1, 0, -1):
        body = composite[index]
        row = model.joints[index].idx_v
        parent = model.parents[index]
        linear, angular = _axis(model, index)
        force = body.mass * linear + ca.cross(angular, body.first)
        torque = ca.cross(body.first, linear) + body.second @ angular
        wrench = ca.horzcat(ca.vertcat(force, torque), wrenches[index])
        entries = ca.vertcat(linear, angular).T @ wrench
        columns[index].insert(0, row)
        matrix[row, columns[index]] = entries
        matrix[columns[index], row] = entries.T
        matrix[row, row] += model.armature[row]
        if parent > 0:
            placement = placements[index]
            force = placement.rotation @ wrench[:3, :]
            torque = placement.rotation @ wrench[3:, :] + ca.skew(placement.translation) @ force
            columns[parent] += columns[index]
            wrenches[parent] = ca.horzcat(wrenches[parent], ca.vertcat(force, torque))
            composite[parent] += body.in_parent(placement)
    return ca.cse(ca.densify(matrix))


def kinetic_energy(model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
    """Return kinetic energy v' G(q) v / 2, (1, 1) [J], at joint velocities v (nv, 1).

    Summed over the links, with their velocities in body coordinates; armature is included.
    """
    of_links = ca.sum1(ca.sum2(link_energies(model, q, v)))
    return ca.cse(ca.densify(of_links + ca.dot(constant(model.armature), v**2) / 2))


def coriolis_force(model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
    """Return Coriolis and centrifugal forces C(q, v) v, (nv, 1), at joint velocities v (nv, 1)."""
    return inverse_dynamics(model, q, v, ca.SX.zeros(model.nv), ca.SX.zeros(3))


def inverse_dynamics(model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX) -> ca.SX:
    """Return joint forces G(q) a + C(q, v) v + g(q), (nv, 1), armature included.

    At joint accelerations a (nv, 1) and with free fall at `gravity` (3, 1) in base axes: recursive
    Newton-Euler algorithm, in which gravity accelerates the base against free fall. Linear
    accelerations are those of the bodies' origins, as by Luh, Walker and Paul (1980): unlike
    Featherstone's spatial accelerations, they need no linear velocities.
    """
    placements = joint_placements(model, q)
    none = ca.SX.zeros(3)
    axes = [(none, none), *(_axis(model, index) for index in range(1, model.njoints))]
    # Of each body: its angular velocity and acceleration, and the acceleration of its origin.
    velocity = [none]
    angular = [none]
    linear = [-gravity]
    # Of each body: the matrix that maps offsets from its origin to relative accelerations.
    relative = [ca.SX.zeros(3, 3)]
    # on each body, later with its descendants
    forces = [none]
    torques = [none]
    for index in range(1, model.njoints):
        placement = placements[index]
        parent = model.parents[index]
        body = model.inertias[index]
        row = model.joints[index].idx_v
        into_body = placement.rotation.T
        (linear_axis, axis) = axes[index]
        slide = linear_axis * v[row]
        turn = axis * v[row]
        carried = into_body @ velocity[parent]
        at_joint = linear[parent] + relative[parent] @ placement.translation
        velocity.append(carried + turn)
        angular.append(into_body @ angular[parent] + ca.cross(carried, turn) + axis * a[row])
        linear.append(
            into_body @ at_joint + ca.cross(2 * carried + turn, slide) + linear_axis * a[row]
        )
        spin = ca.skew(velocity[index])
        relative.append(ca.skew(angular[index]) + spin @ spin)
        lever = constant(body.lever)
        inertia = constant(body.inertia)
        forces.append(body.mass * (linear[index] + relative[index] @ lever))
        torque = inertia @ angular[index] + spin @ (inertia @ velocity[index])
        torques.append(torque + ca.cross(lever, forces[index]))
    joint_forces = ca.SX(model.nv, 1)
    for index in range(model.njoints - 1, 0, -1):
        placement = placements[index]
        parent = model.parents[index]
        (slide, turn) = axes[index]
        along = ca.dot(slide, forces[index]) + ca.dot(turn, torques[index])
        row = model.joints[index].idx_v
        joint_forces[row] = along + model.armature[row] * a[row]
        force = placement.rotation @ forces[index]
        torque = placement.rotation @ torques[index] + ca.cross(placement.translation, force)
        forces[parent], torques[parent] = forces[parent] + force, torques[parent] + torque
    return ca.cse(ca.densify(joint_forces))


def frame_pose(model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
    """Return rotation (3, 3) and position (3, 1) [m] of a frame in the base frame."""
    placements = joint_placements(model, q)
    pose = constant_placement(model.frames[frame].placement)
    joint = model.frames[frame].parentJoint
    while joint > 0:
        pose = placements[joint] @ pose
        joint = model.parents[joint]
    return ca.densify(pose.rotation), ca.densify(pose.translation)


def potential_energy(model: pin.Model, q: ca.SX) -> ca.SX:
    """Return gravitational potential energy (1, 1) [J], zero at the height of the base."""
    gravity = constant(model.gravity.linear)
    energy = ca.SX(1, 1)
    poses = joint_placements(model, q)
    for index in range(1, model.njoints):
        poses[index] = poses[model.parents[index]] @ poses[index]
        body = model.inertias[index]
        moment = poses[index].rotation @ constant(body.mass * body.lever)
        energy -= ca.dot(gravity, moment + body.mass * poses[index].translation)
    return ca.densify(energy)
