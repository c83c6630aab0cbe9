"""Derivatives of the program that fits markers."""

from __future__ import annotations

import casadi as ca
import numpy as np

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.body import MarkedBody
from geodesic_ocp.recordings.markers.chosen_markers import ChosenMarkers, FitSettings, KnownHeight
from geodesic_ocp.recordings.markers.fit_program import FitProblem


def test_derivatives_are_those_of_the_objective() -> None:
    """Gradient and Hessian, put together by frames, against CasADi's of the whole objective."""
    body = MarkedBody(go.human_arm("right"))
    random = np.random.default_rng(0)
    time = np.array([0.0, 0.1, 0.22, 0.3, 0.41])
    observed = random.normal(0.0, 0.3, (5, 3, 3))
    observed[2, 1] = np.nan
    chosen = ChosenMarkers(
        "three",
        ("a", "b", "c"),
        observed,
        ("thorax", "right upper arm", "right forearm"),
        random.normal(0.0, 0.1, (3, 3)),
        np.array([0.01, 0.0, 0.02]),
        (),
        {},
    )
    problem = FitProblem(body, chosen, KnownHeight(1.0, 0.1, ""), FitSettings())
    program = problem.program(time, observed, np.zeros(7, dtype=bool))
    functions = program.program.functions
    size = 5 * 13 + 3 + 6
    assert program.lower.size == size
    x, p = ca.MX.sym("x", size), ca.MX.sym("p")
    f = functions["nlp"](x, p)[0]
    hessian, gradient = ca.hessian(f, x)
    expected = ca.Function("expected", [x, p], [f, gradient, ca.triu(hessian)])
    at, outlier = random.normal(0.0, 0.3, size), 0.2
    value, slope, curvature = (each.full() for each in expected(at, outlier))
    own_value, own_slope = functions["grad_f"](at, outlier)
    assert abs(float(own_value) - value[0, 0]) <= 1e-12 * abs(value[0, 0])
    np.testing.assert_allclose(own_slope.full(), slope, rtol=1e-9, atol=1e-9 * np.abs(slope).max())
    own = functions["hess_lag"](at, outlier, 2.0, ca.DM(0, 1)).full()
    largest = np.abs(curvature).max()
    np.testing.assert_allclose(own, 2.0 * curvature, rtol=1e-9, atol=1e-11 * largest)
