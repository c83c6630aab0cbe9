"""Planned trajectories beside the same paths timed by TOPP-RA and by Ruckig.

Usage: python benchmarks/other_timings.py FILE [FILE ...] [--side right] [--robots NAME ...]

Needs the extras timing and robots. Prints a table in Markdown for each recording and robot.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import geodesic_ocp as go
from geodesic_ocp.execution.other_timings.compare_timings import compare_timings


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--side", choices=("right", "left"), default="right")
    parser.add_argument("--robots", nargs="+", default=["panda", "xarm7", "armar6-right"])
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    arm = go.human_arm(options.side)
    for file in options.files:
        motion = go.read_motion(file, arm.joint_names)
        subject = motion.subject
        person = go.human_arm(options.side, subject.height or 1.75, subject.mass or 70.0)
        analysis = go.analyse(person, motion)
        for name in options.robots:
            planned = go.retarget(analysis, go.load_model(name)).planned
            ratio = f"{planned.stretch:.2f} times the person's {motion.duration:.2f} s"
            print(f"{file.stem} on {name}, planned in {ratio}:\n")
            print(compare_timings(planned).markdown(), flush=True)


if __name__ == "__main__":
    main()
