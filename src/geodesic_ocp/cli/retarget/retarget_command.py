"""`geodesic-ocp retarget`, and `demo --robot`: the synergies of a recording on robots."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

from geodesic_ocp.cli.analyse.analysis_options import check_options
from geodesic_ocp.cli.analyse.recording import (
    analyse_bundled,
    analyse_file,
    check_folder,
    save_analysis,
)
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.cli.trajectory.limit_values import given_limits
from geodesic_ocp.cli.viewer_extra import require_pages, why_no_pages
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.model import Model
from geodesic_ocp.reports.report import report
from geodesic_ocp.retargeting.alignment.alignment import alignment, read_alignment
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.retarget import retarget_arms
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.analyse import Analysis

_LONGER = 1.005  # times the person's time, as it is shown
_FAULTS = 3  # of the trajectory that are printed
_REPORT = "report.html"
_Arm: TypeAlias = tuple[Model, Alignment]


def retarget_file(options: argparse.Namespace) -> None:
    """`geodesic-ocp retarget`."""
    check_options(options)
    check_folder(options.out)
    if options.report:
        require_pages()
    sides: list[Side] = ["right", "left"] if options.side == "both" else [options.side]
    robots = _robots(options, options.robot, len(sides))
    analyses = []
    for side in sides:
        analyses.append(analyse_file(options, side))
        print()
    _transfer(analyses, robots, options)


def demo_on_robot(options: argparse.Namespace) -> None:
    """`geodesic-ocp demo --robot`."""
    robots = _robots(options, [options.robot], 1)
    missing = why_no_pages()
    options.report = not missing
    if missing:
        print(f"note: no {_REPORT} will be written: {missing}")
    analysis = analyse_bundled(options)
    save_analysis(analysis, options.out)
    print()
    options.out = options.out / options.robot
    _transfer([analysis], robots, options)


def _robots(options: argparse.Namespace, names: Sequence[str], count: int) -> list[_Arm]:
    if len(names) != count:
        what = "two robots, of the right and of the left arm" if count == 2 else "one robot"
        raise ValueError(f"--robot: {what}, got {', '.join(names)}")
    given = []
    for option in ("hand", "base", "alignment"):
        each = getattr(options, option) or [None] * count
        if len(each) != count:
            raise ValueError(f"--{option}: one for each --robot, got {', '.join(map(str, each))}")
        given.append(each)
    arms = []
    with printed_warnings():
        for name, hand, base, file in zip(names, *given, strict=True):
            robot = load_model(name, hand=hand, base=base)
            arms.append((robot, alignment(robot) if file is None else read_alignment(file)))
    return arms


def _transfer(
    analyses: Sequence[Analysis], arms: Sequence[_Arm], options: argparse.Namespace
) -> None:
    robots = [robot for robot, _ in arms]
    alignments = [aligned for _, aligned in arms]
    if options.payload is not None:
        robots = [robot.with_payload(options.payload) for robot in robots]
    settings = RetargetingSettings(
        formulation=options.formulation,
        limits=options.limits,
        speed_limits=options.limits,
        orientation_weight=0.0 if options.position_only else 1.0,
        num_starts=options.num_starts,
        rest=options.rest,
        rotor_inertia=options.rotor_inertia,
        likeness_weight=options.likeness,
        posture_weight=options.posture,
        self_collision=options.self_collision,
        scale=options.scale,
        margin=options.margin,
        near_misses=options.near_misses,
    )
    with printed_warnings(), closing(ProgressBar()) as bar:
        result = retarget_arms(
            analyses,
            robots,
            alignments=alignments,
            limits=given_limits(options, robots),
            rate=options.rate,
            settings=settings,
            progress=bar,
        )
    _summarize(result)
    if options.out is None and options.report:
        options.out = Path("geodesic_ocp_retarget")
    if options.out is not None:
        print()
        files = result.save(options.out)
        if options.report:
            files.append(report(result, options.out / _REPORT))
        for file in files:
            print(f"wrote {file}")
        if not options.report:
            print(f"\nto see the robot move: geodesic-ocp show {shlex.quote(str(options.out))}")


def _summarize(result: Retargeting) -> None:
    for arm in result.arms:
        worst = max(max(each.position_error, each.rotation_error) for each in arm.transfers)
        unreached = len(arm.out_of_reach)
        print(
            f"{arm.title}: {len(arm.analysis.synergies)} synergies become {len(arm.groups)}, "
            f"positions scaled by {arm.mapping.scale:.3g}; largest pose error {worst:.1e} m or rad"
            f"{f', {unreached} poses out of reach' if unreached else ''}"
        )
    time = "the person's time"
    if result.stretch > _LONGER:
        time = f"{result.stretch:.2f} times the person's time, as the joints' limits require"
    print(f"it takes {time}; computed in {result.seconds:.1f} s ({result.settings.formulation})")
    faults = "; ".join(result.check.violations[:_FAULTS]) or "all conditions hold"
    near = result.check.clearance
    apart = "not known" if near is None else f"{near:.3g} m"
    print(f"trajectory at {result.rate:g} Hz: {faults}; least distance of links: {apart}\n")
    print(result.synergy_table())
    print(
        f"\nagainst inverse kinematics that tracks the whole path of the hand\n\n{result.table()}"
    )
