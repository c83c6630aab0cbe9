"""Fitted parameters against those of the metric that made the motions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from fitting.synthetic import fitted, synthetic_recording
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.fitting.resampling import heterogeneity
from geodesic_ocp.tables import text

TRUE = 0.05


@pytest.fixture(scope="module")
def true_metric(arm: go.Model) -> go.manifold.AdjustableKineticEnergy:
    return go.manifold.AdjustableKineticEnergy(arm, joint_inertia=TRUE)


@pytest.fixture(scope="module")
def noisy(arm: go.Model, true_metric: go.Metric) -> list[Any]:
    """Recordings of three subjects with 5 mrad of noise."""
    rng = np.random.default_rng(3)
    return [
        synthetic_recording(
            true_metric, arm, rng, count=4, noise=0.005, name=f"r{k}", subject=f"s{k}"
        )
        for k in range(3)
    ]


@pytest.fixture(scope="module")
def noisy_fit(noisy: list[Any]) -> go.fitting.MetricFit:
    return fitted(*noisy, free_ends=True)


@pytest.mark.slow
def test_without_noise_the_parameter_is_exact(
    arm: go.Model, true_metric: go.Metric, rng: np.random.Generator
) -> None:
    fit = fitted(synthetic_recording(true_metric, arm, rng, count=3))
    # Paths of degree 8 and the regularization leave a relative error of about 1e-5.
    assert fit.values["joint_inertia"] == pytest.approx(TRUE, rel=1e-4)
    assert fit.errors == pytest.approx(0.0, abs=1e-4)
    q = np.full(7, 0.3)
    assert fit.metric(arm).matrix(q) == pytest.approx(true_metric.matrix(q), rel=1e-4)


@pytest.mark.slow
def test_noise_of_5_mrad_in_the_joints(noisy_fit: go.fitting.MetricFit) -> None:
    (estimate,) = noisy_fit.estimates
    assert estimate.value == pytest.approx(TRUE, rel=0.1)
    assert 0.0 < estimate.standard_error < 0.05 * TRUE
    assert noisy_fit.errors == pytest.approx(0.005, rel=0.15)
    assert noisy_fit.undetermined == ()


@pytest.mark.slow
def test_noise_of_1_mm_at_the_hand(
    arm: go.Model, true_metric: go.Metric, rng: np.random.Generator
) -> None:
    recording, segments = synthetic_recording(true_metric, arm, rng, count=6, noise=0.0015)
    clean, _ = synthetic_recording(true_metric, arm, np.random.default_rng(20221), count=6)
    off = arm.hand_pose(recording.motion.q)[1] - arm.hand_pose(clean.motion.q)[1]
    assert np.linalg.norm(off, axis=1).mean() == pytest.approx(0.001, rel=0.25)
    fit = fitted((recording, segments), measure="position")
    assert fit.values["joint_inertia"] == pytest.approx(TRUE, rel=0.1)


@pytest.mark.slow
def test_standard_errors_agree_with_repeated_experiments(
    arm: go.Model, true_metric: go.Metric
) -> None:
    """Estimates from independent noise scatter as one standard error says."""
    clean, segments = synthetic_recording(true_metric, arm, np.random.default_rng(0), count=3)
    fits = []
    for seed in range(10):
        noise = 0.005 * np.random.default_rng(seed).normal(size=clean.motion.q.shape)
        motion = go.Motion(
            clean.motion.time, clean.motion.q + noise, arm.joint_names, clean.motion.velocity
        )
        fits.append(fitted((go.trajectory.Recording(arm, motion), segments), free_ends=True))
    spread = np.std([fit.values["joint_inertia"] for fit in fits], ddof=1)
    stated = np.mean([fit.estimates[0].standard_error for fit in fits])
    # The standard deviation of ten numbers is uncertain by a quarter.
    assert 0.5 < spread / stated < 2.0


@pytest.mark.slow
def test_parameters_that_trade_off_are_named(noisy: list[Any]) -> None:
    """Joint inertia and body mass scale the metric together: only their ratio matters."""
    mass = go.fitting.Parameter("mass_ratio", 1.0, lower=0.01)
    fit = fitted(
        *noisy, parameters=[go.fitting.Parameter("joint_inertia", 0.03), mass], free_ends=True
    )
    ratio = fit.values["joint_inertia"] / fit.values["mass_ratio"]
    assert ratio == pytest.approx(TRUE, rel=0.15)
    (sentence,) = fit.undetermined
    assert "joint_inertia and mass_ratio in combination only" in sentence
    assert all(np.isinf(each.standard_error) for each in fit.estimates)
    for interval in go.fitting.bootstrap_fit(fit, 20):
        assert (interval.low, interval.high) == (0.0, np.inf)
    # The initial values are changed by the same factor, in opposite directions.
    first, second = fit.values["joint_inertia"] / 0.03, fit.values["mass_ratio"]
    assert first * second == pytest.approx(1.0, rel=0.05)


@pytest.mark.slow
def test_a_payload_is_told_from_joint_inertia(
    arm: go.Model, true_metric: go.Metric, rng: np.random.Generator
) -> None:
    loaded = go.manifold.AdjustableKineticEnergy(arm, joint_inertia=TRUE, payload=2.0)
    data = synthetic_recording(loaded, arm, rng, count=4, noise=0.001)
    fit = fitted(
        data,
        parameters=[
            go.fitting.Parameter("joint_inertia", 0.03),
            go.fitting.Parameter("payload", 0.5),
        ],
        free_ends=True,
    )
    assert fit.values["payload"] == pytest.approx(2.0, rel=0.1)
    assert fit.values["joint_inertia"] == pytest.approx(TRUE, rel=0.1)


@pytest.mark.slow
def test_groups_of_joints(arm: go.Model, rng: np.random.Generator) -> None:
    by_joint = (0.1, 0.1, 0.1, 0.05, 0.05, 0.02, 0.02)
    metric = go.manifold.AdjustableKineticEnergy(arm, armature=by_joint)
    groups = {"shoulder": "?S?_joint", "elbow": "?E?_joint", "wrist": "?W?_joint"}
    fit = fitted(
        synthetic_recording(metric, arm, rng, count=6),
        parameters=[
            go.fitting.Parameter("armature", 0.04, joints=(pattern,), name=name)
            for name, pattern in groups.items()
        ],
    )
    assert fit.values == pytest.approx({"shoulder": 0.1, "elbow": 0.05, "wrist": 0.02}, rel=1e-2)
    assert [each.unit for each in fit.estimates] == ["kg m^2"] * 3


@dataclass(frozen=True)
class Stretched(go.Metric):
    """A user's metric with a parameter, on the plane."""

    stretch: Any = 1.0
    dim = 2

    def matrix(self, q: Any) -> Any:
        return ca.diagcat(1.0, 1.0 + self.stretch * q[0] ** 2)


class Squared(Stretched):
    """The same, not linear in its parameter."""

    def matrix(self, q: Any) -> Any:
        return ca.diagcat(1.0, 1.0 + (self.stretch * q[0]) ** 2)


def test_parameters_of_a_users_metric() -> None:
    model = go.load_model(PLANAR, hand="hand")
    data = synthetic_recording(Stretched(2.0), model, np.random.default_rng(1), count=4)
    fit = fitted(
        data, metric=lambda model: Stretched(), parameters=go.fitting.Parameter("stretch", 0.7)
    )
    assert fit.values["stretch"] == pytest.approx(2.0, rel=1e-3)
    assert fit.metric(model) == Stretched(fit.values["stretch"])


@pytest.mark.slow
def test_parameters_from_cubics(tmp_path: Path) -> None:
    model = go.load_model(PLANAR, hand="hand")
    rng = np.random.default_rng(1)
    data = synthetic_recording(Stretched(2.0), model, rng, count=6, curve="cubic")
    start = go.fitting.Parameter("stretch", 0.7)
    fit = fitted(data, metric=lambda model: Stretched(), parameters=start, curve="cubic")
    assert fit.curve == "cubic"
    assert "cubics, 1 recording" in repr(fit)
    assert fit.values["stretch"] == pytest.approx(2.0, rel=1e-3)
    assert fit.errors == pytest.approx(0.0, abs=1e-4)
    file = tmp_path / "metric.json"
    go.fitting.save_metric(file, fit)
    assert '"curve": "cubic"' in file.read_text()
    geodesics = fitted(data, metric=lambda model: Stretched(), parameters=start)
    assert geodesics.errors[0] > 0.01  # these motions are no geodesics


@pytest.mark.slow
def test_joint_inertia_from_noisy_cubics(arm: go.Model, true_metric: go.Metric) -> None:
    rng = np.random.default_rng(3)
    data = [
        synthetic_recording(
            true_metric, arm, rng, count=4, noise=0.003, name=f"r{k}", curve="cubic"
        )
        for k in range(3)
    ]
    fit = fitted(*data, curve="cubic", free_ends=True)
    (estimate,) = fit.estimates
    assert abs(estimate.value - TRUE) < 3.0 * estimate.standard_error
    assert 0.0 < estimate.standard_error < 0.1 * TRUE
    for each in go.fitting.separate_fits(fit).values():
        assert each.values["joint_inertia"] == pytest.approx(TRUE, rel=0.3)
    (interval,) = go.fitting.bootstrap_fit(fit, 50)
    assert interval.low < interval.high


@pytest.mark.slow
def test_solutions_that_are_worse_than_their_start_are_refused() -> None:
    model = go.load_model(PLANAR, hand="hand")
    rng = np.random.default_rng(1)
    data = synthetic_recording(Stretched(2.0), model, rng, count=3, curve="cubic")
    start = go.fitting.Parameter("stretch", 0.7)
    fit = fitted(data, metric=lambda model: Stretched(), parameters=start, curve="cubic")
    # From the solution with a wrong value, which does not fulfil the conditions, all is allowed.
    again = fit.program.solve(near=fit.outcome, fixed={0: 3.0})
    assert again.success
    assert again.objective > fit.outcome.objective
    back = fit.program.solve(near=again)
    assert back.objective == pytest.approx(fit.outcome.objective, abs=1e-9)


PLANAR = """
<robot name="planar">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.15 0 0"/><mass value="2.0"/>
    <inertia ixx="0.002" iyy="0.015" izz="0.015" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.13 0 0"/><mass value="1.2"/>
    <inertia ixx="0.001" iyy="0.009" izz="0.009" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" velocity="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="2.6" effort="50" velocity="10"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/>
    <origin xyz="0.3 0 0"/></joint>
</robot>
"""


@pytest.mark.slow
def test_derivatives_of_the_least_errors(noisy_fit: go.fitting.MetricFit) -> None:
    """By solving again with the parameter fixed nearby."""
    program, outcome = noisy_fit.program, noisy_fit.outcome
    value, step = float(outcome.x[0]), 0.01
    errors = [
        program.mean_squares(
            program.solve(near=outcome, fixed={0: (value + k * step) * program.start[0]}).x
        )
        / 2.0
        for k in (-1, 0, 1)
    ]
    first = (errors[2] - errors[0]) / (2.0 * step)
    second = (errors[2] - 2.0 * errors[1] + errors[0]) / step**2
    found = noisy_fit.derivatives
    size = np.abs(first).max()
    assert found.gradients[:, 0] == pytest.approx(first, abs=0.02 * size)
    assert found.hessians[:, 0, 0] == pytest.approx(second, abs=0.02 * np.abs(second).max())


@pytest.mark.slow
def test_a_metric_that_is_not_linear_in_its_parameter() -> None:
    """The equations of each recording have second derivatives by the parameter alone."""
    model, rng = go.load_model(PLANAR, hand="hand"), np.random.default_rng(1)
    data = [synthetic_recording(Stretched(4.0), model, rng, count=2) for _ in range(2)]
    start = go.fitting.Parameter("stretch", 1.4)
    fit = fitted(*data, metric=lambda model: Squared(), parameters=start)
    assert fit.values["stretch"] == pytest.approx(2.0, rel=1e-3)
    program, x = fit.program, fit.outcome.x
    factors = rng.normal(size=fit.outcome.lam_g.size)
    by_segment = program._curvatures(x, factors.reshape(4, -1))[:, 0, 0]
    for half, found in enumerate(by_segment.reshape(2, 2).sum(axis=1)):
        own = np.where(np.arange(factors.size) // (factors.size // 2) == half, factors, 0.0)
        hessian = program.program.functions["hess_lag"](x, np.ones(4), 0.0, own)
        assert found == pytest.approx(float(hessian[0, 0]), rel=1e-12)
        assert abs(found) > 1e-3


@pytest.mark.slow
def test_bootstrap_profile_and_leave_one_out(noisy_fit: go.fitting.MetricFit) -> None:
    curve = go.fitting.error_profile(noisy_fit, values=[0.02, 0.05, 0.12])
    assert curve.mean[1] < min(curve.mean[0], curve.mean[2])
    (interval,) = go.fitting.bootstrap_fit(noisy_fit, 200, by="subject")
    assert interval.low < noisy_fit.values["joint_inertia"] < interval.high
    assert interval.low > 0.8 * TRUE
    assert interval.high < 1.2 * TRUE
    assert interval.count == 3
    result = go.fitting.leave_one_out(noisy_fit, "subject")
    assert [each.name for each in result.left_out] == ["r0", "r1", "r2"]
    for each in result.left_out:
        assert each.values[0] == pytest.approx(TRUE, rel=0.15)
        assert each.errors.joint < each.straight_lines.joint
    assert len(rows_of_table(result.table())) == 3


@pytest.mark.slow
def test_one_newton_step_bootstraps_several_parameters(noisy: list[Any]) -> None:
    """For one parameter it agrees with the exact refits."""
    from geodesic_ocp.fitting.resampling import _newton_steps, refit

    fit = fitted(*noisy, free_ends=True)
    weights = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
    steps = _newton_steps(fit, weights)[:, 0]
    exact = [fit, refit(fit, [0, 1]), refit(fit, [1, 2])]
    assert steps == pytest.approx([each.values["joint_inertia"] for each in exact], rel=0.01)


@pytest.mark.slow
def test_files(noisy_fit: go.fitting.MetricFit, arm: go.Model, tmp_path: Path) -> None:
    file = tmp_path / "metric.json"
    go.fitting.save_metric(file, noisy_fit)
    metric = go.fitting.load_metric(file, arm)
    q = np.full(7, 0.2)
    assert metric.matrix(q) == pytest.approx(noisy_fit.metric(arm).matrix(q), rel=1e-12)
    child = go.human_arm("left", 1.2, 25.0)  # the same relative to its size
    assert go.fitting.load_metric(file, child).joint_inertia == metric.joint_inertia
    file.write_text(file.read_text().replace('"joint_inertia"', '"colour"'))
    with pytest.raises(go.RecordingError, match="no number 'colour'"):
        go.fitting.load_metric(file, arm)
    file.write_text(file.read_text().replace("AdjustableKineticEnergy", "Stretched"))
    with pytest.raises(go.RecordingError, match="holds parameters of Stretched"):
        go.fitting.load_metric(file, arm)


def test_wrong_arguments(noisy: list[Any], arm: go.Model) -> None:
    recording, segments = noisy[0]
    for start in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="start of payload"):
            go.fitting.Parameter("payload", start)
    with pytest.raises(ValueError, match="has no number 'weight'"):
        go.fitting.fit_metric(recording, go.fitting.Parameter("weight", 1.0))
    with pytest.raises(ValueError, match=r"no joint matches 'Knee'"):
        go.fitting.fit_metric(recording, go.fitting.Parameter("armature", 1.0, joints=("Knee",)))
    with pytest.raises(ValueError, match="measure must be one of joint, position"):
        go.fitting.fit_metric(recording, measure="hand")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="curve must be one of geodesic, cubic, got 'spline'"):
        go.fitting.fit_metric(recording, curve="spline")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="segments must be given for each of 1"):
        go.fitting.fit_metric(recording, segments=[segments, segments])
    with pytest.raises(ValueError, match="must cover samples 0 to 240 without gaps"):
        go.fitting.fit_metric(recording, segments=[[(0, 60), (120, 240)]])
    with pytest.raises(ValueError, match="payload is one number; it takes no joints"):
        go.fitting.fit_metric(recording, go.fitting.Parameter("payload", 1.0, joints=("?W*",)))
    with pytest.raises(ValueError, match="some of its joints have another parameter"):
        go.fitting.fit_metric(
            recording,
            [
                go.fitting.Parameter("armature", 0.1),
                go.fitting.Parameter("armature", 0.1, joints=("?W*",)),
            ],
        )
    with pytest.raises(ValueError, match="has no number 'model'"):
        go.fitting.fit_metric(recording, go.fitting.Parameter("model", 1.0))
    with pytest.raises(ValueError, match="joints must be a tuple of patterns"):
        go.fitting.Parameter("armature", 0.1, joints="RSx_joint")
    with pytest.raises(ValueError, match="metric must give the metric of a model"):
        go.fitting.fit_metric(recording, metric=go.Euclidean(7))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="different names"):
        go.fitting.fit_metric(recording, [go.fitting.Parameter("payload", 1.0)] * 2)
    with pytest.raises(ValueError, match="Euclidean has no number 'joint_inertia'; it has dim"):
        go.fitting.fit_metric(recording, metric=lambda model: go.Euclidean(7))
    still = go.Motion(recording.motion.time, 0.0 * recording.motion.q, arm.joint_names)
    with pytest.raises(ValueError, match=r"none of its"):
        go.fitting.fit_metric(go.trajectory.Recording(arm, still.filtered(21)), segments=[segments])


@pytest.mark.slow
def test_a_parameter_at_its_bound_leaves_the_others_as_they_are(noisy: list[Any]) -> None:
    """The recordings have no payload, so its estimate is the bound or close to it."""
    free = fitted(noisy[0], free_ends=True)
    payload = go.fitting.Parameter("payload", 0.5, upper=0.5)
    inertia = go.fitting.Parameter("joint_inertia", 0.03)
    fit = fitted(noisy[0], parameters=[inertia, payload], free_ends=True)
    first, second = fit.estimates
    assert second.at_bound  # for this noise
    assert np.isnan(second.standard_error)
    assert first.value == pytest.approx(free.values["joint_inertia"], rel=0.05)
    assert first.standard_error == pytest.approx(free.estimates[0].standard_error, rel=0.2)
    assert fit.undetermined == ()
    assert "at its bound" in text(fit.table())
    low, high = (
        go.fitting.ConfidenceInterval(name, *ends, 0.95, "recording", 2)
        for name, ends in (("joint_inertia", (0.04, 0.06)), ("payload", (np.nan, np.nan)))
    )
    assert np.isnan(rows_of_table(fit.table((low, high)))[1][-1])


@pytest.mark.slow
def test_armature_of_the_models_is_saved(
    arm: go.Model, true_metric: go.Metric, tmp_path: Path
) -> None:
    geared = arm.with_armature(0.02)
    data = synthetic_recording(true_metric, geared, np.random.default_rng(2), count=2)
    fit = fitted(data)
    file = tmp_path / "metric.json"
    go.fitting.save_metric(file, fit)
    q = np.full(7, 0.2)
    expected = fit.metric(geared).matrix(q)
    for model in (arm, geared):
        assert go.fitting.load_metric(file, model).matrix(q) == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_the_estimate_does_not_depend_on_the_initial_value(noisy: list[Any]) -> None:
    """On the same segments; from poor initial values the paths are found first."""
    values = [
        fitted(noisy[0], parameters=go.fitting.Parameter("joint_inertia", start)).values[
            "joint_inertia"
        ]
        for start in (0.01, 0.03, 0.3)
    ]
    assert values == pytest.approx(3 * [values[0]], rel=1e-4)


def test_heterogeneity_is_cochrans() -> None:
    def fits(*values: float) -> dict[str, SimpleNamespace]:
        kind = {"name": "armature", "at_bound": False}
        return {
            f"task {k}": SimpleNamespace(
                estimates=[SimpleNamespace(value=value, standard_error=0.1 * value, **kind)]
            )
            for k, value in enumerate(values)
        }

    (same,) = heterogeneity(fits(0.04, 0.04, 0.04))
    assert (same.q, same.i_squared) == pytest.approx((0.0, 0.0), abs=1e-20)
    (apart,) = heterogeneity(fits(0.048, 0.007))
    assert apart.q == pytest.approx((np.log(0.048 / 0.007) / 0.1) ** 2 / 2.0)
    assert apart.p < 1e-10
    assert apart.lowest == ("task 1", pytest.approx(0.007))
    assert np.isnan(heterogeneity(fits(0.04))[0].p)
