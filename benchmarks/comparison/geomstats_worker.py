"""Logarithmic maps of two rods by geomstats; runs where geomstats is installed.

    python geomstats_worker.py < pairs.json > results.json

Pairs (k, 2, 2) of joint angles of two uniform rods, 1 m and 1 kg each, in a plane; the results are
times [s] and initial velocities. NumPy is its default back end and has no automatic
differentiation, so that the derivative of the metric is written out, as its tutorials do.
"""

from __future__ import annotations

import json
import sys
import time
import warnings

import geomstats
import geomstats.backend as gs
import numpy as np
from geomstats.geometry.base import VectorSpace
from geomstats.geometry.riemannian_metric import RiemannianMetric
from geomstats.numerics.geodesic import ExpODESolver, LogODESolver


class TwoRods(RiemannianMetric):
    """The inertia matrix of two uniform rods."""

    def metric_matrix(self, base_point=None):
        """G(q), (..., 2, 2)."""
        c = gs.cos(base_point[..., 1])
        first, mixed = 5.0 / 3.0 + c, 1.0 / 3.0 + c / 2.0
        return _symmetric(first, mixed, gs.ones_like(c) / 3.0)

    def inner_product_derivative_matrix(self, base_point=None):
        """Derivatives of G by q1 and q2, along the last axis."""
        s = -gs.sin(base_point[..., 1])
        by_elbow = _symmetric(s, s / 2.0, 0.0 * s)
        return gs.stack([gs.zeros_like(by_elbow), by_elbow], axis=-1)


class Angles(VectorSpace):
    """The plane of two joint angles, without a metric of its own."""

    def __init__(self):
        super().__init__(shape=(2,), equip=False)

    def _create_basis(self):
        return gs.eye(2)


def _symmetric(first, mixed, last):
    rows = [gs.stack([first, mixed], axis=-1), gs.stack([mixed, last], axis=-1)]
    return gs.stack(rows, axis=-2)


def main() -> None:
    warnings.simplefilter("ignore")
    space = Angles()
    space.equip_with_metric(TwoRods)
    space.metric.exp_solver = ExpODESolver(space)
    space.metric.log_solver = LogODESolver(space, use_jac=False)
    seconds, velocities = [], []
    for q0, q1 in np.array(json.load(sys.stdin)):
        start = time.process_time()
        velocity = space.metric.log(gs.array(q1), gs.array(q0))
        seconds.append(time.process_time() - start)
        velocities.append(np.asarray(velocity).tolist())
    versions = f"geomstats {geomstats.__version__}, NumPy {np.__version__}"
    json.dump({"version": versions, "seconds": seconds, "velocities": velocities}, sys.stdout)


if __name__ == "__main__":
    main()
