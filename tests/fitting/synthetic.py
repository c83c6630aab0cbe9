"""Synthetic recordings of a known metric."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go
from geodesic_ocp.fitting.metric_program import MetricProgram
from geodesic_ocp.fitting.recording_part import observe
from geodesic_ocp.fitting.segment_terms import SegmentTerms

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
    curve: str = "geodesic",
) -> tuple[go.trajectory.Recording, list[tuple[int, int]]]:
    """A sequence of geodesics, each with a smooth progress, or of cubics, and its segments.

    Args:
        metric: of the geodesics.
        model: the arm.
        rng: of the configurations and the noise.
        count: of geodesics.
        duration: of each [s].
        noise: standard deviation [rad] of white noise on every joint and sample.
        name, subject: of the recording.
        curve: "geodesic" or "cubic", with random velocities at the ends.
    """
    lower, upper = np.maximum(model.lower, -1.0), np.minimum(model.upper, 1.6)
    middle, half = (lower + upper) / 2.0, 0.4 * (upper - lower)
    points = middle + half * rng.uniform(-1.0, 1.0, (count + 1, model.dof))
    steps = round(duration * RATE)
    u = np.arange(steps + 1) / steps
    q, velocity = [], []
    velocities = rng.uniform(-1.0, 1.0, points.shape) if curve == "cubic" else points
    for (q0, q1), (v0, v1) in zip(pairwise(points), pairwise(velocities), strict=True):
        last = None if len(q) == count - 1 else -1
        if curve == "cubic":
            motion = go.cubic(metric, q0, v0, q1, v1, duration)
            q.append(motion(duration * u)[:last])
            velocity.append(motion(duration * u, 1)[:last])
            continue
        start, end = rng.uniform(0.3, 1.5, 2)
        s = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        rate = start + 2 * (3 - 2 * start - end) * u + 3 * (start + end - 2) * u**2
        path = go.geodesic(metric, q0, q1)
        q.append(path(s)[:last])
        velocity.append((rate[:, None] * path(s, 1) / duration)[:last])
    coordinates = np.vstack(q)
    coordinates = coordinates + noise * rng.normal(size=coordinates.shape)
    time = np.arange(len(coordinates)) / RATE
    motion = go.Motion(time, coordinates, model.joint_names, np.vstack(velocity))
    segments = [(steps * k, steps * (k + 1)) for k in range(count)]
    return go.trajectory.Recording(model, motion, name, subject), segments


def optimal_recording(
    metric: go.Metric,
    model: go.Model,
    rng: np.random.Generator,
    weights: dict[Any, float],
    *,
    count: int = 20,
    noise: float = 0.0,
    degree: int = 12,
) -> tuple[go.trajectory.Recording, list[tuple[int, int]]]:
    """Motions of least running cost between random configurations and velocities, and segments."""
    rough, segments = synthetic_recording(metric, model, rng, count=count, curve="cubic")
    theta = ca.SX.sym("theta", len(weights))
    costs = dict(zip(weights, ca.vertsplit(theta), strict=True))
    terms = SegmentTerms(metric, theta, model, "joint", degree, costs)
    part = observe(rough, metric, segments, terms)
    equal = np.full(len(weights), 1.0 / len(weights))
    program = MetricProgram((part,), equal, 0.0 * equal, equal + 1.0, False)
    outcome = program.solve(fixed=dict(enumerate(weights.values())))
    assert outcome.success, outcome.status
    polynomials = terms.basis.polynomials
    found = outcome.x[len(weights) :].reshape(count, -1)[:, : model.dof * len(polynomials)]
    q, velocity = rough.motion.q.copy(), np.array(rough.motion.velocity)
    for own, (start, stop) in zip(found, segments, strict=True):
        s, duration = np.linspace(0.0, 1.0, stop - start + 1), (stop - start) / RATE
        for target, order in ((q, 0), (velocity, 1)):
            values = terms.basis.values(s, order).T @ own.reshape(-1, model.dof)
            target[start : stop + 1] = values / duration**order
    q += noise * rng.normal(size=q.shape)
    motion = go.Motion(rough.motion.time, q, model.joint_names, velocity)
    return go.trajectory.Recording(model, motion), segments


def fitted(*recordings: Any, **options: Any) -> go.fitting.MetricFit:
    """The fit of recordings with their segments."""
    return go.fitting.fit_metric(
        [recording for recording, _ in recordings],
        segments=[segments for _, segments in recordings],
        **options,
    )
