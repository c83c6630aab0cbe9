"""Warnings about synergies of a robot that are not what a person would expect."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.transfer import NEAR_MISS, TOO_NEAR
from geodesic_ocp.rotations import rotation_vector

if TYPE_CHECKING:
    from geodesic_ocp.retargeting.arm_result import RetargetedArm
    from geodesic_ocp.retargeting.result import Retargeting

# A hand's path is a detour if it is longer than this factor times the person's, and this much more.
_FACTOR, _MORE, _MORE_ANGLE = 2.0, 0.15, 1.0  # [m], [rad]
_SLOW = 3.0  # times the person's time
_MISSED = 1e-4  # pose error [m] and [rad]
_MISSED_AS = {
    TOO_NEAR: "at which links would be too near",
    NEAR_MISS: "which it would attain by a detour only",
}
_SAMPLES = 41
_REPORTED = 6


def warn_of_detours(result: Retargeting) -> None:
    """Warn of detours of the hand, slow synergies, and links that come too near.

    Warns:
        UserWarning: one, with a sentence for each.
    """
    found = [
        f"{name} are {amount:.2g} m too near at {when:.2f} s of the recording"
        for name, amount, when in result.too_near
    ]
    if result.touches and not found:
        found.append("links touch on the trajectory, as `Retargeting.check` says in detail")
    found += [sentence for arm in result.arms for sentence in _of_arm(arm)]
    if found:
        more = f"; and {len(found) - _REPORTED} more" if len(found) > _REPORTED else ""
        warnings.warn("; ".join(found[:_REPORTED]) + more, UserWarning, 4)


def _of_arm(arm: RetargetedArm) -> Iterator[str]:
    time = arm.analysis.motion.time
    for number, (group, transfer, synergy) in enumerate(
        zip(arm.groups, arm.transfers, arm.synergies, strict=True), 1
    ):
        where = (
            f"synergy {number} of {arm.robot.name} ({time[group.start]:.2f} to "
            f"{time[group.stop]:.2f} s of the recording)"
        )
        if group.kind == "rest":
            continue
        if why := _MISSED_AS.get(transfer.status):
            errors = transfer.position_error, transfer.rotation_error
            if max(errors) > _MISSED:
                yield f"{where} ends {errors[0]:.2g} m and {errors[1]:.2g} rad from its pose, {why}"
        here = slice(group.start, group.stop + 1)
        of_person = _lengths(arm.target_poses[0][here], arm.target_poses[1][here])
        curve = transfer.path(np.linspace(0.0, 1.0, _SAMPLES))
        of_robot = _lengths(*arm.robot.hand_pose(curve))
        kinds = [("moves", _MORE, "m"), ("turns", _MORE_ANGLE, "rad")]
        if transfer.pose.rotation is None:
            of_robot, of_person, kinds = of_robot[:1], of_person[:1], kinds[:1]
        for mine, theirs, (verb, more, unit) in zip(of_robot, of_person, kinds, strict=True):
            if mine > _FACTOR * theirs + more:
                person = f"the person {verb} it by {theirs:.2g} {unit}"
                yield f"{where} {verb} the hand by {mine:.2g} {unit}, {person}"
        seconds = float(time[group.stop] - time[group.start])
        if synergy.duration > _SLOW * seconds:
            yield f"{where} takes {synergy.duration / seconds:.2g} times the person's time"


def _lengths(rotations: Array, positions: Array) -> tuple[float, ...]:
    """Lengths of the hand's path in position [m] and in orientation [rad]."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    turns = np.linalg.norm(
        rotation_vector(rotations[1:] @ rotations[:-1].transpose(0, 2, 1)), axis=-1
    )
    return float(steps.sum()), float(turns.sum())
