"""Recordings on robots: how many synergies, how well the hand's poses are met, against IK."""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

import geodesic_ocp as go

ROBOTS = ("armar6-left", "armar6-right", "panda", "talos-left-arm", "xarm7")
REACHED = 1e-6  # [m] and [rad]
FINE = 20  # places between two samples at which limits are looked at


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="MMM motions; the bundled one, too")
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--sides", nargs="+", default=["right", "left"])
    parser.add_argument("--formulation", default="constrained")
    parser.add_argument("--check", action="store_true", help="fail where a pose is not met")
    options = parser.parse_args()
    recordings = []
    for file in options.files:
        for side in options.sides:
            recordings.append((f"{file.stem} {side}", _read(file, side)))
    with as_file(files("geodesic_ocp") / "data" / "reach.csv") as file:
        recordings.append(("bundled left", _read(file, "left")))
    print(
        "| recording | robot | synergies | out of reach | met | position [m] | rotation [rad] "
        "| outside limits | energy over IK | stretch | iterations | seconds |"
    )
    print("| --- | --- " + "| ---: " * 10 + "|")
    failed = False
    for name, analysis in recordings:
        for robot in options.robots:
            failed |= _run(name, analysis, robot, options.formulation)
    if options.check and failed:
        sys.exit("a pose within reach was not met, or a limit was exceeded")


def _read(file: Path, side: go.model.anthropometry.Side) -> go.Analysis:
    motion = go.read_motion(file, go.human_arm(side).joint_names)
    arm = go.human_arm(side, motion.subject.height or 1.75, motion.subject.mass or 70.0)
    return go.analyse(arm, motion)


def _run(name: str, analysis: go.Analysis, robot: str, formulation: str) -> bool:
    """One line of the table; whether something is wrong."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the file, and of poses out of reach
        model = go.load_model(robot)
        begin = time.perf_counter()
        found = go.retarget(analysis, model, formulation=formulation, throw=False)
    seconds = time.perf_counter() - begin
    (arm,) = found.arms
    asked = [
        transfer
        for transfer, group in zip(arm.transfers, arm.groups, strict=True)
        if group.kind != "rest" and transfer.within_reach
    ]
    met = [t for t in asked if t.success and max(t.position_error, t.rotation_error) <= REACHED]
    outside = max(_outside(model, synergy) for synergy in arm.synergies)
    figures = arm.figures
    ratio = figures["synergies"].energy / figures["ik"].energy
    print(
        f"| {name} | {robot} | {len(analysis.synergies)} -> {len(arm.groups)} "
        f"| {len(arm.out_of_reach)} | {len(met)} of {len(asked)} "
        f"| {max((t.position_error for t in asked), default=0.0):.1e} "
        f"| {max((t.rotation_error for t in asked), default=0.0):.1e} "
        f"| {outside:.1e} | {ratio:.2f} | {found.stretch:.2f} "
        f"| {sum(t.iterations for t in arm.transfers)} | {seconds:.1f} |",
        flush=True,
    )
    for transfer in asked:
        if not any(transfer is each for each in met):
            print("   ", transfer.status)
    return len(met) < len(asked) or (formulation == "constrained" and outside > 0.0)


def _outside(model: go.Model, synergy: go.Synergy) -> float:
    """By how much the path leaves the limits anywhere."""
    q = synergy.path(np.linspace(0.0, 1.0, FINE * synergy.path.grid.size))
    return max(0.0, float(np.maximum(model.lower - q, q - model.upper).max()))


if __name__ == "__main__":
    main()
