"""MJCF through MuJoCo's own compiler: its compiled model (mjModel) as a Pinocchio model.

Everything that changes a model before it is simulated is then MuJoCo's: frames, replicas, included
files, default classes, units of angles, and masses that the compiler bounds, balances or scales.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.formats.compiled_geometry import compiled_geometry
from geodesic_ocp.model.formats.file_model import FileModel, Mimic
from geodesic_ocp.model.formats.mjcf_source import (
    MjcfSource,
    installed_mujoco,
    name_of,
    placement,
)
from geodesic_ocp.model.joints import joint_along


def compiled_mjcf_model(source: MjcfSource) -> FileModel:
    """Return the model that MuJoCo compiles, its couplings, and warnings.

    Bodies, joints and named sites become frames of these names; bodies and joints without one are
    called "body K" and "joint K", K their number in MuJoCo. The coordinate of a joint is MuJoCo's
    qpos, which is `ref` in the pose of the file.

    Raises:
        ValueError: MuJoCo refuses the model, or a coupling of joints is not linear.
    """
    native, notes = source.compiled(with_meshes=False)
    if native.nbody < 2:
        raise ValueError(f"{source.name} has no <body>")
    tree = _GrowingModel(native, pin.Model(), [0], [pin.SE3.Identity()])
    for body in range(1, native.nbody):
        tree.add_body(body)
    for site in range(native.nsite):
        tree.add_site(site)
    model = tree.pin
    model.lowerVelocityLimit[:] = -np.inf  # the format states none
    model.upperVelocityLimit[:] = np.inf
    model.gravity = pin.Motion(np.array(native.opt.gravity), np.zeros(3))
    tree.set_efforts()
    mimics, ignored = _equalities(native, source.name)
    ignored += _empty_ranges(native, source.name)
    ignored += tree.add_actuator_armature(source.name)
    geometry = partial(compiled_geometry, model, source)
    return FileModel(model, geometry, mimics, (*notes, *ignored))


@dataclass(eq=False)
class _GrowingModel:
    """A Pinocchio model under construction.

    Attributes:
        native: MuJoCo's model.
        pin: Pinocchio's, to which bodies are added from the root on.
        joints: for each body so far, the index of the joint that carries it.
        placements: its placement in the frame of that joint.
    """

    native: Any
    pin: pin.Model
    joints: list[int]
    placements: list[pin.SE3]

    def __post_init__(self) -> None:
        self.pin.addBodyFrame("world", 0, pin.SE3.Identity(), 0)

    def add_body(self, body: int) -> None:
        native = self.native
        parent = native.body_parentid[body]
        joint = self.joints[parent]
        frame = self.frame_of(parent)
        pose = placement(native.body_pos[body], native.body_quat[body])
        at_joint = self.placements[parent] * pose
        first = native.body_jntadr[body]
        for number in range(first, first + native.body_jntnum[body]):
            joint, at_joint = self.add_joint(number, joint, at_joint)
            frame = self.pin.addJointFrame(joint, frame)
        centre = placement(native.body_ipos[body], native.body_iquat[body])
        moments = pin.Inertia(
            native.body_mass[body], np.zeros(3), np.diag(native.body_inertia[body])
        )
        self.pin.appendBodyToJoint(joint, centre.act(moments), at_joint)
        self.pin.addBodyFrame(name_of(native.body(body)), joint, at_joint, frame)
        self.joints.append(joint)
        self.placements.append(at_joint)

    def add_joint(self, number: int, parent: int, body: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint of a body placed in the frame of its parent, in the pose of the file.

        Returns its index, and the placement of the body in the frame of the joint. Several joints
        of one body act one after the other.
        """
        native = self.native
        anchor = pin.SE3(np.eye(3), native.jnt_pos[number])
        name = name_of(native.joint(number))
        kind = ("free", "ball", "slide", "hinge")[native.jnt_type[number]]
        if kind == "free":
            index = self.pin.addJoint(parent, pin.JointModelFreeFlyer(), body, name)
            anchor = pin.SE3.Identity()
        elif kind == "ball":
            index = self.pin.addJoint(parent, pin.JointModelSpherical(), body * anchor, name)
        else:
            axis = np.array(native.jnt_axis[number])
            reference = float(native.qpos0[native.jnt_qposadr[number]])
            at_zero = body * anchor * moved_along(axis, kind, -reference)
            joint = joint_along(axis, "prismatic" if kind == "slide" else "revolute")
            index = self.pin.addJoint(parent, joint, at_zero, name)
            lower = -np.inf
            upper = np.inf
            if native.jnt_limited[number]:
                lower, upper = native.jnt_range[number]
            row = self.pin.joints[index].idx_q
            self.pin.lowerPositionLimit[row] = lower
            self.pin.upperPositionLimit[row] = upper
        first = native.jnt_dofadr[number]
        row = self.pin.joints[index].idx_v
        size = self.pin.joints[index].nv
        self.pin.armature[row : row + size] = native.dof_armature[first : first + size]
        return index, anchor.inverse()

    def frame_of(self, body: int) -> int:
        return int(self.pin.getFrameId(name_of(self.native.body(body)), pin.FrameType.BODY))

    def add_site(self, site: int) -> None:
        native = self.native
        if not (name := native.site(site).name):
            return
        body = native.site_bodyid[site]
        pose = placement(native.site_pos[site], native.site_quat[site])
        joint = self.joints[body]
        at_joint = self.placements[body] * pose
        kind = pin.FrameType.OP_FRAME
        self.pin.addFrame(pin.Frame(name, joint, self.frame_of(body), at_joint, kind))

    def rows(self, number: int) -> int:
        """Return the row of a joint of MuJoCo in the arrays of Pinocchio's model."""
        index = self.pin.getJointId(name_of(self.native.joint(number)))
        return int(self.pin.joints[index].idx_v)

    def set_efforts(self) -> None:
        """Set the smallest and largest torque [N m] or force [N] of each driven joint.

        The force of an actuator lies within its force range, and where the control is the force,
        within its control range times its gain, each times the gear ratio. The actuators of a joint
        add up. The joint's own actuatorfrcrange limits the sum.
        """
        native = self.native
        self.pin.lowerEffortLimit[:] = -np.inf
        self.pin.upperEffortLimit[:] = np.inf
        driven: dict[int, Array] = {}
        for actuator, joint in driven_joints(native):
            gear = float(native.actuator_gear[actuator, 0])
            if gear != 0.0:
                limits = np.sort(gear * _force_range(native, actuator))
                driven[joint] = driven.get(joint, np.zeros(2)) + limits
        for joint in np.flatnonzero(native.jnt_actfrclimited).tolist():
            own = np.array(native.jnt_actfrcrange[joint])
            driven[joint] = _overlap(own, driven.get(joint, np.array([-np.inf, np.inf])))
        for joint, (lower, upper) in driven.items():
            row = self.rows(joint)
            self.pin.lowerEffortLimit[row] = lower
            self.pin.upperEffortLimit[row] = upper

    def add_actuator_armature(self, name: str) -> list[str]:
        """Add the armature of actuators, times their gear ratio squared, to that of their joints.

        Returns warnings about armature of tendons, which couples joints.
        """
        native = self.native
        stated = getattr(native, "actuator_armature", np.zeros(native.nu))  # new in MuJoCo 3.4
        joints = dict(driven_joints(native))
        ignored = []
        for actuator in np.flatnonzero(stated).tolist():
            if actuator in joints:
                gear = float(native.actuator_gear[actuator, 0])
                self.pin.armature[self.rows(joints[actuator])] += gear**2 * stated[actuator]
            else:
                label = native.actuator(actuator).name
                ignored.append(f"{name}: the armature of actuator {label!r} is ignored")
        for tendon in np.flatnonzero(native.tendon_armature).tolist():
            label = native.tendon(tendon).name
            ignored.append(f"{name}: the armature of tendon {label!r} is ignored")
        return ignored


def _empty_ranges(native: Any, name: str) -> list[str]:
    """Return warnings about ranges that MuJoCo ignores, as the lower limit is above the upper."""
    ranges = native.jnt_range
    swapped = (ranges[:, 0] > ranges[:, 1]) & (native.jnt_limited == 0)
    return [
        f"{name}: joint {name_of(native.joint(number))!r} has no limits, as its lower one, "
        f"{ranges[number, 0]:g}, lies above the upper, {ranges[number, 1]:g}"
        for number in np.flatnonzero(swapped).tolist()
    ]


def moved_along(axis: Array, kind: str, value: float) -> pin.SE3:
    """Return the motion of a hinge or slide along a unit axis (3,) by a value [rad or m]."""
    if kind == "slide":
        return pin.SE3(np.eye(3), value * axis)
    return pin.SE3(pin.exp3(value * axis), np.zeros(3))


def driven_joints(native: Any) -> list[tuple[int, int]]:
    """Return pairs of an actuator that drives a joint with one degree of freedom, and the joint."""
    mujoco = installed_mujoco()
    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    scalar = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
    found = []
    for actuator in range(native.nu):
        joint = int(native.actuator_trnid[actuator, 0])
        if native.actuator_trntype[actuator] in kinds and native.jnt_type[joint] in scalar:
            found.append((actuator, joint))
    return found


def _force_range(native: Any, actuator: int) -> Array:
    """Return smallest and largest force of the actuator, before its gear."""
    mujoco = installed_mujoco()
    limits = np.array([-np.inf, np.inf])
    if native.actuator_forcelimited[actuator]:
        limits = np.array(native.actuator_forcerange[actuator])
    control = np.array([-np.inf, np.inf])
    if native.actuator_ctrllimited[actuator]:
        control = np.array(native.actuator_ctrlrange[actuator])
    is_force = (
        native.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and native.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    )
    if not is_force:  # the control is a position, a speed or an activation
        return limits
    gain = float(native.actuator_gainprm[actuator, 0])
    return _overlap(limits, np.sort(gain * control) if gain else np.zeros(2))


def _overlap(one: Array, other: Array) -> Array:
    return np.array([max(one[0], other[0]), min(one[1], other[1])])


def _equalities(native: Any, name: str) -> tuple[dict[str, Mimic], list[str]]:
    """Return mimic joints, from equalities of joints, and warnings about other equalities."""
    mujoco = installed_mujoco()
    mimics: dict[str, Mimic] = {}
    ignored: list[str] = []
    for number in np.flatnonzero(native.eq_active0).tolist():
        kind = mujoco.mjtEq(native.eq_type[number]).name.removeprefix("mjEQ_").lower()
        ends = (native.eq_obj1id[number], native.eq_obj2id[number])
        if kind != "joint":
            named = {"connect": native.body, "weld": native.body, "tendon": native.tendon}
            if kind in named and native.eq_objtype[number] == mujoco.mjtObj.mjOBJ_SITE:
                named[kind] = native.site
            names = [named[kind](end).name for end in ends if kind in named and end >= 0]
            ignored.append(f"{name}: the <{kind}> of {' and '.join(names)} is ignored")
            continue
        joint = name_of(native.joint(ends[0]))
        location = f"{name}: the equality of joint {joint!r}"
        if ends[1] < 0:
            ignored.append(f"{location} with a constant is ignored")
            continue
        references = [float(native.qpos0[native.jnt_qposadr[end]]) for end in ends]
        leader = name_of(native.joint(ends[1]))
        mimics[joint] = coupled(
            leader, native.eq_data[number][:5].tolist(), references=references, location=location
        )
    return mimics, ignored


def coupled(
    leader: str, coefficients: list[float], *, references: list[float], location: str
) -> Mimic:
    """Return the mimic joint of an equality: q - ref = c0 + c1 (leader - its ref).

    Args:
        leader: name of the other joint.
        coefficients: up to five.
        references: `ref` of the joint and of its leader [rad or m].
        location: for messages.

    Raises:
        ValueError: a coefficient of a higher power is not zero.
    """
    offset, multiplier, *higher = (*coefficients, 0.0, 0.0)
    if any(higher):
        raise ValueError(f"{location} with {leader!r} is not linear, which is not supported")
    return Mimic(leader, multiplier, references[0] + offset - multiplier * references[1])
