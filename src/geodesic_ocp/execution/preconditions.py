"""What has to hold for a trajectory to exist, checked before solving."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import as_vector
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.reference import SAME, path_ends
from geodesic_ocp.execution.trajectory_program import TOLERANCE
from geodesic_ocp.execution.trajectory_terms import TrajectorySettings

_MEET = 1e-6  # [rad or m]; successive paths meet, and end within the limits, up to this


def check_arms(arms: Sequence[ArmPaths]) -> None:
    """That the paths meet within limits, at edges that all arms share at both ends.

    Raises:
        ValueError: they do not, or gravity alone makes a configuration too heavy to hold.
    """
    if not arms:
        raise ValueError("arms must be at least one, got none")
    for number, arm in enumerate(arms):
        name = f"arms[{number}]"
        edges = np.asarray(arm.edges, dtype=float)
        if edges.shape != (len(arm.paths) + 1,) or edges.size < 2 or not np.all(np.diff(edges) > 0):
            raise ValueError(
                f"{name}.edges must be {len(arm.paths) + 1} increasing times for "
                f"{len(arm.paths)} paths, got {edges}"
            )
        first, last = arms[0].edges[0], arms[0].edges[-1]
        if abs(edges[0] - first) > SAME or abs(edges[-1] - last) > SAME:
            raise ValueError(
                f"all arms must begin and end at the same times: {name} from {edges[0]:.6g} to "
                f"{edges[-1]:.6g} s, arms[0] from {first:.6g} to {last:.6g} s"
            )
        as_vector(f"{name}.gravity", arm.gravity, 3)
        _check_limits(name, arm)
        _check_junctions(name, arm)


def _check_limits(name: str, arm: ArmPaths) -> None:
    for kind in ("velocity", "acceleration", "jerk", "torque"):
        limit = np.asarray(getattr(arm.limits, kind), dtype=float)
        if limit.shape != (arm.robot.dof,):
            raise ValueError(
                f"{name}.limits.{kind} must be {arm.robot.dof} numbers, got {limit.size}"
            )


def _check_junctions(name: str, arm: ArmPaths) -> None:
    """That paths meet within the limits, where the arm can be held against gravity."""
    robot = arm.robot
    for number, path in enumerate(arm.paths):
        if path.metric.dim != robot.dof:
            raise ValueError(f"{name}.paths[{number}] is not a path of {robot.dof} joints")
    ends = path_ends(arm)
    for number, path in enumerate(arm.paths[:-1]):
        gap = float(np.abs(path(1.0) - ends[number + 1]).max())
        if gap > _MEET:
            raise ValueError(
                f"{name}.paths[{number + 1}] must begin where the one before ends; the distance is "
                f"{gap:.3g} in the worst joint"
            )
    beyond = np.maximum(robot.lower - ends, ends - robot.upper)
    if beyond.max() > _MEET:
        edge, joint = np.unravel_index(beyond.argmax(), beyond.shape)
        raise ValueError(
            f"{name} is beyond its limits at the end of a path: {robot.joint_names[joint]} by "
            f"{beyond[edge, joint]:.3g} {robot.units[joint]} at {arm.edges[edge]:.4g} s"
        )
    still = np.zeros_like(ends)
    shares = np.abs(robot.inverse_dynamics(ends, still, still, arm.gravity)) / arm.limits.torque
    if shares.max() > 1.0:
        edge, joint = np.unravel_index(shares.argmax(), shares.shape)
        limit = float(arm.limits.torque[joint])
        unit = "N m" if robot.units[joint] == "rad" else "N"
        raise ValueError(
            f"{name} is too weak for its own weight at {arm.edges[edge]:.4g} s, however slowly it "
            f"moves: {robot.joint_names[joint]} has to bear {shares[edge, joint] * limit:.4g}, and "
            f"its limit is {limit:.4g} {unit}"
        )


def attainable(
    arms: Sequence[ArmPaths], clearances: tuple[Clearance, ...], settings: TrajectorySettings
) -> tuple[tuple[Clearance, ...], str]:
    """Clearances without the distances that given configurations violate, and a sentence on these.

    Raises:
        ValueError: a clearance is a function of another number of joints.
    """
    dof = sum(arm.robot.dof for arm in arms)
    for clearance in clearances:
        if clearance.dof != dof:
            raise ValueError(
                f"clearances must be functions of the {dof} joints of all arms, got {clearance!r}"
            )
    if settings.tolerance is not None:
        return clearances, ""
    # Configurations of all arms are given together only where paths of all of them end.
    shared = [
        instant
        for instant in arms[0].edges
        if all(np.abs(arm.edges - instant).min() <= SAME for arm in arms)
    ]
    attainable, sentence = [], ""
    for clearance in clearances:
        lower = clearance.lower.copy()
        for instant in shared:
            q = np.concatenate(
                [path_ends(arm)[int(np.abs(arm.edges - instant).argmin())] for arm in arms]
            )
            lack = clearance.lower - clearance.function(q).full()[:, 0]
            worst = int(lack.argmax())
            if lack[worst] > TOLERANCE and not sentence:
                sentence = (
                    f"{clearance.names[worst]} is {clearance.lower[worst] - lack[worst]:.3g} m at "
                    f"{instant:.4g} s, where the paths fix the configuration, and has to be "
                    f"{clearance.lower[worst]:.3g} m"
                )
            lower[lack > TOLERANCE] = -np.inf
        attainable.append(replace(clearance, lower=lower))
    return tuple(attainable), sentence
