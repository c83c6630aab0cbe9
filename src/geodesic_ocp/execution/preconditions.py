"""What has to hold for a trajectory to exist, checked before solving."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import as_vector
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.reference import SAME
from geodesic_ocp.execution.trajectory_program import TOLERANCE

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
        edges, count, dof = np.asarray(arm.edges, dtype=float), len(arm.paths), arm.robot.dof
        if edges.shape != (count + 1,) or not count or not np.all(np.diff(edges) > 0):
            raise ValueError(
                f"{name}.edges must be {count + 1} increasing times for {count} paths, got {edges}"
            )
        both = edges[[0, -1]], np.asarray(arms[0].edges, dtype=float)[[0, -1]]
        if np.abs(both[0] - both[1]).max() > SAME:
            raise ValueError(
                f"all arms must begin and end at the same times: {name} at {both[0]} s, arms[0] at "
                f"{both[1]} s"
            )
        as_vector(f"{name}.gravity", arm.gravity, 3)
        if arm.limits.velocity.size != dof:
            raise ValueError(
                f"{name}.limits.velocity must be {dof} numbers, got {arm.limits.velocity.size}"
            )
        for number, path in enumerate(arm.paths):
            if path.metric.dim != dof:
                raise ValueError(f"{name}.paths[{number}] is not a path of {dof} joints")
        _check_ends(name, arm)


def _check_ends(name: str, arm: ArmPaths) -> None:
    """That paths meet within the limits, where the arm can be held against gravity."""
    robot, ends = arm.robot, arm.ends
    for number, (before, after) in enumerate(pairwise(arm.paths), 1):
        gap = float(np.abs(before(1.0) - after(0.0)).max())
        if gap > _MEET:
            raise ValueError(
                f"{name}.paths[{number}] must begin where the one before ends; the distance is "
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
    arms: Sequence[ArmPaths], clearances: Sequence[Clearance], exact: bool
) -> tuple[Sequence[Clearance], str]:
    """Clearances without the distances that given configurations violate, and a sentence on these.

    Args:
        arms: with their paths.
        clearances: distances to be kept.
        exact: whether the configurations at the ends of the paths are given.

    Raises:
        ValueError: a clearance is a function of another number of joints.
    """
    dof = sum(arm.robot.dof for arm in arms)
    for clearance in clearances:
        if clearance.dof != dof:
            raise ValueError(
                f"clearances must be functions of the {dof} joints of all arms, got {clearance!r}"
            )
    if not exact:
        return clearances, ""
    # Configurations of all arms are given together only where paths of all of them end.
    shared = []
    for instant in arms[0].edges:
        gaps = [np.abs(arm.edges - instant) for arm in arms]
        if max(gap.min() for gap in gaps) <= SAME:
            pairs = zip(arms, gaps, strict=True)
            shared.append((instant, np.concatenate([arm.ends[gap.argmin()] for arm, gap in pairs])))
    possible, sentence = [], ""
    for clearance in clearances:
        lower = clearance.lower.copy()
        for instant, q in shared:
            distances = clearance.function(q).full()[:, 0]
            lack = clearance.lower - distances
            worst = int(lack.argmax())
            if lack[worst] > TOLERANCE and not sentence:
                sentence = (
                    f"{clearance.names[worst]} is {distances[worst]:.3g} m at {instant:.4g} s, "
                    "where the paths fix the configuration, and has to be "
                    f"{clearance.lower[worst]:.3g} m"
                )
            lower[lack > TOLERANCE] = -np.inf
        possible.append(replace(clearance, lower=lower))
    return possible, sentence
