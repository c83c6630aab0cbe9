"""Recordings, read and analysed with the options of the command line."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from importlib.resources import as_file, files
from pathlib import Path
from typing import get_args

import numpy as np

from geodesic_ocp.cli.analyse.analysis_options import chosen_metric, chosen_segments, filtered
from geodesic_ocp.cli.analyse.error_curve import error_curve
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.human.human_arm import (
    DEFAULT_HEIGHT,
    DEFAULT_MASS,
    as_stature,
    human_arm,
)
from geodesic_ocp.recordings.plausible import check_plausible
from geodesic_ocp.recordings.read_motion import read_motion
from geodesic_ocp.synergies.analyse import analyse
from geodesic_ocp.synergies.analysis import Analysis
from geodesic_ocp.synergies.segmentation.segment import as_threshold
from geodesic_ocp.trajectory.motion import Motion

_LONGEST_STEP = 1.0  # [s] between samples of a recording


def analyse_file(options: argparse.Namespace, side: Side) -> Analysis:
    """Analyse one side of the recording in the file, and print the results.

    Raises:
        RecordingError: the file cannot be read, or has no arm of that side.
        ValueError: implausible time stamps, height, mass or threshold.
    """
    try:
        motion = read_motion(options.file, human_arm(side).joint_names)
    except RecordingError as error:
        other = next(each for each in get_args(Side) if each != side)
        with suppress(RecordingError):
            read_motion(options.file, human_arm(other).joint_names)
            raise ValueError(f"{error}; try --side {other}") from None
        raise
    try:
        motion = _in_seconds(motion, options.resample)
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}") from None
    return analyse_motion(motion, side, options.height, options.mass, options)


def _in_seconds(motion: Motion, rate: float | None) -> Motion:
    step = float(np.median(np.diff(motion.time)))
    if step >= _LONGEST_STEP:
        raise ValueError(f"samples are {step:g} s apart: is time in milliseconds? It must be in s")
    return motion if rate is None else motion.resampled(rate)


def analyse_bundled(options: argparse.Namespace) -> Analysis:
    """Analyse the bundled recording, and print the results."""
    options.file = "the bundled recording"
    print("The left arm of a person who climbs onto a box (motion capture, 7 s).")
    with as_file(files("geodesic_ocp") / "data" / "climb.csv") as file:
        motion = read_motion(file, human_arm("left").joint_names)
    return analyse_motion(motion, "left", None, None, options)


def save_analysis(analysis: Analysis, folder: Path | None, *, with_curve: bool = False) -> None:
    """Write the analysis to a folder, if one is given, and print the names of the files.

    With the curve of error against number of synergies, which is computed first, if wanted.
    """
    comparison = error_curve(analysis) if with_curve else None
    if folder is not None:
        written = analysis.save(folder, curve=comparison.draw if comparison else None)
        if comparison is not None:
            written += comparison.save(folder / "curve")
        print()
        for file in written:
            print(f"wrote {file}")


def check_folder(folder: Path | None) -> None:
    """Raise ValueError if the output folder cannot be written to, before any work is done."""
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file, not a folder")
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise ValueError(f"--out {folder}: cannot write to {nearest}")


def analyse_motion(
    motion: Motion,
    side: Side,
    height: float | None,
    mass: float | None,
    options: argparse.Namespace,
) -> Analysis:
    """Analyse a recording, and print the results."""
    assumed = []
    from_file = height is None and mass is None
    if height is None and (height := motion.subject.height) is None:
        height = DEFAULT_HEIGHT
        assumed.append(f"height {height} m")
    if mass is None and (mass := motion.subject.mass) is None:
        mass = DEFAULT_MASS
        assumed.append(f"mass {mass} kg")
    try:
        as_stature(height, mass)
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}" if from_file else str(error)) from None
    arm = human_arm(side, height, mass, armature=options.armature or 0.0)
    as_threshold(options.threshold)
    metric = chosen_metric(options, arm)
    start = time.perf_counter()
    try:
        with printed_warnings(), closing(ProgressBar()) as bar:
            motion = motion.select(arm.joint_names)
            check_plausible(arm, motion)
            motion = filtered(options, motion)
            analysis = analyse(
                arm,
                motion,
                options.threshold,
                metric=metric,
                segments=chosen_segments(options, metric, motion, arm, bar),
                rest=options.rest_speed,
                rest_duration=options.rest_duration,
                min_duration=options.min_duration,
                hysteresis=options.hysteresis,
                progress=bar,
            )
    except ValueError as error:
        raise ValueError(f"{options.file}: {error}") from None
    _summarize(analysis, height, mass, assumed, time.perf_counter() - start)
    return analysis


def _summarize(
    analysis: Analysis, height: float, mass: float, assumed: Sequence[str], seconds: float
) -> None:
    motion = analysis.motion
    who = f" of {motion.subject.name}" if motion.subject.name else ""
    print(
        f"{analysis.model.name}{who}, height {height:g} m, mass {mass:g} kg: "
        f"{len(motion)} samples, {motion.duration:.2f} s at {motion.rate:.0f} Hz"
    )
    if assumed:
        print(f"assumed, not in the recording: {', '.join(assumed)}")
    errors = analysis.errors["riemannian"]
    print(motion.filter or "The recording is taken as it is, without a filter.")
    print(f"Metric: {analysis.metric_name}.")
    rule = "" if analysis.threshold is None else f" at a threshold of {analysis.threshold:g} rad"
    print(
        f"{len(analysis.synergies)} geodesic synergies{rule} explain the joints to "
        f"{errors.joint:.3f} rad and the hand to {1000 * errors.position:.0f} mm on average "
        f"(found in {seconds:.1f} s)"
    )
    kind = "filtered" if motion.filter else "observed"
    print(f"\nmean errors against the {kind} recording\n\n{analysis.table()}")
    if analysis.errors_unfiltered:  # not without a filter
        table = analysis.table(unfiltered=True)
        print(f"\nmean errors against the unfiltered recording\n\n{table}")
