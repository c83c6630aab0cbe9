"""Motions fitted to markers: speed, and what the analysis says of them.

Usage: python benchmarks/fit_markers.py [--frames N ...]
       python benchmarks/fit_markers.py --markers FILE.c3d --motion FILE.xml [--height H]

Without files: frames a second for synthetic recordings at 100 Hz of an arm on a thorax that walks,
with the 17 markers of the Master Motor Map's set and 1 mm of noise; 7 joints, 6 coordinates of the
thorax, 3 lengths and 51 coordinates of offsets.

With the markers of a recording and the joint angles that a database has for the same frames: errors
of the fit, differences of the angles, their noise and jerk, and the analysis of both motions at a
threshold of 0.6 rad, in the metric of kinetic energy and in the default one, with the filter of
Klein et al. (2022) and with the default one, with more segments, with the same cuts, and with a
little joint inertia of forearm and wrist.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import scipy
from pandas import DataFrame

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.marker_set import marker_sets
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.read_recording import read_markers
from geodesic_ocp.tables import markdown, new_table

MMM_MARKERS = marker_sets()["Master Motor Map"]

FILTERS = {"Savitzky-Golay 0.21 s": {"duration": 0.21}, "default": {}}
SETTINGS = (("kinetic", 0.6), ("kinetic", 0.3), ("kinetic", 0.15), ("joint-inertia", 0.6))
WRIST = ("REz_joint", "RWx_joint", "RWy_joint")
FRAMES = {
    "right upper arm": "right upper arm",
    "right elbow": "REx_joint",
    "right forearm": "right forearm",
    "right hand": "right hand",
}


def synthetic(frames: int, height: float = 1.8) -> tuple[go.Model, np.ndarray, Markers]:
    """An arm, its angles, and its markers with 1 mm of noise, at 100 Hz."""
    arm, random = go.human_arm("right", height), np.random.default_rng(0)
    moment = np.arange(frames) / 100.0
    low, high = np.maximum(arm.lower, -1.2), np.minimum(arm.upper, 1.6)
    q = np.tile((low + high) / 2.0, (frames, 1))
    for frequency in (0.3, 0.7, 1.2):
        phase = random.uniform(0.0, 2.0 * np.pi, arm.dof)
        q += 0.12 * (high - low) * np.sin(2.0 * np.pi * frequency * moment[:, None] + phase)
    turn = [0.5 * moment, 0.2 * np.sin(2.0 * moment), 0.3 * np.cos(1.5 * moment)]
    thorax = scipy.spatial.transform.Rotation.from_euler("ZYX", np.stack(turn, axis=1)).as_matrix()
    origin = np.stack([0.4 * moment, np.sin(moment), 1.4 + 0.05 * np.sin(6.0 * moment)], axis=1)
    points = {}
    for name, (segment, offset) in MMM_MARKERS.places.items():
        own = height * np.array(offset)
        if segment == "thorax":
            points[name] = origin + thorax @ own
        elif segment in FRAMES:
            rotations, positions = arm.frame_pose(FRAMES[segment], q)
            there = positions + rotations @ own + [0.110 * height, 0.0, 0.0]
            points[name] = origin + np.einsum("kij,kj->ki", thorax, there)
    stacked = np.stack(list(points.values()), axis=1)
    stacked += 1e-3 * random.normal(size=stacked.shape)
    return arm, q, Markers(moment, tuple(points), stacked)


def speeds(counts: list[int]) -> DataFrame:
    """Frames a second of recordings of several lengths."""
    rows = []
    for frames in counts:
        arm, q, markers = synthetic(frames)
        start = time.process_time()
        fit = fit_markers(arm, markers, height=1.8)
        processor = time.process_time() - start
        error = float(np.sqrt(np.mean((fit.motion.q - q) ** 2)))
        row = (
            str(frames),
            fit.seconds,
            processor,
            frames / fit.seconds,
            frames / processor,
            fit.iterations,
            1e3 * error,
        )
        rows.append(row)
        print(*(f"{each:.4g}" if isinstance(each, float) else each for each in row), sep="  ")
    header = (
        "frames",
        "seconds",
        "of the processor",
        "frames / s",
        "frames / s of the processor",
        "iterations",
        "RMS error of the angles [mrad]",
    )
    return new_table(header, tuple(rows))


def fits(arm: go.Model, markers: Markers, height: float | None) -> dict[str, MarkerFit]:
    """The fit of a recording with several settings."""
    without = [name for name in markers.names if name != "RIFD"]
    columns = [markers.names.index(name) for name in without]
    fewer = replace(markers, names=tuple(without), positions=markers.positions[:, columns])
    settings: dict[str, dict[str, Any]] = {
        "fit": {},
        "no estimates": {"estimate": ()},
        "no limits": {"limits": False},
        "without RIFD": {},
        "jerk 300": {"jerk": 300.0},
        "jerk 10000": {"jerk": 1e4},
        "jerk 100000": {"jerk": 1e5, "acceleration": 1e4},
    }
    return {
        name: fit_markers(arm, fewer if "RIFD" in name else markers, height=height, **given)
        for name, given in settings.items()
    }


def kinematics(arm: go.Model, database: go.Motion, found: dict[str, MarkerFit]) -> DataFrame:
    """Errors of the arm's markers, distance from the database's angles, noise and jerk."""
    rows: list[tuple[str | int | float, ...]] = []
    motions = {"database": database, **{name: fit.motion for name, fit in found.items()}}
    for name, motion in motions.items():
        errors: tuple[float | str, ...] = ("", "")
        if name in found:
            fit = found[name]
            on_arm = [k for k, each in enumerate(fit.segments) if each != "thorax"]
            own = 1e3 * fit.errors[:, on_arm]
            errors = float(np.nanmean(own)), float(np.nanmax(own))
        apart = motion.q - database.q
        step = 1.0 / motion.rate
        jerk = np.diff(motion.q, 3, axis=0) / step**3
        noise = motion.filtered().filter
        assert noise is not None
        pinned = np.minimum(motion.q - arm.lower, arm.upper - motion.q) < 2e-3
        rows.append(
            (
                name,
                *errors,
                float(np.sqrt(np.mean(apart**2))),
                float(np.std(apart, axis=0).mean()),
                1e3 * float(noise.noise.max()),
                float(np.sqrt(np.mean(jerk**2))),
                100.0 * float(pinned.any(axis=1).mean()),
            )
        )
    header = (
        "motion",
        "arm markers, mean [mm]",
        "max [mm]",
        "from database, RMS [rad]",
        "without constant [rad]",
        "largest noise [mrad]",
        "jerk, RMS [rad/s^3]",
        "at a limit [%]",
    )
    return new_table(header, tuple(rows))


def analyses(motions: dict[str, tuple[go.Model, go.Motion]]) -> DataFrame:
    """Segments and errors of every motion, by filter, metric, threshold and cuts."""
    rows: list[tuple[str | int | float, ...]] = []

    def add(name: str, how: str, label: str, analysis: go.synergies.Analysis) -> None:
        errors = analysis.errors["riemannian"]
        lines = analysis.errors["euclidean_same_segments"].orientation
        row = (
            name,
            how,
            label,
            len(analysis.segments),
            float(errors.joint),
            float(errors.position),
            float(errors.orientation),
            by_wrist(analysis),
            float(lines),
        )
        rows.append(row)
        print(*(f"{each:.3g}" if isinstance(each, float) else each for each in row), sep="  ")

    for how, chosen in FILTERS.items():
        filtered = {
            name: (model, motion.filtered(**chosen)) for name, (model, motion) in motions.items()
        }
        for metric, threshold in SETTINGS:
            for name, (model, motion) in filtered.items():
                try:
                    rule = partial(go.segment, threshold=threshold)
                    found = go.analyse(model, motion, metric=metric, segments=rule)  # type: ignore[arg-type]
                except go.NotConverged as failure:
                    print(f"{name}, {metric}, {how}: {failure}")
                    continue
                add(name, how, f"{metric}, threshold {threshold}", found)
        arm, recorded = filtered["database"]
        rule = partial(go.segment, threshold=0.3)
        cuts = go.analyse(arm, recorded, metric="kinetic", segments=rule).segments
        for name, (model, motion) in filtered.items():
            same = go.analyse(model, motion, segments=cuts, metric="kinetic")
            add(name, how, "kinetic, the database's cuts at 0.3", same)
            geared = model.with_armature(dict.fromkeys(WRIST, 0.005))
            known = go.analyse(geared, motion, segments=cuts)
            add(name, how, "these cuts, 0.005 kg m^2 on Ez, Wx, Wy", known)
    header = (
        "motion",
        "filter",
        "metric and cuts",
        "segments",
        "joints [rad]",
        "hand [m]",
        "hand [rad]",
        "by the wrist alone [rad]",
        "straight lines, same cuts [rad]",
    )
    return new_table(header, tuple(rows))


def by_wrist(analysis: go.synergies.Analysis) -> float:
    """Mean error of the hand's orientation [rad] if Wx and Wy are as predicted, others observed."""
    q = analysis.motion.q.copy()
    columns = [analysis.motion.joint_names.index(name) for name in WRIST[1:]]
    q[:, columns] = analysis.predicted.q[:, columns]
    predicted, _ = analysis.model.hand_pose(q)
    observed, _ = analysis.model.hand_pose(analysis.motion.q)
    between = np.swapaxes(observed, 1, 2) @ predicted
    return float(scipy.spatial.transform.Rotation.from_matrix(between).magnitude().mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[250, 500, 1000, 2000, 4000])
    parser.add_argument("--markers", help="file of markers")
    parser.add_argument("--motion", help="the same frames' joint angles")
    parser.add_argument("--height", type=float, help="of the person [m]")
    given = parser.parse_args()
    if given.markers is None:
        print(markdown(speeds(given.frames)))
        return
    markers = read_markers(given.markers)
    arm = go.human_arm("right", given.height or go.read_motion(given.motion).subject.height or 1.75)
    database = go.read_motion(given.motion, arm.joint_names)
    start = time.perf_counter()
    found = fits(arm, markers, given.height)
    print(f"{len(found)} fits in {time.perf_counter() - start:.1f} s\n")
    print(markdown(found["fit"].table()))
    print(markdown(kinematics(arm, database, found)))
    models = {
        name: (found[name].model, found[name].motion)
        for name in ("fit", "no estimates", "without RIFD")
    }
    print(markdown(analyses({"database": (arm, database), **models})))


if __name__ == "__main__":
    main()
