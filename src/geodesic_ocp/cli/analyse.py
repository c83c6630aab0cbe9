"""geodesic-ocp analyse: recordings cut into geodesic synergies."""

from __future__ import annotations

import glob
import shlex
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.cli.options import (
    AnalysisOptions,
    Flag,
    ManyOptions,
    ManyRecordings,
    each_side,
)
from geodesic_ocp.cli.study import study
from geodesic_ocp.cli.terminal import check_folder, print_written, printed_warnings, progress
from geodesic_ocp.drawing.plot import plot
from geodesic_ocp.drawing.styles import in_degrees
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side, Sides
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.read_recording import read_motion, stature_of
from geodesic_ocp.records import write_file
from geodesic_ocp.studies.analyse_recording import analyse_recording, read_by_settings
from geodesic_ocp.studies.analyse_recordings import BatchResult, analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.compare_metrics import MetricComparison, compare_metrics
from geodesic_ocp.studies.result_files import RecordingOutcome, mean_errors
from geodesic_ocp.studies.study_tables import PARQUET_HINT, has_parquet
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.tables import markdown, text
from geodesic_ocp.trajectory.bundled_recording import BUNDLED
from geodesic_ocp.trajectory.files.angle_tables import save_motion
from geodesic_ocp.trajectory.recording import (
    PASSIVE,
    PASSIVE_REASON,
    Recording,
    range_of_motion,
)

if TYPE_CHECKING:
    from pandas import DataFrame

# of possible cuts: at least [s], and about at most
_SPACING = 0.05
_CANDIDATES = 70


def analyse(
    file: list[str],
    /,
    *,
    side: Sides = "right",
    curve: Flag = False,
    out: Path | None = None,
    degrees: Flag = False,
    settings: Path | None = None,
    analysis: AnalysisOptions = AnalysisSettings(),  # noqa: B008
    many: ManyOptions = ManyRecordings(),  # noqa: B008
) -> int:
    """Cut recordings into geodesic synergies and compare with the baselines.

    Args:
        file: recording (MMM, AMC, BVH, OpenSim, c3d, SMPL .npz, or a table .csv). Several files, a
            folder or a pattern in quotes are analysed in parallel, with tables of all; an
            interrupted run goes on when the same command is given again.
        side: the arm.
        curve: also compare metrics at equal numbers of synergies, each with its best cuts.
        out: folder for tables, figures and synergies.
        degrees: state angles in degrees, in tables and figures of one recording.
        settings: file (.toml, .json) of any of these options, such as deviation = 0.05.
    """
    del settings
    check_folder(out)
    if (given := many.given()) or _are_many(file):
        return _analyse_many(file, side, curve, out, analysis, given)
    recording = Path(file[0])
    for each in each_side(side):
        folder = out / each if out is not None and side == "both" else out
        found = analyse_file(recording, each, analysis, folder, degrees)
        save_analysis(found, folder, analysis, with_curve=curve, degrees=degrees)
        if side == "both":
            print()
    named = f"{shlex.quote(str(recording))} --side {side}"
    shown = f"{named} --analyse"
    if out is not None:
        shown = shlex.quote(str(out)) + (f" {named}" if side != "both" else "")
    print(f"\nto see it in motion: geodesic-ocp show {shown}")
    return 0


def analyse_file(
    file: Path,
    side: Sides,
    settings: AnalysisSettings,
    folder: Path | None = None,
    degrees: bool = False,
) -> Analysis:
    """Analyse one arm of the recording in a file, or both as one model, and print the results.

    Args:
        file: the recording.
        side: the arm, or "both".
        settings: settings of the analysis.
        folder: folder for the fit to markers, if the recording has markers.
        degrees: print angles in degrees.

    Raises:
        RecordingError: the file cannot be read, or has no arm of that side.
        ValueError: implausible time stamps, height, mass or threshold.
    """
    try:
        recording = _read(file, side, settings)
    except RecordingError as error:
        other: Side = "left" if side == "right" else "right"
        if side == "both":
            raise
        if _has_arm(file, other, settings) and not _has_arm(file, side, settings):
            raise ValueError(f"{error}; try --side {other}") from None
        raise
    if recording.fit is not None:
        _show_fit(recording.fit, folder)
    return _analysed(recording, settings, str(file), degrees)


def save_analysis(
    analysis: Analysis,
    folder: Path | None,
    settings: AnalysisSettings,
    *,
    with_curve: bool = False,
    degrees: bool = False,
) -> None:
    """Write the analysis to a folder, if one is given, and print the names of the files.

    Args:
        analysis: the analysis.
        folder: folder for the files.
        settings: those of the analysis.
        with_curve: also compute the curve of the error against the number of synergies.
        degrees: state angles in degrees.
    """
    comparison = _error_curve(analysis, settings) if with_curve else None
    if folder is not None:
        uncertainty = analysis.uncertainty() if settings.uncertainty else None
        figure = plot(analysis, curve=comparison, uncertainty=uncertainty)
        written = analysis.save(
            folder,
            figure=in_degrees(figure) if degrees else figure,
            effort=settings.effort,
            uncertainty=uncertainty,
            degrees=degrees,
        )
        if comparison is not None:
            written += comparison.save(folder / "curve", figure=plot(comparison))
        print()
        print_written(written)


def analyse_bundled(settings: AnalysisSettings) -> Analysis:
    """Analyse the bundled recording, and print the results."""
    print("The left arm of a person who climbs onto a box (motion capture, 7 s).")
    recording = _read(BUNDLED, "left", settings)
    return _analysed(recording, settings, "the bundled recording")


def _read(file: Path, side: Sides, settings: AnalysisSettings) -> Recording:
    with printed_warnings():
        return read_by_settings(file, side, settings, settings.height, settings.mass)


def _has_arm(file: Path, side: Side, settings: AnalysisSettings) -> bool:
    stated = settings.reading()
    del stated["marker_set"], stated["person"]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they are printed by then
            read_motion(file, human_arm(side).joint_names, **stated)
    except ValueError:
        return False
    return True


def _show_fit(fit: MarkerFit, folder: Path | None) -> None:
    """Print how well the motion fits the markers, and write it to the folder, if one is given."""
    table = fit.table()
    print(f"Joint angles fitted to the markers ({fit.marker_set}) in {fit.seconds:.1f} s:")
    print(f"\n{text(table)}\n")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        written = [
            write_file(folder / "markers.csv", table.to_csv()),
            write_file(folder / "markers.md", markdown(table)),
            save_motion(folder / "motion.csv", fit.motion),
        ]
        print_written(written)
        print()


def analysed(recording: Recording, settings: AnalysisSettings, name: str) -> Analysis:
    """Analyse a recording with a progress bar.

    Raises:
        ValueError: the recording cannot be analysed, such as one that is too short; names it.
    """
    metric = settings.metric_of(recording.model)
    try:
        with progress() as bar:
            return analyse_recording(recording, settings, metric=metric, progress=bar)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _analysed(
    recording: Recording, settings: AnalysisSettings, file: str, degrees: bool = False
) -> Analysis:
    """Analyse a recording, and print the results."""
    start = time.perf_counter()
    analysis = analysed(recording, settings, file)
    _summarize(analysis, settings, time.perf_counter() - start, recording.fit, degrees)
    if settings.uncertainty:
        with progress() as bar:
            spread = analysis.uncertainty(progress=bar)
        print(f"\n{_text(spread.table(), degrees)}")
    return analysis


def _summarize(
    analysis: Analysis,
    settings: AnalysisSettings,
    seconds: float,
    fit: MarkerFit | None,
    degrees: bool,
) -> None:
    motion = analysis.motion
    subject = analysis.motion.subject
    height, mass = stature_of(subject, settings.height, settings.mass)
    who = f" of {subject.name}" if subject.name else ""
    print(
        f"{analysis.model.name}{who}, height {height:.4g} m, mass {mass:.4g} kg: "
        f"{len(motion)} samples, {motion.duration:.2f} s at {motion.rate:.0f} Hz"
    )
    assumed = []
    if settings.height is None and subject.height is None:
        assumed.append(f"height {height} m")
    if settings.mass is None and subject.mass is None:
        assumed.append(f"mass {mass} kg")
    if assumed:
        print(f"assumed, not in the recording: {', '.join(assumed)}")
    if fit is not None and not motion.filter:
        print("No further filter: the fit to the markers has smoothed the motion.")
    else:
        print(motion.filter or "The recording is taken as it is, without a filter.")
    if motion.outliers:
        print(f"Outliers: {'; '.join(map(str, motion.outliers))}.")
    if range_of_motion(motion) < PASSIVE:
        print(f"Note: {PASSIVE_REASON}; is the other arm meant (--side)?")
    print(f"Metric: {analysis.metric_name}.")
    print(f"Cuts: {analysis.cuts}.")
    errors = analysis.errors["riemannian"]
    joint = f"{np.degrees(errors.joint):.1f} deg" if degrees else f"{errors.joint:.3f} rad"
    print(
        f"{len(analysis.synergies)} geodesic synergies explain the joints to {joint} "
        f"and the hand to {1000 * errors.position:.0f} mm on average "
        f"(found in {seconds:.1f} s)"
    )
    kind = "filtered" if motion.filter else "observed" if fit is None else "fitted"
    print(f"\nmean errors against the {kind} recording\n\n{_text(analysis.table(), degrees)}")
    second = _text(analysis.second_order(effort=settings.effort), degrees)
    print(f"\nthe same segments with velocities at their ends, or as splines\n\n{second}")
    if analysis.errors_unfiltered:  # not without a filter
        table = _text(analysis.table(unfiltered=True), degrees)
        print(f"\nmean errors against the unfiltered recording\n\n{table}")


def _text(table: DataFrame, degrees: bool) -> str:
    return text(in_degrees(table) if degrees else table)


def _error_curve(analysis: Analysis, settings: AnalysisSettings) -> MetricComparison:
    """Compare metrics at equal numbers of synergies, each with its best cuts; print the errors."""
    spacing = max(_SPACING, analysis.motion.duration / _CANDIDATES)
    rules = {}
    if analysis.cutting is not None and settings.segments != "optimal":
        rules[analysis.cuts] = analysis.cutting
    with progress() as bar:
        comparison = compare_metrics(
            analysis.model, analysis.motion, spacing=spacing, rules=rules, progress=bar
        )
    print(
        f"\nmean errors with the cuts of least joint error for each metric, {spacing:.2f} s or "
        f"more apart\n\n{text(comparison.table())}"
    )
    return comparison


def _are_many(names: Sequence[str]) -> bool:
    """Return True if these are many recordings, with tables of all and a result file for each."""
    path = Path(names[0])
    return len(names) > 1 or path.is_dir() or (glob.has_magic(names[0]) and not path.exists())


def _analyse_many(
    names: Sequence[str],
    side: Sides,
    curve: bool,
    out: Path | None,
    settings: AnalysisSettings,
    given: dict[str, Any],
) -> int:
    """Analyse recordings, print each as it is finished, and the tables; return the exit code."""
    if curve:
        raise ValueError("--curve is of one recording, not of many")
    if out is None:
        first = next(iter(given), "").replace("_", "-")
        what = "several recordings need" if _are_many(names) else f"--{first} needs"
        raise ValueError(f"{what} --out, the folder of their results")
    if "jobs" in given and "scheduler" in given:
        raise ValueError("give either --jobs, processes of this computer, or --scheduler")
    if "time_limit" in given and "scheduler" in given:
        raise ValueError("--time-limit is for processes of this computer, not for --scheduler")
    pattern = given.pop("subject_from", None)
    address = given.pop("scheduler", None)
    with_study = given.pop("study", False)
    left_out: set[str] = set()
    with progress() as bar:

        def show(outcome: RecordingOutcome) -> None:
            if not outcome.success:
                left_out.add(outcome.source.name)
            if outcome.kind not in ("found", "missing"):
                text = str(outcome) if outcome.success else f"left out: {outcome}"
                bar.line(text + (f" ({outcome.seconds:.1f} s)" if outcome.seconds else ""))
                for warning in outcome.warnings:
                    bar.line(f"  note: {warning}")

        figures = given.pop("figures", False)
        try:
            with _cluster(address) as cluster:
                result = analyse_recordings(
                    names,
                    out,
                    side,
                    settings,
                    **given,
                    **cluster,
                    draw=plot if figures else None,
                    subject_pattern=pattern,
                    fit=with_study,
                    progress=bar,
                    finished=show,
                )
        except KeyboardInterrupt:
            bar.line("Finished recordings are kept: the same command goes on from here.")
            raise
    for outcome in result.failures:
        if outcome.source.name not in left_out:  # as the same motion as another
            print(f"left out: {outcome}")
    _summarize_many(result)
    if with_study and len(result.recordings()):
        print()
        study([out], out=out / "study")
    return 1 if result.failures else 0


@contextmanager
def _cluster(address: str | None) -> Iterator[dict[str, Any]]:
    """Yield the executor of a Dask cluster, and how many recordings to submit to it at a time.

    Without an address, nothing.

    Raises:
        ValueError: Dask is not installed, no scheduler answers, or it has no workers.
    """
    if address is None:
        yield {}
        return
    try:
        import distributed
    except ImportError:
        raise ValueError(
            "--scheduler needs Dask: pip install 'geodesic_ocp[cluster]', here and on the workers"
        ) from None
    new_client: Any = distributed.Client
    try:
        client = new_client(address, set_as_default=False)
    except (OSError, ValueError) as failure:
        raise ValueError(f"--scheduler {address}: no scheduler answers: {failure}") from None
    with client:
        workers = client.nthreads()
        if not workers:
            raise ValueError(f"--scheduler {address}: it has no workers")
        yield {"executor": client.get_executor(pure=False), "jobs": 3 * len(workers)}


def _summarize_many(result: BatchResult) -> None:
    rows = result.recordings()
    print(f"\n{result.counts}, in {result.seconds:.1f} s")
    if len(rows):
        print(f"\nmean errors over the recordings\n\n{text(mean_errors(rows))}")
    for note in result.notes:
        print(f"\nnote: {note}")
    print()
    print_written(result.files)
    if not has_parquet():
        print(f"{PARQUET_HINT}.")
