"""Weights of running costs against those of the costs that made the motions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from fitting.synthetic import optimal_recording, synthetic_recording
from fitting.test_fit_metric import PLANAR
from repr_size import CHARACTERS
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.fitting.cost_fit import CostFit

WEIGHTS = {"energy": 0.3, "acceleration": 0.4, "torque change": 0.2, "jerk": 0.1}


@pytest.fixture(scope="module")
def planar() -> go.Model:
    return go.load_model(PLANAR, hand="hand")


@pytest.fixture(scope="module")
def planar_fit(planar: go.Model) -> CostFit:
    """From 5 motions of least cost, without noise."""
    metric = go.KineticEnergy(planar)
    rng = np.random.default_rng(1)
    recording, segments = optimal_recording(metric, planar, rng, WEIGHTS, count=5)
    return go.fitting.fit_cost(recording, metric=go.KineticEnergy, segments=[segments])


def test_planted_weights_are_recovered(planar_fit: CostFit) -> None:
    # Motions of degree 12 are fitted by motions of degree 8.
    assert planar_fit.weights == pytest.approx([*WEIGHTS.values()], abs=2e-3)
    assert planar_fit.errors == pytest.approx(0.0, abs=2e-4)
    assert planar_fit.undetermined == ()


def test_table_and_directions(planar_fit: CostFit) -> None:
    assert len(repr(planar_fit)) <= CHARACTERS
    rows = rows_of_table(planar_fit.table())
    assert [row[0] for row in rows] == [*WEIGHTS]
    directions = planar_fit.directions
    assert directions @ directions.T == pytest.approx(np.eye(3), abs=1e-12)
    assert directions.sum(axis=1) == pytest.approx(0.0, abs=1e-12)
    assert np.all(np.diff(planar_fit.direction_errors) >= 0.0)
    # Both describe one covariance.
    covariance = (directions.T * planar_fit.direction_errors**2) @ directions
    assert np.sqrt(np.diag(covariance)) == pytest.approx(planar_fit.standard_errors)
    assert len(rows_of_table(planar_fit.directions_table())) == 3


@dataclass(frozen=True)
class Mixture(go.MotionProblem):
    """Energy and covariant acceleration in the units of fit_cost, with another discretization."""

    metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))
    ends: Any = None
    share: float = 0.4
    duration: float = 0.6

    def boundary(self, q0: Any, q1: Any, v0: Any, v1: Any) -> Any:
        return list(zip((q0, v0, q1, v1), self.ends, strict=True))

    def cost(self, t: Any, q: Any, v: Any, a: Any, torque: Any) -> Any:
        energy = self.metric._energy(q, v) / 0.1**2
        return self.share * energy + (1.0 - self.share) * super().cost(t, q, v, a, torque)


@pytest.mark.slow
def test_weights_of_a_motion_problem(planar: go.Model) -> None:
    metric = go.KineticEnergy(planar)
    rng = np.random.default_rng(4)
    rough, segments = synthetic_recording(metric, planar, rng, count=2, curve="cubic")
    q, v = rough.motion.q.copy(), np.array(rough.motion.velocity)
    for start, stop in segments:
        ends = [x[k].copy() for k in (start, stop) for x in (q, v)]
        motion = go.solve(Mixture(metric, ends))
        t = np.linspace(0.0, motion.duration, stop - start + 1)
        q[start : stop + 1], v[start : stop + 1] = motion(t), motion(t, 1)
    recording = go.trajectory.Recording(
        planar, go.Motion(rough.motion.time, q, planar.joint_names, v)
    )
    fit = go.fitting.fit_cost(
        recording, ("energy", "acceleration"), metric=go.KineticEnergy, segments=[segments]
    )
    assert fit.weights == pytest.approx([0.4, 0.6], abs=2e-3)


@pytest.mark.slow
def test_in_a_constant_metric_torque_change_is_jerk(planar: go.Model) -> None:
    """Torque is proportional to acceleration: these two weights cannot be told apart."""
    metric = go.Euclidean(2)
    planted = {"acceleration": 0.5, "torque change": 0.2, "jerk": 0.3}
    rng = np.random.default_rng(2)
    recording, segments = optimal_recording(metric, planar, rng, planted, count=3)
    fit = go.fitting.fit_cost(
        recording, [*planted], metric=lambda model: go.Euclidean(2), segments=[segments]
    )
    assert fit.weights[0] == pytest.approx(0.5, abs=1e-3)
    assert np.isinf(fit.direction_errors).tolist() == [False, True]
    assert np.isinf(fit.standard_errors).tolist() == [False, True, True]
    assert abs(fit.directions[1] @ [0.0, 1.0, -1.0]) == pytest.approx(np.sqrt(2.0), abs=1e-3)
    (sentence,) = fit.undetermined
    assert "do not tell" in sentence
    assert "torque change" in sentence
    assert "jerk" in sentence
    assert "acceleration" not in sentence


@pytest.mark.slow
def test_standard_errors_agree_with_planted_weights(planar: go.Model) -> None:
    """With noise of 3 mrad and ends that are estimated; about 95 % of many seeds."""
    planted = {"energy": 0.4, "acceleration": 0.5, "jerk": 0.1}
    values, metric = np.array([*planted.values()]), go.KineticEnergy
    near = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        recording, segments = optimal_recording(
            metric(planar), planar, rng, planted, count=12, noise=0.003
        )
        fit = go.fitting.fit_cost(
            *(recording, [*planted]), metric=metric, segments=[segments], free_ends=True
        )
        near.append(np.abs(fit.weights - values) < 2.0 * fit.standard_errors)
        if seed == 0:
            for each, weight in zip(go.fitting.bootstrap_cost(fit, 20), fit.weights, strict=True):
                assert each.low < weight < each.high
                assert (each.unit, each.count) == ("segment", 12)
    assert np.mean(near) > 0.8


def test_wrong_arguments(planar: go.Model) -> None:
    rng = np.random.default_rng(1)
    recording, segments = synthetic_recording(go.KineticEnergy(planar), planar, rng, count=1)
    for costs in (["jerk"], ["jerk", "jerk"], ["jerk", "effort"], ()):
        with pytest.raises(ValueError, match="costs must be two or more of energy, acceleration"):
            go.fitting.fit_cost(recording, costs)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="free_ends needs measure='joint'"):
        go.fitting.fit_cost(recording, measure="position", free_ends=True)
    with pytest.raises(ValueError, match="metric must give the metric of a model"):
        go.fitting.fit_cost(recording, metric=go.Euclidean(2))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="degree must be 5 to 14, got 20"):
        go.fitting.fit_cost(recording, degree=20, segments=[segments])
    fit = go.fitting.fit_cost(
        recording, ("acceleration", "jerk"), metric=go.KineticEnergy, segments=[segments]
    )
    with pytest.raises(ValueError, match="a bootstrap needs at least three segments, got 1"):
        go.fitting.bootstrap_cost(fit)
    with pytest.raises(ValueError, match="by must be 'recording' or 'subject', got 'person'"):
        go.fitting.bootstrap_cost(fit, by="person")
