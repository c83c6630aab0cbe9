"""Segmentation, analysis and retargeting of the bundled recording."""

from __future__ import annotations

import warnings
from importlib.resources import files

import numpy as np
from scipy.interpolate import CubicSpline

import geodesic_ocp as go
from comparison import our_routes
from comparison.measurement import Measurement, repeat
from comparison.models import is_installed, robot

FRAMES = 1000
FILE = files("geodesic_ocp") / "data" / "climb.csv"


def recordings(repetitions: int, robots: bool = True) -> list[Measurement]:
    """Times in this process, after a first run that builds all functions."""
    arm = go.human_arm("left", height=1.78)
    motion = go.read_motion(FILE, arm.joint_names)
    results = []
    for name, variables in our_routes.available().items():
        metric, fine = go.KineticEnergy(arm), _resampled(motion, FRAMES)

        def cut(metric: go.Metric = metric, fine: go.Motion = fine) -> object:
            return go.segment(metric, fine)

        times = repeat(our_routes.within(variables, cut), repetitions)
        results.append(Measurement(f"go.segment, {FRAMES} frames, {name}", times))
    default = next(iter(our_routes.available().values()))
    duration = motion.time[-1] - motion.time[0]
    analyse = our_routes.within(default, lambda: go.analyse(arm, motion))
    times = repeat(analyse, repetitions)
    results.append(Measurement(f"go.analyse, recording of {duration:.1f} s", times))
    if robots and is_installed("panda"):
        results.append(_retargeting(analyse(), repetitions))
    return results


def _retargeting(analysis: go.synergies.Analysis, repetitions: int) -> Measurement:
    panda = robot("panda")

    def transfer() -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about poses out of reach
            go.retarget(analysis, panda, throw=False)

    count = len(analysis.synergies)
    times = repeat(transfer, 2) / count
    return Measurement(f"go.retarget to a Panda, {count} synergies, each", times)


def _resampled(motion: go.Motion, frames: int) -> go.Motion:
    """The same motion with another number of frames."""
    time = np.linspace(motion.time[0], motion.time[-1], frames)
    return go.Motion(time, CubicSpline(motion.time, motion.q)(time), motion.joint_names).filtered()
