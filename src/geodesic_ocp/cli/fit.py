"""geodesic-ocp fit: parameters of the metric, estimated from recordings."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter as Option

from geodesic_ocp.cli.options import FitOptions, Flag, each_side
from geodesic_ocp.cli.terminal import check_folder, print_written, progress
from geodesic_ocp.drawing.profile_figure import profiles_figure
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.figures import save_figure
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.fit_metric import fit_metric
from geodesic_ocp.fitting.metric_fit import ConfidenceInterval, MetricFit, save_metric
from geodesic_ocp.fitting.parameter import JOINT_INERTIA, Parameter
from geodesic_ocp.fitting.resampling import (
    FEWEST,
    Heterogeneity,
    bootstrap_fit,
    heterogeneity,
    separate_fits,
)
from geodesic_ocp.fitting.resampling import leave_one_out as predicted
from geodesic_ocp.fitting.segment_terms import Measure
from geodesic_ocp.model.anthropometry import Sides
from geodesic_ocp.recordings.read_recordings import read_recordings
from geodesic_ocp.records import write_together
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.synergies.optimal_segmentations import segment_optimal
from geodesic_ocp.synergies.segment_costs import Curve
from geodesic_ocp.tables import new_table, save_tables, text
from geodesic_ocp.trajectory.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame

_FEW = 10  # units of a bootstrap
_SIGNIFICANT = 0.05  # p-value below which estimates disagree
_FAR = 3.0  # ratio of an estimate to its initial value
_USUAL = {
    "joint_inertia": JOINT_INERTIA,
    "armature": Parameter("armature", 0.05, lower=1e-5),
    "payload": Parameter("payload", 0.5),
    "mass_ratio": Parameter("mass_ratio", 1.0, lower=1e-2, upper=1e2),
    "height_ratio": Parameter("height_ratio", 1.0, lower=0.3, upper=3.0),
    "link_mass_ratios": Parameter("link_mass_ratios", 1.0, lower=1e-2, upper=1e2),
    "link_inertia_ratios": Parameter("link_inertia_ratios", 1.0, lower=1e-2, upper=1e2),
}
_PARAMETER = Option(
    help=f"NAME[:JOINT,...][=START], with the names {', '.join(_USUAL)}; of some joints only with "
    "patterns, as in `armature:?S?_joint` for the shoulder; repeatable [default: joint_inertia]"
)


def fit(
    file: list[Path],
    /,
    *,
    side: Sides = "right",
    parameter: Annotated[list[str] | None, _PARAMETER] = None,
    measure: Measure = "joint",
    curve: Curve = "geodesic",
    penalty: float | None = None,
    by: Literal["recording", "subject"] | None = None,
    bootstrap: int = 1000,
    leave_one_out: Flag = False,
    skip: Flag = False,
    out: Path | None = None,
    settings: Path | None = None,
    analysis: FitOptions = AnalysisSettings(),  # noqa: B008
) -> None:
    """Estimate parameters of the metric from recordings.

    Cuts are made with the initial values of the parameters.

    Args:
        file: recordings, or folders of recordings.
        side: the arm.
        measure: errors of the joints [rad] or of the hand's position [m].
        curve: what predicts a segment: geodesics, or Riemannian cubics, which also receive the
            velocities at the cuts.
        penalty: cut where the error becomes least instead, with this mean joint error for each
            segment [rad].
        by: units that are resampled and left out; default: subjects where there are several.
        bootstrap: number of resamples for the confidence interval; 0 for none.
        leave_one_out: predict each recording, or subject (see --by), from the others.
        skip: leave out files that cannot be used, and name them.
        out: folder for metric.json, tables and a figure.
        settings: file (.toml, .json) of any of these options, such as deviation = 0.05.

    Raises:
        ValueError: wrong options, or files that cannot be used.
        NotConverged: the parameters were not found.
    """
    del settings
    check_folder(out)
    parameters = [as_parameter(text) for text in parameter or ["joint_inertia"]]
    if penalty is not None and analysis.segments != AnalysisSettings().segments:
        raise ValueError("give either --penalty, with cuts of its own, or --segments")
    if bootstrap < 0:
        raise ValueError(f"--bootstrap must not be negative, got {bootstrap}")
    start = time.perf_counter()
    with progress() as bar:
        recordings = _recordings(file, side, analysis, skip)
        subjects = len({each.subject for each in recordings})
        unit = by or ("subject" if subjects > 1 else "recording")
        units = subjects if unit == "subject" else len(recordings)
        if leave_one_out and units < 2:
            raise ValueError(f"--leave-one-out needs at least two {unit}s, got {units}")
        cutting = analysis.cutting(recordings[0].model)
        if penalty is not None:
            cutting = partial(segment_optimal, penalty=penalty, curve=curve, progress=bar)
        found = fit_metric(
            recordings,
            parameters,
            measure=measure,
            curve=curve,
            segments=cutting,
            progress=bar,
        )
        intervals: tuple[ConfidenceInterval, ...] = ()
        resampled = bootstrap > 0 and units >= FEWEST
        curves: list[ErrorProfile] = []
        differences: list[Heterogeneity] = []
        if out or (resampled and len(parameters) == 1):
            curves = [error_profile(found, each.name, progress=bar) for each in found.estimates]
        if resampled:
            only = curves[0] if len(parameters) == 1 else None
            intervals = bootstrap_fit(found, bootstrap, by=unit, curve=only, progress=bar)
        tables = {"table": found.table(intervals)}
        if len(recordings) > 1:
            alone = separate_fits(found, progress=bar)
            tables["by_recording"] = _by_recording(found, alone)
            differences += heterogeneity(alone)
            if 1 < subjects < len(recordings):
                differences += heterogeneity(separate_fits(found, "subject", progress=bar))
        if leave_one_out:
            tables["leave_one_out"] = predicted(found, unit, progress=bar).table()
    _summarize(found, intervals, tables, unit, time.perf_counter() - start)
    for each in differences:
        if each.p < _SIGNIFICANT:
            print(f"note: {_disagreement(each)}")
    if out:
        print()
        print_written(
            write_together(out, lambda folder: _write(folder, found, intervals, tables, curves))
        )


def as_parameter(text: str) -> Parameter:
    """Return the parameter that NAME[:JOINT,...][=START] means, with its usual bounds.

    Raises:
        ValueError: there is no such parameter, or its initial value is not a number.
    """
    label, _, initial = text.partition("=")
    name, _, joints = label.partition(":")
    if name not in _USUAL:
        raise ValueError(f"--parameter must be one of {', '.join(_USUAL)}, got {name!r}")
    usual = _USUAL[name]
    try:
        start = float(initial) if initial else usual.start
    except ValueError:
        raise ValueError(f"--parameter {text}: {initial!r} is not a number") from None
    chosen = tuple(filter(None, joints.split(",")))
    return replace(usual, start=start, joints=chosen, name=label)


def _recordings(
    files: Sequence[Path], side: Sides, settings: AnalysisSettings, skip: bool
) -> list[Recording]:
    """Read the recordings in the files; with --skip, of the sides that there are."""
    sides = each_side(side)
    found: list[Recording] = []
    for number, each in enumerate(sides, 1):
        try:
            found += read_recordings(
                files,
                each,
                height=settings.height,
                mass=settings.mass,
                skip=skip,
                cutoff=settings.cutoff,
                duration=settings.savitzky_golay,
                **settings.reading(),
            )
        except RecordingError as reason:
            if not skip or (number == len(sides) and not found):
                raise
            warnings.warn(f"no {each} arm: {reason}", stacklevel=1)
    return found


def _disagreement(found: Heterogeneity) -> str:
    (low, least) = found.lowest
    (high, most) = found.highest
    return (
        f"{found.count} separate estimates of {found.parameter} disagree (Cochran's Q, p = "
        f"{found.p:.2g}; I^2 = {found.i_squared:.0%}): {least:.3g} from {low}, {most:.3g} from "
        f"{high}; the common estimate is a mean of unlike ones"
    )


def _by_recording(fit: MetricFit, alone: Mapping[str, MetricFit]) -> DataFrame:
    """Return estimates from every recording alone."""
    names = (part for each in fit.estimates for part in (each.name, "standard error"))
    rows: list[tuple[str | int | float, ...]] = []
    for (name, each), recording in zip(alone.items(), fit.recordings, strict=True):
        numbers = (
            number
            for own in each.estimates
            for number in (own.value, "at its bound" if own.at_bound else own.standard_error)
        )
        remark = "not determined" if each.undetermined else ""
        rows.append((name, recording.subject, *numbers, float(each.errors[0]), remark))
    header = ("recording", "subject", *names, f"rms error [{fit.error_unit}]", "remark")
    return new_table(header, rows)


def _summarize(
    fit: MetricFit,
    intervals: Sequence[ConfidenceInterval],
    tables: dict[str, DataFrame],
    by: str,
    seconds: float,
) -> None:
    count = len(fit.recordings)
    segments = sum(part.count for part in fit.program.parts)
    people = len({each.subject for each in fit.recordings})
    print(
        f"{count} recording{'s'[: count - 1]} of {people} {'people' if people > 1 else 'person'}, "
        f"{segments} segments that move, "
        f"{fit.outcome.iterations} iterations of Ipopt ({seconds:.1f} s in all)"
    )
    print(f"\n{text(tables['table'])}")
    if intervals:
        count = intervals[0].count
        unit = intervals[0].unit
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
            print(f"\n{title}\n\n{text(tables[name])}")


def _write(
    folder: Path,
    fit: MetricFit,
    intervals: Sequence[ConfidenceInterval],
    tables: dict[str, DataFrame],
    curves: Sequence[ErrorProfile],
) -> None:
    profiles = {
        "profile" + (f"_{number}" if number > 1 else ""): curve.table()
        for number, curve in enumerate(curves, 1)
    }
    save_tables(folder, {**tables, **profiles})
    save_figure(profiles_figure(curves), folder)
    save_metric(folder / "metric.json", fit, intervals)
