"""Models of the benchmarks, and random pairs of configurations."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pinocchio as pin

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder


def planar_chain(links: int) -> go.Model:
    """Equal uniform rods in a plane, 1 m and 1 kg in all, with joints of +-2 rad."""
    model = pin.Model()
    model.name = f"planar chain of {links}"
    length, mass = 1.0 / links, 1.0 / links
    moment = mass * length**2 / 12.0
    rod = pin.Inertia(mass, np.array([length / 2.0, 0.0, 0.0]), np.diag([0.0, moment, moment]))
    end, unlimited, limit = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0])), [np.inf], [2.0]
    joint = 0
    for index in range(links):
        placement = end if index else pin.SE3.Identity()
        limits = map(np.array, (unlimited, unlimited, [-2.0], limit))
        joint = model.addJoint(joint, pin.JointModelRZ(), placement, f"joint {index + 1}", *limits)
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, end, pin.FrameType.OP_FRAME))
    return go.Model(model, "tip")


def both_arms() -> go.Model:
    """Both human arms as one system, 14 degrees of freedom."""
    arms = go.human_arm("left"), go.human_arm("right")
    return go.model.combine(*arms, placements=[(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)])


def robot(name: str) -> go.Model:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about repairs of robot files
        return go.load_model(name)


def is_installed(name: str) -> bool:
    """Whether the description of this robot is installed."""
    return folder(ROBOTS[name].package) is not None


TEN_MODELS: dict[str, Callable[[], go.Model]] = {
    "human arm": go.human_arm,
    "child": lambda: go.human_arm(height=1.1, mass=18.0),
    "human arm, de Leva": lambda: go.human_arm(table="de_leva", sex="female"),
    "panda": lambda: robot("panda"),
    "ur5": lambda: robot("ur5"),
    "xarm7": lambda: robot("xarm7"),
    "talos-left-arm": lambda: robot("talos-left-arm"),
    "tiago-pro-left-arm": lambda: robot("tiago-pro-left-arm"),
    "armar6-left": lambda: robot("armar6-left"),
    "planar chain": lambda: planar_chain(6),
}


def is_robot_missing(name: str) -> bool:
    """Whether this is one of the ten models whose description is not installed."""
    return name in ROBOTS and not is_installed(name)


def random_pairs(model: go.Model, fraction: float, count: int, seed: int = 0) -> np.ndarray:
    """Pairs (count, 2, n) from the central part of the joints' ranges, within one revolution."""
    lower, upper = np.maximum(model.lower, -np.pi), np.minimum(model.upper, np.pi)
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    rng = np.random.default_rng(seed)
    return middle + fraction * half * rng.uniform(-1.0, 1.0, (count, 2, model.dof))
