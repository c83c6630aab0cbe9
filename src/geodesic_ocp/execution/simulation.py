"""The robot in MuJoCo: its model, controllers, simulation and contacts."""

from __future__ import annotations

import importlib
from collections import defaultdict
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.model.formats.mjcf_text import mjcf_text
from geodesic_ocp.model.formats.robots import locate
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

Controller: TypeAlias = Literal["computed torque", "pd"]
# (q, v, reference q, v and a) -> torques, (n,) each
Torques: TypeAlias = Callable[[Array, Array, Array, Array, Array], Array]
_POSTURES = 50  # of a reference, in which masses are compared
_SAME_ROTATION = 1e-6  # [rad]
_DIVERGED = 1e6  # [rad/s or m/s]
# What keeps joints together or drives them, and what refers to joints that are locked.
_UNUSED = ("actuators", "equalities", "tendons", "sensors", "keys")


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedRobot(ShortRepr):
    """A MuJoCo model whose joints are those of a Model; all other joints are locked.

    Attributes:
        mujoco: the module.
        model: model of MuJoCo; its contacts have no effect.
        positions: index in its configuration of each joint of the Model, (n,).
        velocities: index in its velocity of each joint, (n,).
        links: name of the link of each of its geoms.
        capsules: whether the geoms are the capsules around the links of a Model.
    """

    mujoco: Any
    model: Any
    positions: Array
    velocities: Array
    links: tuple[str, ...]
    capsules: bool


def simulated_robot(
    robot: Model | str | PathLike[str], model: Model, gravity: Array, timestep: float = 1e-3
) -> SimulatedRobot:
    """Return the robot in MuJoCo.

    Args:
        robot: a Model, an MJCF file or its text, or the name of one in MuJoCo Menagerie. Joints of
            the file that the Model does not have stay where the file puts them; its actuators,
            couplings and contacts are left out.
        model: the joints that move, by name.
        gravity: acceleration of free fall in the axes of the Model's base (3,) [m/s^2].
        timestep: timestep of the simulation [s].

    Raises:
        ValueError: the robot lacks a joint, MuJoCo cannot read it, or its hand moves otherwise than
            that of the Model.
        ImportError: MuJoCo is not installed; names the extra.
    """
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError:
        raise ImportError("replay needs MuJoCo: pip install 'geodesic_ocp[robots]'") from None
    written = isinstance(robot, Model)
    if isinstance(robot, Model):
        native = _compiled(mujoco, lambda: mujoco.MjModel.from_xml_string(mjcf_text(robot)))
        _check_joints(robot.joint_names, model, f"model {robot.name!r}")
        # `mjcf_text` names a geom after its link.
        links = [native.geom(k).name.rpartition(":")[0] for k in range(native.ngeom)]
    else:
        native = _from_file(mujoco, robot, model)
        links = [native.body(body).name for body in native.geom_bodyid]
    native.opt.timestep = timestep
    native.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    flags = mujoco.mjtDisableBit
    native.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_AUTORESET)
    ids = [native.joint(name).id for name in model.joint_names]
    columns = native.jnt_qposadr[ids], native.jnt_dofadr[ids]
    found = SimulatedRobot(mujoco, native, *columns, tuple(links), written)
    native.opt.gravity[:] = gravity if written else _base_rotation(found, model) @ gravity
    return found


def _from_file(mujoco: Any, robot: str | PathLike[str], model: Model) -> Any:
    text = str(robot)
    if text.lstrip().startswith("<"):
        name = "the MJCF text"
        spec = _compiled(mujoco, lambda: mujoco.MjSpec.from_string(text))
    else:
        file = Path(text) if Path(text).is_file() else locate(text)
        if file is None or file.suffix == ".urdf":
            raise ValueError(
                f"simulated must be a Model, an MJCF file or its text, or menagerie/NAME, got "
                f"{text!r}; a URDF becomes a Model with load_model"
            )
        name = file.name
        spec = _compiled(mujoco, lambda: mujoco.MjSpec.from_file(str(file)))
    _check_joints([joint.name for joint in spec.joints], model, name)
    for kind in _UNUSED:
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    for joint in list(spec.joints):
        if joint.name not in model.joint_names:
            spec.delete(joint)
    return _compiled(mujoco, spec.compile)


def _compiled(mujoco: Any, make: Any) -> Any:
    try:
        return make()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"MuJoCo cannot read the robot: {reason}") from None


def _check_joints(present: Any, model: Model, name: str) -> None:
    if missing := [joint for joint in model.joint_names if joint not in present]:
        raise ValueError(
            f"{name} has no joint {', '.join(missing)}; it has {', '.join(filter(None, present))}"
        )


def _base_rotation(found: SimulatedRobot, model: Model) -> Array:
    """Return rotation from the axes of the Model's base to those of the file's world.

    Found from the orientation of the hand, if the file has it; otherwise they are the same.
    """
    mujoco = found.mujoco
    native = found.model
    data = found.mujoco.MjData(found.model)
    kinds = {"site_xmat": mujoco.mjtObj.mjOBJ_SITE, "xmat": mujoco.mjtObj.mjOBJ_BODY}
    ids = {rows: mujoco.mj_name2id(native, kind, model.hand) for rows, kind in kinds.items()}
    rows = next((rows for rows, number in ids.items() if number >= 0), None)
    if rows is None:
        return np.eye(3)
    turns = []
    for q in (np.zeros(model.dof), np.linspace(0.3, 0.9, model.dof)):
        data.qpos[found.positions] = q
        mujoco.mj_kinematics(native, data)
        turns.append(getattr(data, rows)[ids[rows]].reshape(3, 3) @ model.hand_pose(q)[0].T)
    if np.abs(turns[0] - turns[1]).max() > _SAME_ROTATION:
        raise ValueError(
            f"the hand {model.hand!r} turns otherwise in the MJCF than in the model "
            f"{model.name!r}: they are not the same robot"
        )
    return np.array(turns[0])


def make_controller(
    kind: Controller, model: Model, gravity: Array, frequency: float, postures: Array
) -> Torques:
    """Return the controller as a function of the state and the reference.

    With the error e of positions and w = 2 pi frequency:
    - computed torque: M(q) (a + 2 w e' + w^2 e) + C(q, v) v + g(q), so that e'' + 2 w e' + w^2 e is
      zero if the model is exact (Siciliano et al., "Robotics", 2009, section 8.5.2);
    - pd: D (2 w e' + w^2 e) + g(q), with the largest diagonal D of the mass matrix in the postures.

    Args:
        kind: which one.
        model: the robot as the controller knows it.
        gravity: acceleration of free fall in the axes of its base (3,) [m/s^2].
        frequency: natural frequency of the error, critically damped [Hz].
        postures: configurations (k, n) of the reference.

    Raises:
        ValueError: there is no such controller.
    """
    if kind not in get_args(Controller):
        known = " or ".join(repr(name) for name in get_args(Controller))
        raise ValueError(f"controller must be {known}, got {kind!r}")
    robot = simulated_robot(model.with_bodies(), model, gravity)
    mujoco = robot.mujoco
    native = robot.model
    data = robot.mujoco.MjData(robot.model)
    native.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        data.qpos[robot.positions] = q
        data.qvel[robot.velocities] = v
        data.qacc[robot.velocities] = a
        mujoco.mj_inverse(native, data)
        return np.array(data.qfrc_inverse[robot.velocities])

    omega = 2.0 * np.pi * frequency
    still = np.zeros(model.dof)
    rows = np.unique(np.linspace(0, len(postures) - 1, _POSTURES).astype(int))
    weights = np.max([np.diag(model.mass_matrix(q)) for q in postures[rows]], axis=0)

    def torques(q: Array, v: Array, qr: Array, vr: Array, ar: Array) -> Array:
        feedback = 2.0 * omega * (vr - v) + omega**2 * (qr - q)
        if kind == "computed torque":
            return inverse_dynamics(q, v, ar + feedback)
        return np.asarray(weights * feedback + inverse_dynamics(q, still, still))

    return torques


def simulate(
    robot: SimulatedRobot, reference: JointTrajectory, controller: Torques, largest: Array
) -> tuple[Array, Array, Array]:
    """Return positions, velocities and torques (k, n) of a robot that follows the reference.

    The robot starts in the state of the first sample. Torques are constant for one step of the
    simulation, which is that of the reference.

    Args:
        robot: as it is simulated.
        reference: k samples, evenly spaced by the timestep of the simulation.
        controller: torques from state and reference.
        largest: magnitudes (n,) to which torques are cut [N m or N].

    Raises:
        IntegrationFailed: the motion diverges; says when.
    """
    mujoco = robot.mujoco
    native = robot.model
    data = robot.mujoco.MjData(robot.model)
    data.qpos[robot.positions] = reference.positions[0]
    data.qvel[robot.velocities] = reference.velocities[0]
    q, v, torques = (np.empty_like(reference.positions) for _ in range(3))
    samples = zip(reference.positions, reference.velocities, reference.accelerations, strict=True)
    for k, sample in enumerate(samples):
        q[k] = data.qpos[robot.positions]
        v[k] = data.qvel[robot.velocities]
        torques[k] = np.clip(controller(q[k], v[k], *sample), -largest, largest)
        data.qfrc_applied[robot.velocities] = torques[k]
        if k + 1 < len(q):
            mujoco.mj_step(native, data)
            if not np.abs(data.qvel).max() < _DIVERGED:
                time = float(reference.time[k + 1] - reference.time[0])
                raise IntegrationFailed(
                    f"the simulated robot diverges {time:.3g} s after the start: the controller is "
                    "unstable for it; lower its frequency or raise the rate",
                    time,
                    q[k],
                )
    return q, v, torques


@dataclass(frozen=True)
class Contact:
    """Two links that overlap during a motion.

    Attributes:
        first, second: names of the links.
        depth: largest depth by which their geometry overlaps [m].
        share: share of the samples in which it does, from 0 to 1.
        capsules: whether it is the capsules around the links, which are larger than the links.
    """

    first: str
    second: str
    depth: float
    share: float
    capsules: bool = False

    def __str__(self) -> str:
        time = "" if self.share == 1.0 else f", {100 * self.share:.3g} % of the time"
        return f"{self.first} and {self.second} ({1e3 * self.depth:.3g} mm{time})"


def find_contacts(robot: SimulatedRobot, postures: Array) -> tuple[Contact, ...]:
    """Return pairs of links whose geometry overlaps in the configurations (k, n), deepest first.

    Neighbours in the chain are left out, as MuJoCo does, and pairs that the file excludes.
    """
    mujoco = robot.mujoco
    native = copy(robot.model)
    native.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(native)
    depths: dict[tuple[str, ...], list[float]] = defaultdict(list)  # deepest one of each posture
    for q in postures:
        data.qpos[robot.positions] = q
        mujoco.mj_fwdPosition(native, data)
        touching: dict[tuple[str, ...], float] = {}
        for contact in data.contact:
            if contact.dist < 0.0:
                pair = tuple(sorted(robot.links[geom] for geom in contact.geom))
                touching[pair] = max(touching.get(pair, 0.0), -float(contact.dist))
        for pair, depth in touching.items():
            depths[pair].append(depth)
    found = [
        Contact(one, other, max(each), len(each) / len(postures), robot.capsules)
        for (one, other), each in depths.items()
    ]
    return tuple(sorted(found, key=lambda contact: -contact.depth))
