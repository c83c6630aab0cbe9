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
    """The same logs one by one and in one call log(metric, Q0, Q1), in time that passes."""
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

    with our_routes.environment(variables):
        go.log(metric, starts[0], goals[0])
        times = [repeat(each, 2, time.perf_counter) / len(found) for each in (one_by_one, together)]
    alone = Measurement(f"go.log, {len(found)} pairs one by one, each", times[0])
    name = f"go.log, {len(found)} pairs in one call, each"
    return [alone, Measurement(name, times[1], baseline=alone)]


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
