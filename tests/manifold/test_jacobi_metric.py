"""The Jacobi metric, compared with forward dynamics under gravity."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from known_models import planar_arm
from scipy.integrate import solve_ivp

import geodesic_ocp as go

DOWN_Y = pin.Motion(np.array([0.0, -9.81, 0.0]), np.zeros(3))


def in_gravity(model: go.Model) -> go.Model:
    """The model with gravity along -y, in the plane of a planar arm."""
    native = model.pin.copy()
    native.gravity = DOWN_Y
    return go.Model(native, model.hand)


def projectile() -> go.Model:
    native = pin.Model()
    x = native.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    y = native.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
    native.appendBodyToJoint(y, pin.Inertia(2.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    native.addFrame(pin.Frame("body", y, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    native.gravity = DOWN_Y
    return go.Model(native, "body")


SYSTEMS = {
    "pendulum": lambda: (
        in_gravity(planar_arm((1.0,), (1.3,), (0.5,), (0.1,))),
        [-1.6],
        [4.0],
    ),
    "double pendulum": lambda: (
        in_gravity(planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1))),
        [-1.2, 0.5],
        [1.5, -2.0],
    ),
    "human arm": lambda: (
        go.human_arm(),
        [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1],
        [2.0, -0.5, 0.8, 1.0, 0.6, -0.3, 0.5],
    ),
    "projectile": lambda: (projectile(), [0.0, 0.0], [3.0, 4.0]),
}


@pytest.mark.parametrize(
    "name",
    [
        "pendulum",
        "double pendulum",
        "projectile",
        pytest.param("human arm", marks=pytest.mark.slow),
    ],
)
def test_geodesics_are_paths_of_torque_free_motion(name: str) -> None:
    """dtau / dt = (E - V(t)) / (E - V(0)) for the parameter tau of constant speed."""
    model, q0, v0 = SYSTEMS[name]()
    n, data = model.dof, model.pin.createData()
    energy = v0 @ model.mass_matrix(q0) @ v0 / 2.0 + model.potential_energy(q0)
    metric = go.manifold.JacobiMetric(model, energy)
    left = energy - model.potential_energy(q0)

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        q, v = state[:n], state[n : 2 * n]
        clock = (energy - pin.computePotentialEnergy(model.pin, data, q)) / left
        return np.concatenate([v, pin.aba(model.pin, data, q, v, np.zeros(n)), [clock]])

    start = np.concatenate([q0, v0, [0.0]])
    motion = solve_ivp(rates, (0.0, 0.25), start, method="DOP853", rtol=1e-11, atol=1e-12)
    arrival, elapsed = motion.y[:n, -1], motion.y[-1, -1]
    assert go.exp(metric, q0, elapsed * np.array(v0)) == pytest.approx(arrival, abs=1e-8)
    found = go.log(metric, q0, arrival)
    assert go.exp(metric, q0, found) == pytest.approx(arrival, abs=1e-8)


def test_a_throw_is_a_parabola() -> None:
    """y = x v_y / v_x - g x^2 / (2 v_x^2) along the whole path."""
    model, v0 = projectile(), np.array([3.0, 4.0])
    metric = go.manifold.JacobiMetric(model, float(v0 @ v0))  # 2 kg
    x = 1.0
    goal = np.array([x, x * v0[1] / v0[0] - 9.81 * x**2 / (2.0 * v0[0] ** 2)])
    path = go.geodesic(metric, [0.0, 0.0], goal)
    slope = path(0.0, 1)[1] / path(0.0, 1)[0]
    positions = path(np.linspace(0.0, 1.0, 20))
    # The initial speed is given; the slope tells which of the two solutions was found.
    across = v0 @ v0 / (1.0 + slope**2)
    expected = slope * positions[:, 0] - 9.81 * positions[:, 0] ** 2 / (2.0 * across)
    assert positions[:, 1] == pytest.approx(expected, abs=1e-6)
    assert positions[-1] == pytest.approx(goal, abs=1e-9)


@pytest.mark.slow
def test_without_gravity_it_is_the_kinetic_energy_metric(arm: go.Model) -> None:
    native = arm.pin.copy()
    native.gravity = pin.Motion.Zero()
    metric = go.manifold.JacobiMetric(go.Model(native, arm.hand), 3.0)
    q, v = np.full(7, 0.2), np.linspace(-0.5, 0.5, 7)
    assert go.exp(metric, q, v) == pytest.approx(go.exp(go.KineticEnergy(arm), q, v), abs=1e-9)
    assert metric.norm(q, v) ** 2 == pytest.approx(3.0 * go.KineticEnergy(arm).norm(q, v) ** 2)


def test_points_above_the_energy_are_rejected() -> None:
    """With this energy the pendulum can hang but not reach the horizontal."""
    model, down, level = SYSTEMS["pendulum"]()[0], [-np.pi / 2], [0.0]
    metric = go.manifold.JacobiMetric(model, -1.0)
    with pytest.raises(ValueError, match=r"q: the potential energy 0 J .* not below .* of -1 J"):
        go.exp(metric, level, [1.0])
    with pytest.raises(ValueError, match=r"q1: the potential energy .* the model cannot be there"):
        go.log(metric, down, level)
    with pytest.raises(ValueError, match=r"the guess at 0\.25: the potential energy"):  # the top
        go.log(metric, down, [3.0 * np.pi / 2.0])
    with pytest.raises(go.IntegrationFailed, match="the metric is singular"):
        go.exp(metric, down, [3.0])
    with pytest.raises(ValueError, match="energy must be finite"):
        go.manifold.JacobiMetric(model, np.nan)
