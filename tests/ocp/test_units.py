"""The same problem in other units of length, time, mass and of its conditions.

The units are powers of two, so that no digit differs: then the iterates must be the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go

TINY, HUGE = 2.0**-20, 2.0**20


class Bump(go.Metric):
    """The plane, heavier around its origin; of one unit of length and mass."""

    dim = 2

    def __init__(self, length: float, mass: float) -> None:
        self.length, self.mass = length, mass

    def matrix(self, q: ca.SX) -> ca.SX:
        return self.mass * (1.0 + ca.exp(-ca.sumsqr(q / self.length))) * ca.SX.eye(2)


@dataclass(frozen=True)
class InUnits(go.Problem):
    """From one side of obstacles to the other.

    Attributes:
        length, mass: units of the coordinates and of the metric.
        scale: factor of all conditions that are no bare coordinates.
    """

    length: float = 1.0
    mass: float = 1.0
    scale: float = 1.0

    @property
    def metric(self) -> go.Metric:
        return Bump(self.length, self.mass)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, [-self.length, 0.05 * self.length]), (q1, [self.length, 0.0])]


class Disc(InUnits):
    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(0.09 * self.scale, self.scale * ca.sumsqr(q / self.length), np.inf)]


class ThinWall(InUnits):
    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        across, along = ca.vertsplit(q / self.length)
        value = ((across - 0.1234) / 0.1) ** 2 + (along / 0.6) ** 2
        return [(self.scale, self.scale * value, np.inf)]


class FreeEnd(InUnits):
    """Nothing tells how far it is to the goal but the condition on it."""

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        outside = self.scale * (ca.sumsqr(q1 / self.length) - 4.0)
        return [(q0, [-self.length, 0.3 * self.length]), (outside, 0.0)]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        from_post = q / self.length + ca.DM([1.5, -0.3])
        return [(0.04 * self.scale, self.scale * ca.sumsqr(from_post), np.inf)]


class Forest(InUnits):
    """Among so many discs that only some are part of a program, and a planner is needed."""

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        places = np.random.default_rng(1).uniform([-0.7, -1.0], [0.7, 1.0], (24, 2))
        distances = [self.scale * ca.norm_2(q / self.length - ca.DM(each)) for each in places]
        return [(0.08 * self.scale, each, np.inf) for each in distances]


class LimitedSpeed(InUnits):
    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(-np.inf, self.scale * ca.sumsqr(v / self.length), 6.0 * self.scale)]

    def via(self, q: ca.SX) -> Sequence[Any]:
        return [[(self.scale * q[1] / self.length, 0.5 * self.scale)]]


@pytest.mark.parametrize(
    "kind",
    [
        Disc,
        FreeEnd,
        *(pytest.param(kind, marks=pytest.mark.slow) for kind in (ThinWall, Forest, LimitedSpeed)),
    ],
)
def test_a_problem_takes_the_same_iterates_in_any_unit(kind: type[InUnits]) -> None:
    expected = go.solve(kind())
    for length, mass, scale in ((TINY, HUGE, TINY**2), (HUGE, TINY, HUGE)):
        found = go.solve(kind(length, mass, scale))
        assert found.stats.guess == expected.stats.guess
        assert found.stats.total_iterations == expected.stats.total_iterations
        assert_allclose(found.path.nodes / length, expected.path.nodes, rtol=0.0, atol=1e-9)
        energy = expected.stats.energy * mass * length**2
        assert found.stats.energy == pytest.approx(energy, rel=1e-9)
        assert str(found.certificate)[:20] == str(expected.certificate)[:20]


@dataclass(frozen=True)
class MotionPastDisc(go.MotionProblem):
    length: float = 1.0
    time: float = 1.0
    scale: float = 1.0

    @property
    def metric(self) -> go.Metric:
        return Bump(self.length, 1.0)

    @property
    def duration(self) -> float:  # type: ignore[override]
        return self.time

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        ends = (q0, [-self.length, 0.05 * self.length]), (q1, [self.length, 0.0])
        return [*ends, (v0, [0.0, 0.0]), (v1, [0.0, 0.0])]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        speed = v / self.length * self.time
        return [
            (0.09 * self.scale, self.scale * ca.sumsqr(q / self.length), np.inf, "disc"),
            (-np.inf, self.scale * ca.sumsqr(speed), 10.0 * self.scale, "speed"),
        ]


def test_a_motion_takes_the_same_iterates_in_any_unit() -> None:
    expected = go.solve(MotionPastDisc())
    distances = np.linalg.norm(expected(np.linspace(0.0, 1.0, 1001)), axis=1)
    assert distances.min() == pytest.approx(0.3, abs=1e-4)
    for length, time, scale in ((TINY, 1.0, TINY), (HUGE, TINY, HUGE)):
        found = go.solve(MotionPastDisc(length, time, scale))
        assert found.stats.total_iterations == expected.stats.total_iterations
        assert found.objective == pytest.approx(expected.objective * length**2 / time**3, rel=1e-9)


@pytest.mark.parametrize("scale", [1e-6, 1e-8])
def test_a_condition_of_small_values_counts(scale: float) -> None:
    """k q'q >= 0.09 k keeps the path out of the disc of radius 0.3 whatever k is."""
    path = go.solve(Disc(scale=scale)).path
    distances = np.linalg.norm(path(np.linspace(0.0, 1.0, 10_001)), axis=1)
    assert distances.min() == pytest.approx(0.3, abs=1e-4)
