"""Recordings on robots."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from geodesic_ocp.cli.interrupts import Bar
from geodesic_ocp.cli.recording import bundled, check_folder, recorded, save
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.model import Model
from geodesic_ocp.report.report import report
from geodesic_ocp.retargeting.alignment import alignment
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.retarget import retarget
from geodesic_ocp.synergies.analyse import Analysis

_REPORT = "report.html"


def retarget_file(options: argparse.Namespace) -> None:
    """`geodesic-ocp retarget`."""
    check_folder(options.out)
    sides: list[Side] = ["right", "left"] if options.side == "both" else [options.side]
    robots = _robots(options.robot, len(sides))
    analyses = []
    for side in sides:
        analyses.append(recorded(options, side))
        print()
    _transfer(analyses, robots, options)


def demo_on_robot(options: argparse.Namespace) -> None:
    """`geodesic-ocp demo --robot`."""
    robots = _robots([options.robot], 1)
    options.report = True
    analysis = bundled(options)
    save(analysis, options.out)
    print()
    options.out = options.out / options.robot
    _transfer([analysis], robots, options)


def _robots(names: Sequence[str], count: int) -> list[Model]:
    if len(names) != count:
        what = "two robots, of the right and of the left arm" if count == 2 else "one robot"
        raise ValueError(f"--robot: {what}, got {', '.join(names)}")
    with _said():
        robots = [load_model(name) for name in names]
    for robot in robots:
        alignment(robot)  # says so where there is none
    return robots


def _transfer(
    analyses: Sequence[Analysis], robots: Sequence[Model], options: argparse.Namespace
) -> None:
    with _said(), closing(Bar()) as bar:
        found = retarget(
            analyses,
            robots,
            formulation=options.formulation,
            limits=options.limits,
            speed_limits=options.limits,
            orientation_weight=0.0 if options.position_only else 1.0,
            num_starts=options.num_starts,
            rest=options.rest,
            progress=bar,
        )
    _summarise(found)
    if options.out is None and options.report:
        options.out = Path("geodesic_ocp_retarget")
    if options.out is not None:
        print()
        files = found.save(options.out)
        if options.report:
            files.append(report(found, options.out / _REPORT))
        for file in files:
            print(f"wrote {file}")


@contextmanager
def _said() -> Iterator[None]:
    """Warnings as lines of text: of the robot's file, and of poses that are out of reach."""
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = _print_warning
        yield


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"note: {message}")


def _summarise(found: Retargeting) -> None:
    for arm in found.arms:
        worst = max(max(each.position_error, each.rotation_error) for each in arm.transfers)
        far = len(arm.out_of_reach)
        print(
            f"{arm.title}: {len(arm.analysis.synergies)} synergies become {len(arm.groups)}, "
            f"positions scaled by {arm.scale:.3g}; the hand is at the poses to {worst:.1e} m or rad"
            f"{f', {far} of them out of reach' if far else ''}"
        )
    time = "the person's"
    if found.stretch > 1.0:
        time = f"{found.stretch:.2f} times the person's, as joints are not as fast"
    print(f"time is {time}; found in {found.seconds:.1f} s ({found.formulation})\n")
    print(found.synergy_table())
    print(f"\nagainst inverse kinematics that follows the whole way of the hand\n\n{found.table()}")
