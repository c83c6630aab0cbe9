"""The discrete energy is integrated finely enough that coarse paths do not underbid geodesics."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go

# Wide motions of the right arm. With the energy integrated at the nodes themselves, paths of degree
# 14 bend between the nodes where the metric is large, and had energies of 0.4216 and 0.4755.
PAIRS = {
    0.562942409: (
        [0.38790889, 0.19701032, -0.35256787, 0.50604515, -1.20391798, -0.12219645, -0.88764095],
        [2.52692618, 0.21065203, -0.68210912, 2.1055691, -1.22798924, 0.17804127, -0.34101846],
    ),
    0.543576422: (
        [2.39289498, -0.64403664, -2.08592339, 0.32480663, 1.16952301, -0.06625643, 0.50927],
        [2.16074291, 0.38595853, -0.70621087, 1.12839781, -0.44040956, 0.11794238, -0.51030508],
    ),
}
# The quadrature of a grid errs by less than this at its solution, relative to the energy.
QUADRATURE = 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("energy", PAIRS)
def test_no_grid_finds_less_than_the_energy_of_the_geodesic(
    arm_metric: go.KineticEnergy, energy: float
) -> None:
    q0, q1 = PAIRS[energy]
    assert go.distance(arm_metric, q0, q1) ** 2 / 2.0 == pytest.approx(energy, rel=1e-8)
    problem = go.PointToPoint(arm_metric, tuple(q0), tuple(q1))
    for grid in (go.Grid(1, 8), go.Grid(1, 10), go.Grid(1, 14), go.Grid(1, 20), go.Grid(2, 20)):
        solution = go.solve(problem, grid=grid)
        assert solution.stats.energy > energy * (1.0 - QUADRATURE), grid
        assert solution.stats.energy == pytest.approx(solution.path.energy, rel=1e-4), grid
    coarse = go.solve(problem, grid=go.Grid(1, 14)).stats.energy
    assert coarse == pytest.approx(energy, rel=1e-3)


def test_the_geodesic_is_found_and_ends_at_the_goal(arm_metric: go.KineticEnergy) -> None:
    for energy, (q0, q1) in PAIRS.items():
        velocity = go.log(arm_metric, q0, q1)
        assert arm_metric.inner(q0, velocity, velocity) / 2.0 == pytest.approx(energy, rel=1e-8)
        assert np.abs(go.exp(arm_metric, q0, velocity) - q1).max() < 1e-8
