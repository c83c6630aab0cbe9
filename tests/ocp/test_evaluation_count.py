"""`solve` evaluates each method of a problem once, however many grids it solves on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest

import geodesic_ocp as go


@dataclass(frozen=True)
class Counted(go.Problem):
    """Around a disc through a point above it, with a running cost; counts calls of its methods."""

    radius: float = 0.5
    calls: Counter[str] = field(default_factory=Counter)
    via_parameters: ClassVar = (0.5,)
    continuous_velocity_at_via: ClassVar = False

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        self.calls["boundary"] += 1
        return [(q0, (-1.0, 0.0)), (q1, (1.0, 0.0))]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        self.calls["constraints"] += 1
        return [(self.radius, ca.norm_2(q), np.inf, "disc")]

    def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
        self.calls["via"] += 1
        return [[(q, (0.0, 0.7), "above")]]

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        self.calls["cost"] += 1
        return 0.01 * ca.dot(q, q)

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, np.sin(np.pi * s)])


@dataclass(frozen=True)
class CountedWithParameters(Counted):
    parameters: ClassVar = ("radius",)


@pytest.mark.slow
@pytest.mark.parametrize("problem_class", [Counted, CountedWithParameters])
@pytest.mark.parametrize("grid", [None, go.Grid(6, 4)])
@pytest.mark.parametrize("tolerance", [None, 1e-3])
def test_solve_calls_each_method_once(
    problem_class: type[Counted], grid: go.Grid | None, tolerance: float | None
) -> None:
    problem = problem_class()
    solution = go.solve(problem, grid=grid, tolerance=tolerance)
    assert solution.stats.success
    assert problem.calls == dict.fromkeys(("boundary", "constraints", "via", "cost"), 1)
    if tolerance is not None:
        assert solution.stats.mesh_history
