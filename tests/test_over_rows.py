"""exp, log and distance of many points at once."""

from __future__ import annotations

import numpy as np
import pytest
from known_metrics import Sphere

import geodesic_ocp as go

POINTS = np.array([[1.0, 0.2], [1.5, 0.9], [1.2, -0.3]])
GOALS = np.array([[1.4, 0.6], [1.1, 0.8], [1.3, 0.4]])


@pytest.mark.parametrize("function", [go.exp, go.log, go.distance])
def test_rows_agree_with_the_loop(function: object) -> None:
    metric = Sphere()
    both = function(metric, POINTS, GOALS)
    pairs = zip(POINTS, GOALS, strict=True)
    assert np.array_equal(both, [function(metric, *pair) for pair in pairs])
    one = function(metric, POINTS[0], GOALS)
    assert np.array_equal(one, [function(metric, POINTS[0], goal) for goal in GOALS])
    other = function(metric, POINTS, list(GOALS[0]))
    assert np.array_equal(other, [function(metric, point, GOALS[0]) for point in POINTS])
    assert function(metric, POINTS[:1], GOALS[:1]).shape == both[:1].shape


def test_arguments_may_be_named() -> None:
    metric = Sphere()
    found = go.exp(v=GOALS, q=POINTS[0], metric=metric, tolerance=1e-6)
    assert np.array_equal(found, go.exp(metric, POINTS[0], GOALS, tolerance=1e-6))
    one = go.distance(metric, q1=GOALS[0], q0=POINTS[0])
    assert one == go.distance(metric, POINTS[0], GOALS[0])
    assert isinstance(one, float)
    with pytest.raises(TypeError, match="missing a required argument: 'v'"):
        go.exp(metric, POINTS[0])


def test_the_row_that_fails_is_named() -> None:
    with pytest.raises(ValueError, match="row 1: v must be finite"):
        go.exp(Sphere(), POINTS[0], [[0.0, 1.0], [np.nan, 1.0]])
    with pytest.raises(ValueError, match="row 2: q1 must"):
        go.log(Sphere(), POINTS[0], [*GOALS[:2], [np.inf, 0.0]])
    with pytest.raises(go.IntegrationFailed, match="row 1: exp from"):
        go.exp(Sphere(), POINTS[0], [[0.0, 0.0], [0.3, 1.0]], tolerance=1e-18)


@pytest.mark.parametrize(
    ("q0", "q1", "message"),
    [
        (POINTS, GOALS[:2], "q0 and q1 have 3 and 2 rows"),
        (POINTS[:0], GOALS[:0], "q0 has no rows"),
        (POINTS, [GOALS], "must have shape"),
        ([[1.0, 2.0], [1.0]], [1.0, 1.0], "must be 2 real numbers"),
    ],
)
def test_rows_that_do_not_fit_are_named(q0: object, q1: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.log(Sphere(), q0, q1)
