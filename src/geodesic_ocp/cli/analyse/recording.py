"""Recordings, read and analysed with the options of the command line."""

from __future__ import annotations

import argparse
import os
import time
import warnings
from collections.abc import Sequence
from contextlib import closing
from importlib.resources import as_file, files
from pathlib import Path
from typing import get_args

from geodesic_ocp.cli.analyse.analysis_options import settings_of
from geodesic_ocp.cli.analyse.error_curve import error_curve
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.read_recording import read_motion, stature_of
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.recordings.save_motion import save_motion
from geodesic_ocp.records import write_file
from geodesic_ocp.studies.batch.analyse_recording import analyse_recording, read_by_settings
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.synergies.analyse import Analysis


def analyse_file(options: argparse.Namespace, side: Side) -> Analysis:
    """Analyse one side of the recording in the file, and print the results.

    Raises:
        RecordingError: the file cannot be read, or has no arm of that side.
        ValueError: implausible time stamps, height, mass or threshold.
    """
    settings = settings_of(options)
    try:
        recording = _read(options.file, side, settings)
    except RecordingError as error:
        other = next(each for each in get_args(Side) if each != side)
        if _has_arm(options.file, other, settings) and not _has_arm(options.file, side, settings):
            raise ValueError(f"{error}; try --side {other}") from None
        raise
    if recording.fit is not None:
        _show_fit(recording.fit, options.out)
    return _analyse(recording, settings, str(options.file))


def _show_fit(fit: MarkerFit, folder: Path | None) -> None:
    """Print how well the motion fits the markers, and write it to the folder, if one is given."""
    table = fit.table()
    print(f"Joint angles fitted to the markers ({fit.marker_set}) in {fit.seconds:.1f} s:")
    print(f"\n{table}\n")
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    for file in (
        write_file(folder / "markers.csv", table.csv()),
        write_file(folder / "markers.md", table.markdown()),
        save_motion(folder / "motion.csv", fit.motion),
    ):
        print(f"wrote {file}")
    print()


def analyse_bundled(options: argparse.Namespace) -> Analysis:
    """Analyse the bundled recording, and print the results."""
    print("The left arm of a person who climbs onto a box (motion capture, 7 s).")
    settings = settings_of(options)
    with as_file(files("geodesic_ocp") / "data" / "climb.csv") as file:
        recording = _read(file, "left", settings)
    return _analyse(recording, settings, "the bundled recording")


def _has_arm(file: Path, side: Side, settings: AnalysisSettings) -> bool:
    stated = {
        name: each
        for name, each in settings.of_formats().items()
        if name not in ("up", "marker_set")
    }
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are printed by then
            read_motion(file, human_arm(side).joint_names, **stated)
    except ValueError:
        return False
    return True


def _read(file: Path, side: Side, settings: AnalysisSettings) -> Recording:
    with printed_warnings():
        return read_by_settings(file, side, settings, settings.height, settings.mass)


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


def _analyse(recording: Recording, settings: AnalysisSettings, file: str) -> Analysis:
    """Analyse a recording, and print the results."""
    metric = settings.metric_of(recording.model)
    start = time.perf_counter()
    try:
        with printed_warnings(), closing(ProgressBar()) as bar:
            analysis = analyse_recording(recording, settings, metric=metric, progress=bar)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    subject = recording.motion.subject
    height, mass = stature_of(subject, settings.height, settings.mass)
    assumed = []
    if settings.height is None and subject.height is None:
        assumed.append(f"height {height} m")
    if settings.mass is None and subject.mass is None:
        assumed.append(f"mass {mass} kg")
    _summarize(analysis, height, mass, assumed, time.perf_counter() - start, recording.fit)
    return analysis


def _summarize(
    analysis: Analysis,
    height: float,
    mass: float,
    assumed: Sequence[str],
    seconds: float,
    fit: MarkerFit | None,
) -> None:
    motion = analysis.motion
    who = f" of {motion.subject.name}" if motion.subject.name else ""
    print(
        f"{analysis.model.name}{who}, height {height:.4g} m, mass {mass:.4g} kg: "
        f"{len(motion)} samples, {motion.duration:.2f} s at {motion.rate:.0f} Hz"
    )
    if assumed:
        print(f"assumed, not in the recording: {', '.join(assumed)}")
    errors = analysis.errors["riemannian"]
    if fit is not None and not motion.filter:
        print("No further filter: the fit to the markers has smoothed the motion.")
    else:
        print(motion.filter or "The recording is taken as it is, without a filter.")
    print(f"Metric: {analysis.metric_name}.")
    rule = "" if analysis.threshold is None else f" at a threshold of {analysis.threshold:g} rad"
    print(
        f"{len(analysis.synergies)} geodesic synergies{rule} explain the joints to "
        f"{errors.joint:.3f} rad and the hand to {1000 * errors.position:.0f} mm on average "
        f"(found in {seconds:.1f} s)"
    )
    kind = "filtered" if motion.filter else "observed" if fit is None else "fitted"
    print(f"\nmean errors against the {kind} recording\n\n{analysis.table()}")
    if analysis.errors_unfiltered:  # not without a filter
        table = analysis.table(unfiltered=True)
        print(f"\nmean errors against the unfiltered recording\n\n{table}")
