"""Kinetic energies of the single links of a model."""

from __future__ import annotations

import casadi as ca
import pinocchio as pin

from geodesic_ocp.model.dynamics.placements import constant, joint_placements
from geodesic_ocp.model.joints import motion_subspace


def link_energies(model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
    """Translational and rotational kinetic energy [J] of the link behind each joint, (nv, 2).

    m |v_c|^2 / 2 of the centre of mass and w' I_c w / 2 about it, at joint velocities v (nv, 1), in
    the order of the coordinates. Joint inertia (armature) is not part of any link.
    """
    placements = joint_placements(model, q)
    linear, angular = [ca.SX.zeros(3)], [ca.SX.zeros(3)]  # of the origins of the bodies
    energies = ca.SX.zeros(model.nv, 2)
    for index in range(1, model.njoints):
        placement, parent = placements[index], model.parents[index]
        body, row = model.inertias[index], model.joints[index].idx_v
        subspace = motion_subspace(model, index)
        slide, turn = constant(subspace[:3]), constant(subspace[3:])
        into_body = placement.rotation.T
        at_joint = linear[parent] + ca.cross(angular[parent], placement.translation)
        linear.append(into_body @ at_joint + slide * v[row])
        angular.append(into_body @ angular[parent] + turn * v[row])
        centre = linear[index] + ca.cross(angular[index], constant(body.lever))
        energies[row, 0] = body.mass * ca.sumsqr(centre) / 2
        rotational = ca.dot(angular[index], constant(body.inertia) @ angular[index])
        energies[row, 1] = rotational / 2
    return energies
