"""Paths under constraints: README's reach past a lamp, and random reaches within joint limits."""

from __future__ import annotations

import time

import numpy as np

import geodesic_ocp as go
from comparison.measurement import Measurement
from comparison.models import is_installed, robot

TOLERANCE = 1e-6  # [rad] and [m]


def constrained(count: int) -> list[Measurement]:
    """Processor times of `go.solve(..., tolerance=1e-6)`, after a first one of each kind."""
    arm = go.human_arm()
    lamp = go.Ball((0.20, 0.35, -0.15), 0.06)
    start = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    past = go.Reach(arm, start, (0.10, 0.45, 0.10), obstacles=[lamp])
    rows = [_measured("past a lamp", [past] * (count + 1))]
    for model in (arm, robot("panda")) if is_installed("panda") else (arm,):
        rng = np.random.default_rng(5)
        ends = rng.uniform(model.lower, model.upper, (count + 1, 2, model.dof))
        reaches = [go.Reach(model, q0, model.hand_pose(q1)[1]) for q0, q1 in ends]
        rows.append(_measured(f"random reaches, {model.name}", reaches))
    return rows


def _measured(name: str, reaches: list[go.Reach]) -> Measurement:
    times, violations = [], []
    for reach in reaches:
        begin = time.process_time()
        stats = go.solve(reach, tolerance=TOLERANCE, throw=False).stats
        times.append(time.process_time() - begin)
        violations.append(stats.max_path_violation if stats.success else np.nan)
    return Measurement(name, np.array(times[1:]), np.array(violations[1:]), "largest violation")
