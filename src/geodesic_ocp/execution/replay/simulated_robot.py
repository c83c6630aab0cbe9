"""The robot in MuJoCo, from a Model or from its own MJCF."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array, short_repr
from geodesic_ocp.model.formats.mjcf import mjcf_text
from geodesic_ocp.model.formats.robots import locate
from geodesic_ocp.model.model import Model

_SAME_ROTATION = 1e-6  # [rad]
# What keeps joints together or drives them, and what refers to joints that are locked.
_UNUSED = ("actuators", "equalities", "tendons", "sensors", "keys")


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedRobot:
    """A MuJoCo model whose joints are those of a Model; all other joints are locked.

    Attributes:
        model: of MuJoCo; its contacts have no effect.
        positions: index in its configuration of each joint of the Model, (n,).
        velocities: index in its velocity of each joint, (n,).
        links: name of the link of each of its geoms.
        capsules: whether the geoms are the capsules around the links of a Model.
    """

    model: Any
    positions: Array
    velocities: Array
    links: tuple[str, ...]
    capsules: bool

    def __repr__(self) -> str:
        return short_repr(self)


def import_mujoco() -> Any:
    """The module mujoco.

    Raises:
        ImportError: it is not installed; names the extra.
    """
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise ImportError("replay needs MuJoCo: pip install 'geodesic_ocp[mujoco]'") from None


def simulated_robot(
    robot: Model | str | PathLike[str], model: Model, gravity: Array, timestep: float
) -> SimulatedRobot:
    """The robot in MuJoCo.

    Args:
        robot: a Model, an MJCF file or its text, or the name of one in MuJoCo Menagerie. Joints of
            the file that the Model does not have stay where the file puts them; its actuators,
            couplings and contacts are left out.
        model: the joints that move, by name.
        gravity: acceleration of free fall in the axes of the Model's base (3,) [m/s^2].
        timestep: of the simulation [s].

    Raises:
        ValueError: the robot lacks a joint, MuJoCo cannot read it, or its hand moves otherwise than
            that of the Model.
    """
    mujoco = import_mujoco()
    if isinstance(robot, Model):
        native = _compiled(mujoco, lambda: mujoco.MjModel.from_xml_string(mjcf_text(robot)))
        _check_joints(robot.joint_names, model, f"model {robot.name!r}")
    else:
        native = _from_file(mujoco, robot, model)
    native.opt.timestep = timestep
    native.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    flags = mujoco.mjtDisableBit
    native.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_AUTORESET)
    ids = [native.joint(name).id for name in model.joint_names]
    rows = native.jnt_qposadr[ids], native.jnt_dofadr[ids]
    written = isinstance(robot, Model)
    found = SimulatedRobot(native, *rows, _links(native, written), written)
    turn = np.eye(3) if isinstance(robot, Model) else _base_rotation(mujoco, found, model)
    native.opt.gravity[:] = turn @ gravity
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


def _links(native: Any, written: bool) -> tuple[str, ...]:
    """The link of each geom: after which `mjcf_text` names it, or its body in a file."""
    if written:
        return tuple(native.geom(k).name.rpartition(":")[0] for k in range(native.ngeom))
    return tuple(native.body(body).name for body in native.geom_bodyid)


def _base_rotation(mujoco: Any, found: SimulatedRobot, model: Model) -> Array:
    """Rotation from the axes of the Model's base to those of the file's world.

    Found from the orientation of the hand, if the file has it; otherwise they are the same.
    """
    native, data = found.model, mujoco.MjData(found.model)
    kinds = mujoco.mjtObj
    ids = {
        kind: mujoco.mj_name2id(native, kind, model.hand)
        for kind in (kinds.mjOBJ_SITE, kinds.mjOBJ_BODY)
    }
    kind = next((kind for kind, number in ids.items() if number >= 0), None)
    if kind is None:
        return np.eye(3)
    turns = []
    for q in (np.zeros(model.dof), np.linspace(0.3, 0.9, model.dof)):
        data.qpos[found.positions] = q
        mujoco.mj_kinematics(native, data)
        rows = data.site_xmat if kind == kinds.mjOBJ_SITE else data.xmat
        turns.append(rows[ids[kind]].reshape(3, 3) @ model.hand_pose(q)[0].T)
    if np.abs(turns[0] - turns[1]).max() > _SAME_ROTATION:
        raise ValueError(
            f"the hand {model.hand!r} turns otherwise in the MJCF than in the model "
            f"{model.name!r}: they are not the same robot"
        )
    return np.array(turns[0])
