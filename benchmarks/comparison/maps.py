"""Logarithmic and exponential maps of one model, by our routes and by others."""

from __future__ import annotations

import time

import numpy as np

import geodesic_ocp as go
from comparison import our_routes
from comparison.boundary_value import BoundaryValueSolver
from comparison.measurement import Measurement, Route, compare, repeat
from comparison.pinocchio_aba import ForwardDynamics
from comparison.plain_collocation import PlainCollocation

ENDPOINT = "endpoint error"


def logarithmic_maps(model: go.Model, pairs: np.ndarray) -> list[Measurement]:
    """All routes to log; half of the pairs for slow ones, a tenth for the plain collocation."""
    dynamics = ForwardDynamics(model)

    def error(velocity: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> float:
        return dynamics.endpoint_error(q0, velocity, q1)

    half, plain = len(pairs) // 2, PlainCollocation(model)
    fast = our_routes.available().items()
    routes = [Route(f"go.log, {name}", our_routes.log(model, how), error) for name, how in fast]
    routes[-1].limit = half
    routes += [
        Route("go.log, Ipopt", our_routes.log(model, our_routes.IPOPT), error, limit=half),
        Route("scipy solve_bvp, Pinocchio's ABA", BoundaryValueSolver(dynamics), error, limit=half),
        Route("CasADi MX collocation, Ipopt", plain, error, limit=max(3, len(pairs) // 10)),
    ]
    return compare(routes, list(pairs), ENDPOINT)


def batch(model: go.Model, pairs: np.ndarray) -> list[Measurement]:
    """The same logs one by one and in one call log(metric, Q0, Q1), in time that passes and in that
    of the processors; and from several starts.
    """
    variables = next(iter(our_routes.available().values()))
    solve = our_routes.log(model, variables)
    found = [index for index, pair in enumerate(pairs) if solve(*pair) is not None]
    starts, goals = pairs[found].transpose(1, 0, 2)
    metric = go.KineticEnergy(model)

    def one_by_one() -> None:
        for q0, q1 in zip(starts, goals, strict=True):
            go.log(metric, q0, q1)

    def together() -> None:
        go.log(metric, starts, goals)

    def from_starts() -> None:
        for q0, q1 in zip(starts[:few], goals[:few], strict=True):
            go.log(metric, q0, q1, num_starts=20)

    count, few = len(found), min(len(found), 50)
    rows = [
        (f"go.log, {count} pairs one by one, each", one_by_one, time.perf_counter, count),
        (f"go.log, {count} pairs in one call, each", together, time.perf_counter, count),
        ("the same, processor time, one by one", one_by_one, time.process_time, count),
        ("the same, processor time, in one call", together, time.process_time, count),
        ("go.log, num_starts=20, processor time", from_starts, time.process_time, few),
    ]
    with our_routes.environment(variables):
        go.log(metric, starts[0], goals[0])
        times = [repeat(call, 2, clock) / calls for _, call, clock, calls in rows]
    return [Measurement(row[0], each) for row, each in zip(rows, times, strict=True)]


def exponential_maps(model: go.Model, pairs: np.ndarray) -> list[Measurement]:
    """All routes to exp, with the initial velocities of the geodesics between the pairs."""
    dynamics = ForwardDynamics(model)
    solve, problems = our_routes.log(model, {}), []
    for q0, q1 in pairs:
        if (velocity := solve(q0, q1)) is not None:
            problems.append((q0, velocity, dynamics.exp(q0, velocity, 1e-13)))

    def error(end: np.ndarray, q: np.ndarray, v: np.ndarray, exact: np.ndarray) -> float:
        return float(np.abs(end - exact).max())

    def adaptive(q: np.ndarray, v: np.ndarray, exact: np.ndarray) -> np.ndarray:
        return dynamics.exp(q, v, 1e-10)

    def fixed_steps(q: np.ndarray, v: np.ndarray, exact: np.ndarray) -> np.ndarray:
        return dynamics.exp_runge_kutta(q, v, 200)

    routes = [
        Route(f"go.exp, {name}", our_routes.exp(model, variables), error)
        for name, variables in our_routes.available().items()
    ]
    routes += [
        Route("Pinocchio's ABA, scipy DOP853 at 1e-10", adaptive, error),
        Route("Pinocchio's ABA, Runge-Kutta, 200 steps", fixed_steps, error),
    ]
    return compare(routes, problems, ENDPOINT)
