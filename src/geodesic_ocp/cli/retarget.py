"""geodesic-ocp retarget and demo: the synergies of a recording on robots."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from geodesic_ocp.cli.analyse import analyse_bundled, analyse_file, save_analysis
from geodesic_ocp.cli.kinds import REPORT
from geodesic_ocp.cli.options import (
    AnalysisOptions,
    GivenLimits,
    LimitOptions,
    RetargetingOptions,
    as_obstacle,
    each_side,
    with_load,
)
from geodesic_ocp.cli.terminal import (
    check_folder,
    print_written,
    printed_warnings,
    progress,
)
from geodesic_ocp.drawing.plot import plot
from geodesic_ocp.drawing.viewer import report as write_report
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.anthropometry import Side, Sides
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_alignment import Alignment, align, read_alignment
from geodesic_ocp.retargeting.paired_arm import MISSED
from geodesic_ocp.retargeting.place_base import BasePlacement, place_base
from geodesic_ocp.retargeting.result import Retargeting, waist_motion
from geodesic_ocp.retargeting.retarget import retarget_arms
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings, Segments
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.tables import text
from geodesic_ocp.trajectory.joint_trajectory import check_export

_LONGER = 1.005  # times the person's time, as it is shown
_FAULTS = 3  # of the trajectory that are printed
Mount: TypeAlias = Literal["auto", "fixed"]
# One alignment for each hand; None: the default, from which the robot may be moved.
_Arm: TypeAlias = tuple[Model, list[Alignment] | None]


def retarget(
    file: Path,
    /,
    *,
    robot: list[str],
    side: Sides = "right",
    hand: list[str] | None = None,
    base: list[str] | None = None,
    srdf: Path | None = None,
    alignment: list[Path] | None = None,
    mount: Mount | None = None,
    payload: str | None = None,
    obstacle: list[str] | None = None,
    rate: float = 100.0,
    out: Path | None = None,
    export: list[Path] | None = None,
    settings: Path | None = None,
    retargeting: RetargetingOptions = RetargetingSettings(),  # noqa: B008
    joint_limits: LimitOptions = GivenLimits(),  # noqa: B008
    analysis: AnalysisOptions = AnalysisSettings(),  # noqa: B008
) -> int:
    """Transfer the synergies of a recording to a robot; exit with 1 unless that is a success.

    It is none if paths or trajectory are not found, the trajectory fails its check, or a pose is
    missed by more than the tolerance. The reasons are printed, and the files written all the same.

    Args:
        file: recording, as for geodesic-ocp analyse.
        robot: name, such as panda (see geodesic-ocp models), or file (URDF, MJCF). With --side
            both: one body whose arms share a waist, such as g1, or two robots, right and left.
        side: the person's arm, or both; with one --robot both are one system with its waist.
        hand: hand (end-effector) frame of the robot; one for each --robot, or the right and the
            left one of a body.
        base: fixed frame of the robot that becomes its base, before which joints are locked; one
            for each --robot.
        srdf: SRDF file of the robot, whose disabled pairs of links are not kept apart (default: the
            one in the folder srdf beside that of the URDF).
        alignment: file of the robot's alignment with the person, as written by geodesic-ocp align;
            one for each --robot, or for each hand of a body.
        mount: auto: move the robot's base from where the alignment has it, by up to 0.3 m and 90
            degrees about the vertical, to where most poses are within reach at least cost. fixed:
            leave it there. By default, one robot without --alignment is moved if poses are out of
            reach, or the motion is slow or fails. Its obstacles move with it. With --out,
            alignment.json says where a moved robot stands (alignment_right.json and
            alignment_left.json for a body).
        payload: mass in every hand [kg], at the origin of its frame, or MASS,x,y,z at another
            centre, or with its inertia MASS,x,y,z,ixx,iyy,izz[,ixy,ixz,iyz] about it [kg m^2].
        obstacle: box:x,y,z,sx,sy,sz[,roll,pitch,yaw], ball:x,y,z,radius,
            capsule:x,y,z,x,y,z,radius or half-space:x,y,z,nx,ny,nz (a point and the outward
            normal), in the frame of the robot's base [m, rad]; repeatable.
        rate: sampling rate of the trajectory [Hz]; 1000 for libfranka.
        out: folder for tables, figures, synergies, the trajectory, and a page with person and robot
            in motion.
        export: file for the trajectory, .csv, .json (ROS 2), .npz, .parquet (LeRobot), .mcap
            (/joint_states) or .rrd (rerun); repeatable.
        settings: file (.toml, .json, .yaml) of any of these options, such as margin = 0.02.
    """
    del settings
    check_folder(out)
    for wanted in export or ():
        check_export(wanted)
    if mount == "auto" and len(robot) > 1:
        raise ValueError("--mount auto: for one --robot; two arms of one cannot be moved apart")
    of_arms = hand or (), base or (), alignment or ()
    is_body = side == "both" and len(robot) == 1
    sides: list[Sides] = [side] if is_body else [*each_side(side)]
    if is_body:
        arms = [_body(robot[0], *of_arms, srdf)]
    else:
        arms = _arms(robot, each_side(side), *of_arms, srdf)
    bodies = tuple(map(as_obstacle, obstacle or ()))
    retargeting = replace(retargeting, obstacles=bodies)
    robots, limits = joint_limits.of_robots([with_load(each, payload) for each, _ in arms])
    arms = [(each, aligned) for each, (_, aligned) in zip(robots, arms, strict=True)]
    analyses = []
    for each in sides:
        analyses.append(analyse_file(file, each, analysis))
        print()
    return _transfer(analyses, arms, limits, retargeting, rate, out, mount, export or ())


def demo(
    *,
    robot: str | None = None,
    metric: str = AnalysisSettings.metric,
    segments: Segments = AnalysisSettings.segments,
    limits: bool = True,
    out: Path = Path("geodesic_ocp_demo"),
) -> int:
    """Analyse the bundled recording, and transfer it to a robot if one is named.

    Args:
        robot: name of a robot, such as panda, to which the synergies are transferred.
        metric: joint-inertia, kinetic, euclidean, or a file that `fit` wrote (.json).
        segments: developed: cut where geodesics explain the whole motion best; online: cut where
            the motion leaves its geodesic, as in the paper.
        limits: keep the robot within its limits.
        out: folder for tables, figures, synergies and the robot's trajectory.
    """
    settings = AnalysisSettings(metric=metric, segments=segments)
    check_folder(out)
    if robot is None:
        save_analysis(analyse_bundled(settings), out, settings, with_curve=True)
        return 0
    arms = _arms([robot], ["left"])
    analysis = analyse_bundled(settings)
    save_analysis(analysis, out, settings)
    print()
    transfer = RetargetingSettings(limits=limits, speed_limits=limits)
    _, joints = GivenLimits().of_robots([each for each, _ in arms])
    return _transfer([analysis], arms, joints, transfer, 100.0, out / robot)


def _body(
    name: str,
    hands: Sequence[str],
    bases: Sequence[str],
    files: Sequence[Path],
    srdf: Path | None,
) -> _Arm:
    """Return a robot with both arms, and the alignments of its hands.

    Raises:
        ValueError: it has one hand, or another number of alignments.
    """
    if (hands and len(hands) != 2) or len(bases) > 1:
        raise ValueError(
            "--side both of one --robot: --hand twice, right and left, and --base once"
        )
    if not hands and name in ROBOTS and not ROBOTS[name].arms:
        raise ValueError(
            f"--robot: two robots, of the right and of the left arm, or a body with both such as "
            f"{', '.join(_bodies())}, got {name}"
        )
    with printed_warnings():
        base = bases[0] if bases else None
        robot = load_model(name, hand=hands or None, base=base, srdf=srdf)
        if files and len(files) != len(robot.hands):
            raise ValueError(f"--alignment: one for each of the hands {', '.join(robot.hands)}")
        if files:
            return robot, [read_alignment(file) for file in files]
        return robot, None


def _bodies() -> list[str]:
    return [name for name, robot in ROBOTS.items() if robot.arms]


def _arms(
    names: Sequence[str],
    sides: Sequence[Side],
    hands: Sequence[str] = (),
    bases: Sequence[str] = (),
    alignments: Sequence[Path] = (),
    srdf: Path | None = None,
) -> list[_Arm]:
    count = len(sides)
    if len(names) != count:
        what = "two robots, of the right and of the left arm" if count == 2 else "one robot"
        raise ValueError(f"--robot: {what}, got {', '.join(names)}")
    for option, each in (("hand", hands), ("base", bases), ("alignment", alignments)):
        if each and len(each) != count:
            raise ValueError(f"--{option}: one for each --robot, got {', '.join(map(str, each))}")
    none = [None] * count
    arms = []
    with printed_warnings():
        pairs = zip(names, sides, hands or none, bases or none, alignments or none, strict=True)
        for name, side, hand, base, file in pairs:
            if hand is None and name in _bodies():
                name = ROBOTS[name].arms[side == "left"]
            robot = load_model(name, hand=hand, base=base, srdf=srdf)
            arms.append((robot, None if file is None else [read_alignment(file)]))
    return arms


def _transfer(
    analyses: Sequence[Analysis],
    arms: Sequence[_Arm],
    limits: Sequence[JointLimits],
    settings: RetargetingSettings,
    rate: float,
    out: Path | None,
    mount: Mount | None = None,
    exports: Sequence[Path] = (),
) -> int:
    robots, alignments = zip(*arms, strict=True)
    placed: BasePlacement | None = None
    if mount == "auto":
        (given,) = alignments
        placed = place_base(
            robots[0], analyses, alignment=given, limits=limits[0], settings=settings
        )
        alignments = (list(placed.alignments),)
        print(f"{robots[0].name}: {placed}\n")
    elif mount:
        alignments = tuple(each or _default_alignments(robot) for robot, each in arms)
    with progress() as bar:
        result = retarget_arms(
            analyses,
            robots,
            alignments=alignments,
            limits=limits,
            rate=rate,
            settings=settings,
            progress=bar,
        )
    _summarize(result)
    if out is not None:
        print()
        print_written(result.save(out, figure=plot(result)))
        if placed := placed or result.arms[0].placement:
            notes = (str(placed),)
            names = [f"_{each.side}" for each in placed.alignments if len(placed.alignments) > 1]
            for aligned, name in zip(placed.alignments, names or [""], strict=True):
                print_written([aligned.save(out / f"alignment{name}.json", notes)])
        print_written([write_report(result, out / REPORT)])
        print(f"\nto see person and robot move: geodesic-ocp show {shlex.quote(str(out))}")
    print_written([result.trajectory.save(each) for each in exports])
    if result.faults:
        title = "not for a robot" if result.unfit else "poses missed by more than the tolerance"
        print(f"\n{title}:", *result.faults, sep="\n  ", file=sys.stderr)
    return 0 if result.success else 1


def _default_alignments(robot: Model) -> list[Alignment]:
    with printed_warnings():
        return [align(robot.with_hand(each)) for each in robot.hands]


def _summarize(result: Retargeting) -> None:
    for arm in result.arms:
        errors = np.array(list(arm.pose_errors.values()))
        inexact = int(np.sum(errors.max(axis=1) > MISSED))
        distance, angle = errors.max(axis=0) * (1e3, 180.0 / np.pi)
        poses = (
            f"the hand is off {inexact} of {len(errors)} poses, by at most {distance:.3g} mm, "
            f"{angle:.3g} deg, {len(arm.missed)} of them beyond the tolerance"
        )
        print(
            f"{arm.title}: {len(arm.analysis.synergies)} synergies become {len(arm.groups)}, "
            f"positions scaled by {arm.mapping.scale:.3g}; {poses}"
        )
    for arm in result.bodies:
        stated: dict[str, list[str]] = {}
        for kind, source in arm.limits.sources.items():
            stated.setdefault(source, []).append(kind.replace("_", " "))
        told = (f"{', '.join(kinds)}: {source}" for source, kinds in stated.items())
        print(f"limits of {arm.robot.name}: {'; '.join(told)}")
        if arm.robot.shared_joints:
            print(waist_motion(arm))
    time = "the person's time"
    if result.stretch > _LONGER:
        time = f"{result.stretch:.2f} times the person's time, as the joints' limits require"
    print(f"it takes {time}; computed in {result.seconds:.1f} s ({result.settings.formulation})")
    faults = "; ".join(result.check.violations[:_FAULTS]) or "all conditions hold"
    near = result.check.clearance
    apart = "not known" if near is None else f"{near:.3g} m"
    bodies = "links and obstacles" if result.settings.obstacles else "links"
    print(f"trajectory at {result.rate:g} Hz: {faults}; least distance of {bodies}: {apart}\n")
    print(text(result.synergy_table()))
    print(
        "\nagainst inverse kinematics that tracks the whole path of the hand\n\n"
        f"{text(result.table())}"
    )
