"""Rows of the tidy tables from an analysis, without what identifies the recording."""

from __future__ import annotations

from math import isfinite

import numpy as np

from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import MotionErrors, evaluate
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.motion import Motion

_METHODS = {
    "kinetic_energy": "geodesics, kinetic energy",
    "joint_inertia": "geodesics, kinetic energy with joint inertia",
    "euclidean_same_segments": "straight lines, same segments",
    "euclidean": "straight lines, zero-velocity segments",
    "ik": "inverse kinematics of the hand",
}


def recording_rows(analysis: Analysis) -> list[Row]:
    """One row for each method; errors of a method without geodesics are missing."""
    motion = analysis.motion
    used = motion.filter
    same: Row = {
        "samples": len(motion),
        "duration_s": motion.duration,
        "rate_hz": motion.rate,
        "cutoff_hz": None if used is None else _finite(used.bandwidth),
        "noise_rad": None if used is None else _finite(float(np.sqrt(np.mean(used.noise**2)))),
        "metric": analysis.metric_name,
        "threshold_rad": analysis.threshold,
    }
    own = analysis.table().rows[0][0]
    rows: list[Row] = []
    for method in ("riemannian", *_METHODS):
        if method not in (*analysis.errors, *analysis.not_found):
            continue
        rows.append(
            same
            | {
                "method": method,
                "method_label": str(own) if method == "riemannian" else _METHODS[method],
                "segments": analysis.segment_counts.get(method),
            }
            | _errors(analysis.errors.get(method))
            | _errors(analysis.errors_unfiltered.get(method), "_unfiltered")
        )
    return rows


def synergy_rows(analysis: Analysis) -> list[Row]:
    """One row for each synergy, with the mean errors over its samples."""
    rows: list[Row] = []
    for number, synergy in enumerate(analysis.synergies, 1):
        parts = (_part(motion, synergy) for motion in (analysis.motion, analysis.predicted))
        own: Row = {
            "metric": analysis.metric_name,
            "synergy": number,
            "start_sample": synergy.start,
            "stop_sample": synergy.stop,
            "start_time_s": synergy.start_time,
            "duration_s": synergy.duration,
            "length": synergy.length,
            "mean_speed": _finite(synergy.length / synergy.duration),
            "peak_speed": peak_speed(synergy),
        }
        rows.append(own | _errors(evaluate(analysis.model, *parts)))
    return rows


def peak_speed(synergy: Synergy) -> float:
    """The largest speed of a synergy's time law, a piecewise parabola, exactly."""
    law = synergy.law
    times = [law.knots]
    start, stop = law(law.knots[:-1], 2), law((law.knots[:-1] + law.knots[1:]) / 2.0, 2)
    change = 2.0 * (stop - start)  # of the acceleration over each interval
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -start / change
    inside = (share > 0.0) & (share < 1.0)
    times.append((law.knots[:-1] + share * np.diff(law.knots))[inside])
    return float(np.max(law(np.concatenate(times), 1)))


def _part(motion: Motion, synergy: Synergy) -> Motion:
    rows = slice(synergy.start, synergy.stop + 1)
    return Motion(motion.time[rows], motion.q[rows], motion.joint_names)


def _errors(errors: MotionErrors | None, suffix: str = "") -> Row:
    return {
        f"joint_error{suffix}_rad": None if errors is None else _finite(errors.joint),
        f"position_error{suffix}_m": None if errors is None else _finite(errors.position),
        f"orientation_error{suffix}_rad": None if errors is None else _finite(errors.orientation),
    }


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None
