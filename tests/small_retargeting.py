"""A retargeting that is found in a few seconds: a reach on another person's arm."""

from __future__ import annotations

from functools import cache

import numpy as np

import geodesic_ocp as go


@cache
def small_analysis() -> go.synergies.Analysis:
    """Of the reach for the box in the bundled recording."""
    whole = go.trajectory.bundled_recording()
    return go.analyse(whole.model, whole.motion.part(260, 429), metric="kinetic")


@cache
def small_retargeting(speed: float = 2.5, name: str = "robot") -> go.retargeting.Retargeting:
    """On an arm of the other side whose joints have this speed limit [rad/s]."""
    arm = go.human_arm("right", 1.95, 90.0)
    chain = arm.pin.copy()
    chain.velocityLimit = np.full(7, speed)
    chain.name = name
    robot = go.Model(chain, "hand", shapes=arm.bodies)
    aligned = go.retargeting.align(arm)
    return go.retarget(small_analysis(), robot, alignment=aligned, tolerance=1e-4)


@cache
def both_analyses() -> tuple[go.synergies.Analysis, go.synergies.Analysis]:
    """Of the right and the left arm; the right one moves as the mirrored left one."""
    analysis = small_analysis()
    motion = analysis.motion
    mirrored = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    names = tuple("R" + name[1:] for name in motion.joint_names)
    velocity = np.asarray(motion.velocity) * mirrored
    other = go.Motion(motion.time, motion.q * mirrored, names, velocity)
    return go.analyse(go.human_arm("right", 1.78), other, metric="kinetic"), analysis


@cache
def both_arms() -> go.retargeting.Retargeting:
    """Both arms of a person on two robots, a right arm and a left one."""
    robots = [go.human_arm(side, 1.95) for side in ("right", "left")]
    settings = go.retargeting.RetargetingSettings(merge=0.4, drop=0.3, speed_limits=False)
    return go.retargeting.retarget_arms(both_analyses(), robots, tolerance=1e-4, settings=settings)
