"""Joint inertia (armature): G(q) + diag(a) in every variant of a model."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from known_models import random_tree
from numpy.testing import assert_allclose

import geodesic_ocp as go

ARM = go.human_arm("right")
INERTIAS = arrays(float, 7, elements=st.floats(0.0, 10.0))  # [kg m^2]
ANGLES = arrays(float, 7, elements=st.floats(-3.0, 3.0))  # [rad]
ROUNDING = 1e-12

VARIANTS: dict[str, Callable[[go.Model], go.Model]] = {
    "payload": lambda arm: arm.with_payload(1.5, (0.0, 0.0, 0.1)),
    "limits": lambda arm: arm.with_limits(upper={"REx_joint": 2.0}),
    "hand": lambda arm: arm.with_hand("right forearm"),
    "bodies": lambda arm: arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1, "right hand")),
    "pin.Model": lambda arm: go.Model(arm.pin, arm.hand),
    "load_model": lambda arm: go.load_model(arm.pin, hand="hand"),
    "copy": copy.deepcopy,
}


@pytest.mark.slow
@settings(max_examples=8)  # each builds four models
@given(armature=INERTIAS, q=ANGLES)
def test_armature_adds_to_the_diagonal(armature: np.ndarray, q: np.ndarray) -> None:
    """However it was given: as n numbers, by name, or when the arm was made."""
    expected = ARM.mass_matrix(q) + np.diag(armature)
    by_name = dict(zip(ARM.joint_names, armature.tolist(), strict=True))
    for geared in (
        ARM.with_armature(armature),
        ARM.with_armature(by_name),
        go.human_arm("right", armature=by_name),
        ARM.with_armature(3.0).with_armature(armature.tolist()),  # replaces, does not add
    ):
        assert np.array_equal(geared.armature, armature)
        assert_allclose(geared.mass_matrix(q), expected, rtol=ROUNDING, atol=ROUNDING)
    assert not ARM.armature.any()


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_of_a_model_keeps_it(variant: str, rng: np.random.Generator) -> None:
    armature = rng.uniform(0.01, 1.0, 7)
    change = VARIANTS[variant]
    geared, bare = change(ARM.with_armature(armature)), change(ARM)
    assert np.array_equal(geared.armature, armature)
    for q in rng.uniform(-1.0, 1.0, (3, 7)):
        expected = bare.mass_matrix(q) + np.diag(armature)
        assert_allclose(geared.mass_matrix(q), expected, rtol=ROUNDING, atol=ROUNDING)


def test_energy_has_it_and_coriolis_forces_do_not(backend: str, rng: np.random.Generator) -> None:
    """As diag(a) is constant; also where Pinocchio's crba cannot number the joints."""
    for depth_first in (True, False):
        bare = go.Model(random_tree(rng, depth_first=depth_first), "tool", backend)
        armature = rng.uniform(0.1, 1.0, bare.dof)
        geared = bare.with_armature(armature)
        q, v = rng.uniform(-1.0, 1.0, (2, bare.dof))
        expected = bare.mass_matrix(q) + np.diag(armature)
        assert_allclose(geared.mass_matrix(q), expected, rtol=ROUNDING, atol=ROUNDING)
        energy = bare.kinetic_energy(q, v) + armature @ v**2 / 2
        assert geared.kinetic_energy(q, v) == pytest.approx(energy, rel=ROUNDING)
        assert np.array_equal(geared.coriolis_force(q, v), bare.coriolis_force(q, v))


def test_those_not_named_keep_theirs() -> None:
    arm = ARM.with_armature(0.05).with_armature({"RWx_joint": 0.2})
    assert arm.armature.tolist() == [0.05] * 5 + [0.2, 0.05]
    assert ARM.with_armature({}).armature.tolist() == [0.0] * 7
    with pytest.raises(ValueError, match="read-only"):
        arm.armature[0] = 1.0


def test_combined_models_keep_theirs(rng: np.random.Generator) -> None:
    first, second = rng.uniform(0.1, 1.0, (2, 7))
    arms = go.human_arm("left", armature=first), go.human_arm("right", armature=second)
    both = go.model.combine(*arms, placements=[(-0.2, 0.0, 1.4), (0.2, 0.0, 1.4)])
    assert np.array_equal(both.armature, [*first, *second])
    twice = go.model.combine(arms[0], arms[0])
    q = rng.uniform(-1.0, 1.0, 7)
    whole = twice.mass_matrix([*q, *q])
    for part in (slice(0, 7), slice(7, 14)):
        expected = arms[0].mass_matrix(q)
        assert_allclose(whole[part, part], expected, rtol=ROUNDING, atol=ROUNDING)


def test_a_reduced_model_keeps_that_of_the_moving_joints(rng: np.random.Generator) -> None:
    geared = ARM.with_armature(rng.uniform(0.1, 1.0, 7))
    moving = ["RSz_joint", "REx_joint", "RWy_joint"]
    kept = [ARM.joint_names.index(name) for name in moving]
    reduced, bare = (go.load_model(arm.pin, hand="hand", joints=moving) for arm in (geared, ARM))
    assert np.array_equal(reduced.armature, geared.armature[kept])
    q = rng.uniform(-1.0, 1.0, 3)
    expected = bare.mass_matrix(q) + np.diag(geared.armature[kept])
    assert_allclose(reduced.mass_matrix(q), expected, rtol=ROUNDING, atol=ROUNDING)


def test_metrics_with_it_can_be_pickled(rng: np.random.Generator) -> None:
    metric = go.KineticEnergy(ARM.with_armature(0.05))
    q = rng.uniform(-1.0, 1.0, 7)
    again = pickle.loads(pickle.dumps(metric))
    assert np.array_equal(again.matrix(q), metric.matrix(q))
    assert again.model.armature.tolist() == [0.05] * 7


@pytest.mark.slow
def test_body_mass_scales_geodesics_no_more() -> None:
    """It is in kg m^2 and stays as given; only a / (M H^2) changes geodesics."""
    q0, v = np.full(7, 0.2), np.array([1.0, -0.5, 0.3, 1.0, 0.5, 0.3, -0.4])

    def end(height: float, mass: float, armature: float) -> np.ndarray:
        arm = go.human_arm("right", height, mass, armature=armature)
        return np.asarray(go.exp(go.KineticEnergy(arm), q0, v))

    reference = end(1.75, 70.0, 0.05)
    assert_allclose(end(1.75, 140.0, 0.1), reference, rtol=0, atol=1e-8)
    assert_allclose(end(1.8, 70.0, 0.05 * (1.8 / 1.75) ** 2), reference, rtol=0, atol=1e-8)
    assert np.abs(end(1.75, 140.0, 0.05) - reference).max() > 1e-3


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_gimbal_lock_of_the_shoulder_is_no_singularity_any_more(sign: float) -> None:
    """Where the axes Sx and Sy are parallel, opposite rotations move no mass."""
    q = np.array([0.3, sign * np.pi / 2, -0.5, 0.8, 0.1, 0.0, 0.1])
    assert np.linalg.eigvalsh(ARM.mass_matrix(q))[0] < 1e-15
    geared = ARM.with_armature(0.05)
    assert np.linalg.eigvalsh(geared.mass_matrix(q))[0] >= 0.05 - ROUNDING
    before, after = q.copy(), q.copy()
    before[1] -= 0.4
    after[1] += 0.4
    geodesic = go.geodesic(go.KineticEnergy(geared), before, after)  # crosses the gimbal lock
    arrival = go.exp(go.KineticEnergy(geared), before, geodesic.velocity)
    assert_allclose(arrival, after, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-0.1, r"armature of joint 'RSx_joint' must be finite and not negative, got -0\.1"),
        ({"RWy_joint": -1.0}, "armature of joint 'RWy_joint' must be finite and not negative"),
        (np.inf, "armature must be a finite number, got inf"),
        (np.nan, "armature must be a finite number, got nan"),
        ([0.1] * 6 + [np.inf], "armature of joint 'RWy_joint' must be finite"),
        ([0.1] * 6 + [np.nan], "armature must be 7 numbers"),
        ([0.1, 0.2], r"armature must be 7 numbers, got \[0\.1, 0\.2\]"),
        (np.eye(7), "armature must be 7 numbers"),
        ("much", "armature must be a finite number, got 'much'"),
        (None, "armature must be a finite number, got None"),
        ({"elbow": 0.1}, "armature: 'elbow' is not one of the joints RSx_joint"),
        ({"RWy_joint": "x"}, "armature must be 7 numbers"),
        (True, "armature must be numbers, not truth values, got True"),
        ([0.1] * 6 + [True], "armature must be numbers, not truth values"),
        (np.ones(7, dtype=bool), "armature must be numbers, not truth values"),
        ({"RWy_joint": False}, "armature must be numbers, not truth values"),
    ],
)
def test_wrong_values_are_named(value: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ARM.with_armature(value)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        go.human_arm("right", armature=value)  # type: ignore[arg-type]


def test_a_pin_model_with_a_negative_one_is_rejected() -> None:
    native = ARM.pin.copy()
    native.armature = np.array([0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="armature of joint 'REx_joint' must be finite"):
        go.Model(native, "hand")


def test_a_massless_link_with_it_is_accepted() -> None:
    """And without it, the message says what would help."""
    native = pin.Model()
    joint = native.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hinge")
    native.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.BODY))
    with pytest.raises(ValueError, match="nor any later link has mass, and the joint has no arma"):
        go.load_model(native, hand="tip")
    native.armature = np.array([0.2])
    assert go.load_model(native, hand="tip").mass_matrix([0.4]).tolist() == [[0.2]]
