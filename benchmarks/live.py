"""Recordings replayed sample by sample on robots, beside the retargeting of whole recordings.

Usage: python benchmarks/live.py [FILE[:SIDE] ...] [--robots NAME ...]

The bundled recording is added to the MMM motions; without a side, both arms are taken. The robot
starts where the offline result does. Prints a table in Markdown, one row for each recording and
robot: delay of the hand behind the person's, for which its mean distance is least; mean errors of
the hand at the same instant and after that delay, beside those of the offline synergies and of
inverse kinematics (QP) in their time; largest shares of the limits; processor time of a step.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
import warnings
from typing import Any

import numpy as np
from retargeting import _recordings

import geodesic_ocp as go
from geodesic_ocp.synergies.scores import pose_errors
from geodesic_ocp.tables import markdown, new_table

RATE = 100.0  # [Hz]
SHIFTS = np.arange(-10, 31) * 0.01  # [s]
SETTLING = 0.5  # [s], until the filter has its samples
STATES = ("position", "velocity", "acceleration")
KINDS = (*STATES, "jerk", "torque", "torque_rate", "hand_speed")
HEADER = (
    *("recording", "robot", "delay [ms]", "hand [mm]", "[deg]", "after the delay [mm]", "[deg]"),
    *("synergies [mm]", "[deg]", "time / person's", "QP [mm]", "[deg]"),
    *(f"{kind} [limit]" for kind in KINDS),
    *("cuts, live", "offline", "of these live"),
    *("step, median [ms]", "99 %", "worst", "failures"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="MMM motions, FILE or FILE:left or FILE:right")
    parser.add_argument("--robots", nargs="+", default=("panda", "ur5"))
    options = parser.parse_args()
    models = {name: go.load_model(name) for name in options.robots}
    rows: list[tuple[Any, ...]] = []
    steps: list[float] = []
    for name, analysis in _recordings(options.files):
        for robot, model in models.items():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # poses out of reach
                found = go.retarget(analysis, model, throw=False)
            row = _row(analysis, found.arms[0], found.planned.stretch, steps)
            rows.append((name, robot, *row))
            print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    numbers = [[row[k] for row in rows] for k in range(2, len(HEADER) - 1)]
    rows.append(("median", "", *(float(np.median(each)) for each in numbers), ""))
    rows.append(("largest", "", *(float(np.max(each)) for each in numbers), ""))
    print(markdown(new_table(HEADER, tuple(rows))))
    print("Processor time of a step, all [ms]: median, 99 %, 99.9 %, worst:")
    print(*np.percentile(steps, [50, 99, 99.9, 100]).round(2))


def _row(
    analysis: go.synergies.Analysis, arm: Any, stretch: float, steps: list[float]
) -> list[Any]:
    """Entries of the table for one recording and robot; times of steps [ms] are added."""
    motion = analysis.motion
    raw = go.Motion(motion.time, motion.unfiltered, motion.joint_names).resampled(RATE)
    trajectory, cuts, taken = replayed(analysis.model, arm, raw)
    steps += taken
    times = trajectory.time[(trajectory.time > SETTLING) & (trajectory.time <= raw.duration)]
    hand = arm.robot.hand_pose(trajectory.states(times)[0])
    errors = []
    for shift in SHIFTS:
        instants = np.clip(raw.time[0] + times - shift, *motion.time[[0, -1]])
        errors.append(pose_errors(hand, arm.mapping(motion(instants))))
    best = int(np.argmin([each.position for each in errors]))
    shown = [1e3 * SHIFTS[best]]
    for each in (errors[int(np.argmin(np.abs(SHIFTS)))], errors[best]):
        shown += [1e3 * each.position, np.degrees(each.orientation)]
    for name in ("synergies", "ik"):
        each = arm.statistics[name]
        shown += [1e3 * each.position, float(np.degrees(each.orientation))]
        shown += [stretch] if name == "synergies" else []
    checked = go.execution.check_trajectory(
        trajectory, arm.robot, limits=arm.limits, gravity=arm.gravity
    )
    shown += [float(checked.usage[kind].max()) for kind in KINDS]
    offline = [motion.time[start] for start, _ in analysis.segments]
    near = sum(np.abs(np.array(cuts) - cut).min() <= 0.05 for cut in offline)
    shown += [len(cuts), len(offline), int(near), *np.percentile(taken, [50, 99, 100])]
    return [*shown, "; ".join(checked.violations)]


def replayed(
    person: go.Model, arm: Any, raw: go.Motion
) -> tuple[go.trajectory.JointTrajectory, tuple[float, ...], list[float]]:
    """The commands to a recording that is fed sample by sample, cuts, and times of steps [ms]."""
    start = np.clip(arm.motion.q[0], arm.robot.lower, arm.robot.upper)
    live = go.retargeting.LiveRetargeting(
        person,
        arm.robot,
        start,
        alignment=arm.mapping.target,
        person_alignment=arm.mapping.source,
        limits=arm.limits,
    )
    commands, taken = [live.command], []
    gc.collect()
    gc.freeze()  # a collection takes as long as many steps
    for instant, q in zip(raw.time, raw.q, strict=True):
        begin = time.thread_time()
        commands.append(live.step(instant, q))
        taken.append(1e3 * (time.thread_time() - begin))
    for instant in raw.time[-1] + np.arange(1, 101) / RATE:  # until it rests
        commands.append(live.step(instant))
    columns = [[getattr(each, name) for each in commands] for name in ("time", *STATES)]
    return (
        go.trajectory.JointTrajectory(*columns, arm.robot.joint_names, arm.robot.units),
        live.cuts,
        taken,
    )


if __name__ == "__main__":
    main()
