"""Geodesics by shooting: Newton's method in the initial velocity."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.connecting_geodesic import ConnectingGeodesic
from geodesic_ocp.logarithm.correction import MAX_STEPS, correct_velocity
from geodesic_ocp.manifold.exp import exp_with_derivative, integrate_geodesic
from geodesic_ocp.manifold.metric import Metric

_UNIT_INTERVAL = np.array([0.0, 1.0])
# Number of Newton steps, smallest damping factor, required reduction of the endpoint error by a
# full step, error from which corrections take over, integration tolerance until then.
_MAX_SHOTS, _MIN_DAMPING, _REDUCTION = 12, 0.05, 0.1
_NEAR, _COARSE_STEP_TOLERANCE = 1e-7, 1e-9


def find_by_shooting(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """The geodesic that shooting finds from an initial velocity, of minimal energy or not.

    Raises:
        NotConverged: Newton's method found no geodesic that ends at q1.
    """
    try:
        return _shoot(metric, q0, q1, velocity)
    except (IntegrationFailed, np.linalg.LinAlgError) as failure:
        raise NotConverged(f"shooting from {velocity}: {failure}") from None


def _shoot(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """Newton's method with step halving."""
    for _ in range(_MAX_SHOTS):
        end, jacobian = exp_with_derivative(
            metric, q0, velocity, _COARSE_STEP_TOLERANCE, max_steps=MAX_STEPS
        )
        error = end - q1
        if np.abs(error).max() <= _NEAR:
            inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
            corrected, _ = correct_velocity(metric, q0, q1, velocity, inverse)
            if corrected is not None:
                return ConnectingGeodesic(q0, q1, corrected)
            break
        step, damping = np.linalg.solve(jacobian, error), 1.0
        while damping > _MIN_DAMPING:
            try:
                trial = _end_point(metric, q0, velocity - damping * step) - q1
            except IntegrationFailed:
                trial = np.full_like(error, np.inf)
            if np.linalg.norm(trial) <= (1.0 - _REDUCTION * damping) * np.linalg.norm(error):
                break
            damping /= 2.0
        else:
            break
        velocity = velocity - damping * step
    raise NotConverged(f"shooting from {q0} with {velocity} does not reach {q1}")


def _end_point(metric: Metric, q0: Array, velocity: Array) -> Array:
    """Exp_q0(velocity) by one coarse integration."""
    positions, _ = integrate_geodesic(
        metric, q0, velocity, _UNIT_INTERVAL, _COARSE_STEP_TOLERANCE, max_steps=MAX_STEPS
    )
    return np.asarray(positions[-1])
