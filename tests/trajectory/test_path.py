"""Speeds, lengths and times along a path."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.trajectory.grid import interpolation_between
from geodesic_ocp.trajectory.time_law import states_at


class Scaled(go.Metric):
    """ds^2 = (1 + x^2) dx^2, whose arc length is known."""

    dim = 1

    def matrix(self, q: object) -> object:
        return ca.SX(1 + q[0] ** 2)


def test_arc_length_of_a_path_with_varying_speed() -> None:
    grid = go.Grid(1, 12)
    path = go.Path(Scaled(), grid, grid.nodes[:, None])

    def arc_length(x: np.ndarray) -> np.ndarray:
        return (x * np.sqrt(1 + x**2) + np.arcsinh(x)) / 2

    assert path.length == pytest.approx(arc_length(np.array(1.0)), rel=1e-10)
    s = np.linspace(0.0, 1.0, 33)
    assert path.at_length(arc_length(s) * path.length / arc_length(1.0)) == pytest.approx(s)


def test_a_kink_of_the_speed_is_resolved() -> None:
    """The derivative jumps at the middle, and speeds are one-sided there."""
    grid = go.Grid(2, 4)
    nodes = np.where(grid.nodes < 0.5, grid.nodes, 3.0 * grid.nodes - 1.0)
    path = go.Path(go.Euclidean(1), grid, nodes[:, None])
    assert path.length == pytest.approx(2.0, rel=1e-12)
    found = path.at_length([0.25, 0.5, 1.25, 2.0])
    assert found == pytest.approx([0.25, 0.5, 0.75, 1.0], abs=1e-12)


def test_values_and_slopes_of_polynomials_in_parts() -> None:
    values, slopes = interpolation_between(5, 3, 2)
    nodes, inner = 2.0 * go.Grid(1, 5).nodes - 1.0, go.Grid(1, 3).nodes
    x = np.concatenate([inner - 1.0, inner])
    assert values @ nodes**5 == pytest.approx(x**5, abs=1e-13)
    assert slopes @ nodes**5 == pytest.approx(5.0 * x**4, abs=1e-12)


def test_speeds_of_constant_and_other_metrics_agree() -> None:
    class Constant(go.Metric):
        dim = 2

        def matrix(self, q: object) -> object:
            return ca.SX(ca.DM([[2.0, 0.5], [0.5, 1.0]]))

    rng = np.random.default_rng(1)
    metric, (q, v) = Constant(), rng.normal(size=(2, 9, 2))
    expected = [metric.norm(*pair) for pair in zip(q, v, strict=True)]
    assert speeds_at(metric, q, v) == pytest.approx(expected, rel=1e-14)
    found = speeds_at(Scaled(), q[:, :1], v[:, :1])
    assert found == pytest.approx(np.abs(v[:, 0]) * np.sqrt(1 + q[:, 0] ** 2), rel=1e-14)


def test_speeds_of_columns_of_one_array(arm: go.Model) -> None:
    """Arrays that are not contiguous, also where compiled code reads them."""
    metric, both = go.KineticEnergy(arm), np.random.default_rng(3).normal(size=(81, 14))
    go.log(metric, both[0, :7] / 10.0, both[1, :7] / 10.0)  # compiles, where there is a compiler
    q, v = np.split(both, 2, axis=1)
    expected = [metric.norm(*pair) for pair in zip(q, v, strict=True)]
    assert speeds_at(metric, q, v) == pytest.approx(expected, rel=1e-12)


def test_states_up_to_an_order_are_the_first_of_all() -> None:
    grid = go.Grid(1, 8)
    path = go.Path(Scaled(), grid, grid.nodes[:, None])
    law = go.trajectory.time_law(path.length, 1.5, 0.3, 0.1)
    t = np.linspace(0.0, 1.5, 11)
    everything = states_at(path, law, t)
    for order in range(3):
        some = states_at(path, law, t, order)
        assert len(some) == order + 1
        for one, same in zip(some, everything, strict=False):
            assert one == pytest.approx(same, abs=1e-14)
