"""exp, log and distance of many points at once."""

from __future__ import annotations

import numpy as np
import pytest
from known_metrics import Sphere

import geodesic_ocp as go
from geodesic_ocp.logarithm import log
from geodesic_ocp.manifold import metric as metric_module

POINTS = np.array([[1.0, 0.2], [1.5, 0.9], [1.2, -0.3]])
GOALS = np.array([[1.4, 0.6], [1.1, 0.8], [1.3, 0.4]])


@pytest.mark.parametrize("function", [go.exp, go.log, go.distance])
def test_rows_agree_with_the_loop(function: object) -> None:
    metric = Sphere()
    metric.kernels.available()  # compiled now, not after some use: rounding would differ
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


def test_rows_that_are_not_found_are_nan_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    metric = Sphere()
    expected = go.distance(metric, POINTS, GOALS)

    def fails_for_one(metric: go.Metric, q0: object, q1: object, **options: object) -> object:
        if np.allclose(q0, POINTS[1]):
            raise go.NotConverged("not this one")
        return found(metric, q0, q1, **options)

    found = log.find_shortest
    monkeypatch.setattr(log, "find_shortest", fails_for_one)
    monkeypatch.setattr(metric_module, "_FEW", 100)
    with pytest.raises(go.NotConverged, match="row 1: not this one"):
        go.log(metric, POINTS, GOALS)
    with pytest.warns(RuntimeWarning, match=r"1 of 3 rows are nan \(rows 1\); row 1: not this one"):
        lengths = go.distance(metric, POINTS, GOALS, throw=False)
    assert np.isnan(lengths[1])
    assert lengths[[0, 2]] == pytest.approx(expected[[0, 2]])
    with pytest.warns(RuntimeWarning, match="log is nan: not this one"):
        assert np.isnan(go.log(metric, POINTS[1], GOALS[1], throw=False)).all()
    with pytest.raises(go.NotConverged, match="points 1 and 2: not this one"):
        go.distance(metric, POINTS)
    with pytest.warns(RuntimeWarning, match=r"1 of 3 distances are nan, of points \(1, 2\)"):
        matrix = go.distance(metric, POINTS, throw=False)
    assert np.isnan(matrix[1, 2])
    assert matrix[0, 1] == matrix[1, 0] == go.distance(metric, POINTS[0], POINTS[1])


def test_a_matrix_of_distances_is_that_of_its_pairs() -> None:
    metric = go.KineticEnergy(go.human_arm())
    points = np.random.default_rng(0).uniform(0.0, 0.4, (4, 7))
    matrix = go.distance(metric, points)
    for i, j in zip(*np.triu_indices(4, 1), strict=True):
        assert matrix[i, j] == matrix[j, i]
        assert matrix[i, j] == pytest.approx(go.distance(metric, points[i], points[j]), rel=1e-9)
    assert np.array_equal(np.diag(matrix), np.zeros(4))
    with pytest.raises(ValueError, match=r"without q1, q0 must be several points"):
        go.distance(metric, points[0])
