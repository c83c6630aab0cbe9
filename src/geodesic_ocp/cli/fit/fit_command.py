"""`geodesic-ocp fit`: parameters of the metric from recordings."""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from geodesic_ocp.cli.analyse.recording import check_folder
from geodesic_ocp.cli.analyse.recording_options import stated
from geodesic_ocp.cli.fit.fit_options import as_parameter
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.figures.new_figure import new_figure, save_figure
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.fit_metric import fit_metric
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval, MetricFit, save_metric
from geodesic_ocp.fitting.parameter import Parameter, with_parameters
from geodesic_ocp.fitting.resampling import bootstrap_fit, leave_one_out, separate_fits
from geodesic_ocp.manifold.metrics import AdjustableKineticEnergy
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.recordings.read_recordings import read_recordings
from geodesic_ocp.recordings.recording import Recording
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.optimal_segmentations import segment_optimal
from geodesic_ocp.table import Table

_FEW = 10  # units of a bootstrap
_FAR = 3.0  # ratio of an estimate to its initial value


def fit_files(options: argparse.Namespace) -> None:
    """Fit the parameters, print and save the results.

    Raises:
        ValueError: wrong options, or files that cannot be used.
        NotConverged: the parameters were not found.
    """
    check_folder(options.out)
    parameters = [as_parameter(text) for text in options.parameter or ["joint_inertia"]]
    if options.bootstrap < 0:
        raise ValueError(f"--bootstrap must not be negative, got {options.bootstrap}")
    start = time.perf_counter()
    with printed_warnings(), closing(ProgressBar()) as bar:
        recordings = _recordings(options)
        subjects = len({each.subject for each in recordings})
        by = options.by or ("subject" if subjects > 1 else "recording")
        units = subjects if by == "subject" else len(recordings)
        if options.leave_one_out and units < 2:
            raise ValueError(f"--leave-one-out needs at least two {by}s, got {units}")
        fit = fit_metric(
            recordings,
            parameters,
            measure=options.measure,
            segments=_optimal_segments(options, parameters, recordings, bar),
            threshold=options.threshold,
            min_duration=options.min_duration,
            hysteresis=options.hysteresis,
            progress=bar,
        )
        intervals: tuple[ConfidenceInterval, ...] = ()
        resampled = options.bootstrap > 0 and units > 1
        curves = []
        if options.out or (resampled and len(parameters) == 1):
            curves = [error_profile(fit, each.name, progress=bar) for each in fit.estimates]
        if resampled:
            only = curves[0] if len(parameters) == 1 else None
            intervals = bootstrap_fit(fit, options.bootstrap, by=by, curve=only, progress=bar)
        tables = {"table": fit.table(intervals)}
        if len(recordings) > 1:
            tables["by_recording"] = _by_recording(fit, bar)
        if options.leave_one_out:
            tables["leave_one_out"] = leave_one_out(fit, by, progress=bar).table()
    _summarize(fit, intervals, tables, by, time.perf_counter() - start)
    if options.out:
        print()
        for file in write_together(
            options.out, lambda folder: _write(folder, fit, intervals, tables, curves)
        ):
            print(f"wrote {file}")


def _recordings(options: argparse.Namespace) -> list[Recording]:
    """The recordings in the files; with --skip, those of the sides that there are."""
    sides: list[Side] = ["right", "left"] if options.side == "both" else [options.side]
    found: list[Recording] = []
    for number, side in enumerate(sides, 1):
        try:
            found += read_recordings(
                options.file,
                side,
                height=options.height,
                mass=options.mass,
                cutoff=options.cutoff,
                duration=options.savitzky_golay,
                skip=options.skip,
                **stated(options),
            )
        except RecordingError as reason:
            if not options.skip or (number == len(sides) and not found):
                raise
            warnings.warn(f"no {side} arm: {reason}", stacklevel=1)
    return found


def _optimal_segments(
    options: argparse.Namespace,
    parameters: Sequence[Parameter],
    recordings: Sequence[Recording],
    bar: ProgressBar,
) -> list[list[tuple[int, int]]] | None:
    """The cuts of least error with the initial metric, if --penalty asks for them."""
    if options.penalty is None:
        return None
    start = [each.start for each in parameters]
    return [
        segment_optimal(
            with_parameters(AdjustableKineticEnergy(each.model), parameters, start),
            each.motion,
            penalty=options.penalty,
            progress=bar,
        )
        for each in recordings
    ]


def _by_recording(fit: MetricFit, bar: ProgressBar) -> Table:
    """Estimates from every recording alone."""
    names = (part for each in fit.estimates for part in (each.name, "standard error"))
    rows: list[tuple[str | int | float, ...]] = []
    alone = separate_fits(fit, progress=bar)
    for (name, each), recording in zip(alone.items(), fit.recordings, strict=True):
        numbers = (
            number
            for own in each.estimates
            for number in (own.value, "at its bound" if own.at_bound else own.standard_error)
        )
        remark = "not determined" if each.undetermined else ""
        rows.append((name, recording.subject, *numbers, float(each.errors[0]), remark))
    header = ("recording", "subject", *names, f"rms error [{fit.error_unit}]", "remark")
    return Table(header, tuple(rows))


def _summarize(
    fit: MetricFit,
    intervals: Sequence[ConfidenceInterval],
    tables: dict[str, Table],
    by: str,
    seconds: float,
) -> None:
    count, segments = len(fit.recordings), sum(part.count for part in fit.program.parts)
    print(
        f"{count} recording{'s'[: count - 1]}, {segments} segments that move, "
        f"{fit.outcome.iterations} iterations of Ipopt ({seconds:.1f} s in all)"
    )
    print(f"\n{tables['table']}")
    if intervals:
        count, unit = intervals[0].count, intervals[0].unit
        few = "; with so few it is a rough one" if count < _FEW else ""
        print(f"interval: bootstrap over {count} {unit}s{few}")
    for sentence in fit.undetermined:
        print(f"note: {sentence}")
    for parameter, estimate in zip(fit.parameters, fit.estimates, strict=True):
        if not parameter.start / _FAR < estimate.value < parameter.start * _FAR:
            print(
                f"note: the cuts were made with {estimate.name} = {parameter.start:g}; fit again "
                f"with --parameter {estimate.name}={estimate.value:.3g}"
            )
    for name, title in (
        ("by_recording", "each recording by itself"),
        ("leave_one_out", f"mean errors of each {by} that took no part in the estimation"),
    ):
        if name in tables:
            print(f"\n{title}\n\n{tables[name]}")


def _write(
    folder: Path,
    fit: MetricFit,
    intervals: Sequence[ConfidenceInterval],
    tables: dict[str, Table],
    curves: Sequence[ErrorProfile],
) -> None:
    profiles = {
        "profile" + (f"_{number}" if number > 1 else ""): curve.table()
        for number, curve in enumerate(curves, 1)
    }
    for name, table in {**tables, **profiles}.items():
        (folder / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
        (folder / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
    figure = new_figure(6.5 * len(curves), 4.2)
    for axes, curve in zip(np.ravel(figure.subplots(1, len(curves))), curves, strict=True):
        curve.draw(axes)
    save_figure(figure, folder)
    save_metric(folder / "metric.json", fit, intervals)
