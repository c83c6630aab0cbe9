"""Recordings on robots: numbers of synergies, hand pose errors, inverse kinematics, and times.

Times are those of a second run in the same process; of the first as well with --first.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.model.human.anthropometry import Side

ROBOTS = ("armar6-left", "armar6-right", "panda", "talos-left-arm", "xarm7")
REACHED = 1e-6  # [m] and [rad]
FINE = 20  # points per node of the grid at which limits are checked


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="MMM motions; the bundled one is added")
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--sides", nargs="+", default=["right", "left"])
    parser.add_argument("--formulation", default="constrained")
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--first", action="store_true", help="time the first run, not the second")
    parser.add_argument("--check", action="store_true", help="fail if a pose is not reached")
    options = parser.parse_args()
    recordings = []
    for file in options.files:
        for side in options.sides:
            recordings.append((f"{file.stem} {side}", _read(file, side)))
    with as_file(files("geodesic_ocp") / "data" / "climb.csv") as file:
        recordings.append(("bundled left", _read(file, "left")))
    print(
        "| recording | robot | synergies | out of reach | reached | position [m] | rotation [rad] "
        "| limit violation | action over IK | stretch | iterations "
        "| synergy: median, p90, worst [ms] | time [s] |"
    )
    print("| --- | --- " + "| ---: " * 11 + "|")
    failed = False
    for name, analysis in recordings:
        for robot in options.robots:
            settings = go.RetargetingSettings(formulation=options.formulation)
            if not options.first:
                _retarget(analysis, robot, settings, options.tolerance)
            failed |= _run(name, analysis, robot, settings, options.tolerance)
    if options.check and failed:
        sys.exit("a pose within reach was not reached, or a limit was exceeded")


def _read(file: Path, side: Side) -> go.Analysis:
    motion = go.read_motion(file, go.human_arm(side).joint_names)
    arm = go.human_arm(side, motion.subject.height or 1.75, motion.subject.mass or 70.0)
    return go.analyse(arm, motion)


def _retarget(
    analysis: go.Analysis, robot: str, settings: go.RetargetingSettings, tolerance: float
) -> tuple[go.Retargeting, list[float], float]:
    """The result, the time [s] of each synergy, and that of all."""
    instants: list[float] = []

    def progress(label: str, done: int, total: int) -> None:
        del done, total
        if label.startswith("planning"):
            instants.append(time.perf_counter())

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about the file, and about poses out of reach
        model = go.load_model(robot)
        begin = time.perf_counter()
        found = go.retarget(
            *(analysis, model),
            settings=settings,
            tolerance=tolerance,
            throw=False,
            progress=progress,
        )
    return found, np.diff(instants).tolist(), time.perf_counter() - begin


def _run(
    name: str,
    analysis: go.Analysis,
    robot: str,
    settings: go.RetargetingSettings,
    tolerance: float,
) -> bool:
    """Print one line of the table; whether a pose or a limit was not met."""
    found, each, seconds = _retarget(analysis, robot, settings, tolerance)
    model = found.arms[0].robot
    times = [1e3 * np.quantile(each, fraction) for fraction in (0.5, 0.9, 1.0)]
    (arm,) = found.arms
    targeted = [
        transfer
        for transfer, group in zip(arm.transfers, arm.groups, strict=True)
        if group.kind != "rest" and transfer.within_reach
    ]
    reached = [
        t for t in targeted if t.success and max(t.position_error, t.rotation_error) <= REACHED
    ]
    violation = max(_limit_violation(model, synergy) for synergy in arm.synergies)
    ratio = arm.statistics["synergies"].action / arm.statistics["ik"].action
    print(
        f"| {name} | {robot} | {len(analysis.synergies)} -> {len(arm.groups)} "
        f"| {len(arm.out_of_reach)} | {len(reached)} of {len(targeted)} "
        f"| {max((t.position_error for t in targeted), default=0.0):.1e} "
        f"| {max((t.rotation_error for t in targeted), default=0.0):.1e} "
        f"| {violation:.1e} | {ratio:.2f} | {found.stretch:.2f} "
        f"| {sum(t.iterations for t in arm.transfers)} "
        f"| {times[0]:.0f}, {times[1]:.0f}, {times[2]:.0f} | {seconds:.2f} |",
        flush=True,
    )
    for transfer in targeted:
        if not any(transfer is each for each in reached):
            print("   ", transfer.status)
    return len(reached) < len(targeted) or (
        settings.formulation == "constrained" and violation > 0.0
    )


def _limit_violation(model: go.Model, synergy: go.Synergy) -> float:
    """Largest excess over the limits anywhere on the path."""
    q = synergy.path(np.linspace(0.0, 1.0, FINE * synergy.path.grid.size))
    return max(0.0, float(np.maximum(model.lower - q, q - model.upper).max()))


if __name__ == "__main__":
    main()
