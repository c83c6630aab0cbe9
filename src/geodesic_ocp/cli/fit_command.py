"""`geodesic-ocp fit`: parameters of the metric from recordings."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from geodesic_ocp.cli.fit_options import as_parameter
from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.cli.recording import check_folder
from geodesic_ocp.figures.new_figure import save_figure
from geodesic_ocp.fitting.bootstrap_fit import bootstrap_fit
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.fit_metric import fit_metric
from geodesic_ocp.fitting.leave_one_out import leave_one_out
from geodesic_ocp.fitting.metric_file import save_metric
from geodesic_ocp.fitting.metric_fit import Interval, MetricFit
from geodesic_ocp.fitting.separate_fits import separate_fits
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.recordings.read_recordings import read_recordings
from geodesic_ocp.synergies.recordings.recording import Recording
from geodesic_ocp.table import Table


def fit_files(options: argparse.Namespace) -> None:
    """Fit the parameters, print and save the results.

    Raises:
        ValueError: wrong options, or files that cannot be used.
        NotConverged: the parameters were not found.
    """
    check_folder(options.out)
    parameters = [as_parameter(text) for text in options.parameter or ["joint_inertia"]]
    start = time.perf_counter()
    with printed_warnings(), closing(ProgressBar()) as bar:
        recordings = _recordings(options)
        fit = fit_metric(
            recordings,
            parameters,
            measure=options.measure,
            threshold=options.threshold,
            progress=bar,
        )
        subjects = len({each.subject for each in recordings})
        by = options.by or ("subject" if subjects > 1 else "recording")
        units = subjects if by == "subject" else len(recordings)
        intervals: tuple[Interval, ...] = ()
        wanted = options.bootstrap > 0 and units > 1
        curve = error_profile(fit, progress=bar) if options.out or wanted else None
        if wanted:
            only = curve if len(parameters) == 1 else None
            intervals = bootstrap_fit(fit, options.bootstrap, by=by, curve=only, progress=bar)
        tables = {"table": fit.table(intervals)}
        if len(recordings) > 1:
            tables["by_recording"] = _by_recording(fit, bar)
        if options.leave_one_out:
            tables["leave_one_out"] = leave_one_out(fit, by, progress=bar).table()
    _summarise(fit, intervals, tables, time.perf_counter() - start)
    if options.out and curve is not None:
        print()
        for file in write_together(
            options.out, lambda folder: _write(folder, fit, intervals, tables, curve)
        ):
            print(f"wrote {file}")


def _recordings(options: argparse.Namespace) -> list[Recording]:
    sides: list[Side] = ["right", "left"] if options.side == "both" else [options.side]
    return [
        recording
        for side in sides
        for recording in read_recordings(
            options.file,
            side,
            height=options.height,
            mass=options.mass,
            cutoff=options.cutoff,
            duration=options.savitzky_golay,
            skip=options.skip,
        )
    ]


def _by_recording(fit: MetricFit, bar: ProgressBar) -> Table:
    """Estimates from every recording alone."""
    unit = "rad" if fit.program.parts[0].functions.measure == "joint" else "m"
    names = (part for each in fit.estimates for part in (each.name, "standard error"))
    rows: list[tuple[str | int | float, ...]] = []
    alone = separate_fits(fit, progress=bar)
    for (name, each), recording in zip(alone.items(), fit.recordings, strict=True):
        numbers = (number for own in each.estimates for number in (own.value, own.standard_error))
        rows.append((name, recording.subject, *numbers, float(each.errors[0])))
    return Table(("recording", "subject", *names, f"rms error [{unit}]"), tuple(rows))


def _summarise(
    fit: MetricFit, intervals: Sequence[Interval], tables: dict[str, Table], seconds: float
) -> None:
    count, segments = len(fit.recordings), sum(part.count for part in fit.program.parts)
    print(
        f"{count} recording{'s'[: count - 1]}, {segments} segments that move, "
        f"{fit.outcome.iterations} iterations of Ipopt ({seconds:.1f} s in all)"
    )
    print(f"\n{tables['table']}")
    if intervals:
        count, unit = intervals[0].count, intervals[0].unit
        print(f"interval: bootstrap over {count} {unit}s")
    for sentence in fit.undetermined:
        print(f"note: {sentence}")
    for name, title in (
        ("by_recording", "each recording by itself"),
        ("leave_one_out", "mean errors of what took no part in the estimation"),
    ):
        if name in tables:
            print(f"\n{title}\n\n{tables[name]}")


def _write(
    folder: Path,
    fit: MetricFit,
    intervals: Sequence[Interval],
    tables: dict[str, Table],
    curve: ErrorProfile,
) -> None:
    for name, table in {**tables, "profile": curve.table()}.items():
        (folder / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
        (folder / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
    save_figure(curve.plot(), folder)
    save_metric(folder / "metric.json", fit, intervals)
