"""Synthetic recordings of a known metric."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

import geodesic_ocp as go

RATE = 100.0  # [Hz]


def synthetic_recording(
    metric: go.Metric,
    model: go.Model,
    rng: np.random.Generator,
    *,
    count: int = 8,
    duration: float = 0.6,
    noise: float = 0.0,
    name: str = "synthetic",
    subject: str = "",
) -> tuple[go.recordings.Recording, list[tuple[int, int]]]:
    """A sequence of geodesics, each with a smooth progress, and its segments.

    Args:
        metric: of the geodesics.
        model: the arm.
        rng: of the configurations and the noise.
        count: of geodesics.
        duration: of each [s].
        noise: standard deviation [rad] of white noise on every joint and sample.
        name, subject: of the recording.
    """
    lower, upper = np.maximum(model.lower, -1.0), np.minimum(model.upper, 1.6)
    middle, half = (lower + upper) / 2.0, 0.4 * (upper - lower)
    points = middle + half * rng.uniform(-1.0, 1.0, (count + 1, model.dof))
    steps = round(duration * RATE)
    u = np.arange(steps + 1) / steps
    q, velocity = [], []
    for q0, q1 in pairwise(points):
        start, end = rng.uniform(0.3, 1.5, 2)
        s = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        rate = start + 2 * (3 - 2 * start - end) * u + 3 * (start + end - 2) * u**2
        path = go.geodesic(metric, q0, q1)
        last = None if len(q) == count - 1 else -1
        q.append(path(s)[:last])
        velocity.append((rate[:, None] * path(s, 1) / duration)[:last])
    coordinates = np.vstack(q)
    coordinates = coordinates + noise * rng.normal(size=coordinates.shape)
    time = np.arange(len(coordinates)) / RATE
    motion = go.Motion(time, coordinates, model.joint_names, np.vstack(velocity))
    segments = [(steps * k, steps * (k + 1)) for k in range(count)]
    return go.recordings.Recording(model, motion, name, subject), segments


def fitted(*recordings: Any, **options: Any) -> go.fitting.MetricFit:
    """The fit of recordings with their segments."""
    return go.fit_metric(
        [recording for recording, _ in recordings],
        segments=[segments for _, segments in recordings],
        **options,
    )
