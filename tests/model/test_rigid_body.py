"""The symbolic back ends, compared with numeric Pinocchio."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from functools import cache as cached
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from known_models import configuration, free_rotor, planar_arm, random_tree

import geodesic_ocp as go
from geodesic_ocp.compiled import cache
from geodesic_ocp.model import dynamics
from geodesic_ocp.model.casadi_interface.library import prefix

# Rounding of a few hundred operations in different orders.
RELATIVE = 1e-12


@cached
def systems() -> dict[str, tuple[pin.Model, str]]:
    rng = np.random.default_rng(7)
    arms = {side: (go.human_arm(side).pin, "hand") for side in ("right", "left")}
    planar = planar_arm((1.0, 0.8, 0.5), (1.3, 0.7, 0.4), (0.4, 0.5, 0.2), (0.2, 0.1, 0.05))
    small = {"planar arm": (planar.pin, "tip"), "rotor": (free_rotor((1.0, 2.0, 2.5)).pin, "body")}
    sample = pin.buildSampleModelManipulator()
    robot = {"manipulator": (sample, sample.frames[sample.nframes - 1].name)}
    trees = {f"tree {index}": (random_tree(rng), "tool") for index in range(3)}
    return arms | small | robot | trees


def system(name: str) -> tuple[pin.Model, str]:
    """A copy, which a test may change, and its hand."""
    native, hand = systems()[name]
    return native.copy(), hand


def close(found: np.ndarray, expected: np.ndarray) -> bool:
    return bool(np.abs(found - expected).max() <= RELATIVE * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", systems())
def test_mass_matrix_and_pose(name: str, backend: str, rng: np.random.Generator) -> None:
    native, hand = system(name)
    model = go.Model(native, hand, backend)
    data = native.createData()
    for _ in range(8):
        q = rng.uniform(-3.0, 3.0, model.dof)
        full = configuration(native, q)
        upper = np.triu(pin.crba(native, data, full))
        assert close(model.mass_matrix(q), upper + np.triu(upper, 1).T)
        pin.framesForwardKinematics(native, data, full)
        pose = data.oMf[native.getFrameId(hand)]
        rotation, position = model.hand_pose(q)
        assert close(rotation, pose.rotation)
        assert close(position, pose.translation)
        jacobian = pin.computeFrameJacobian(
            native, data, full, native.getFrameId(hand), pin.LOCAL_WORLD_ALIGNED
        )
        assert close(model.hand_jacobian(q), jacobian)


@pytest.mark.parametrize("name", systems())
def test_potential_energy(name: str, backend: str, rng: np.random.Generator) -> None:
    native, hand = system(name)
    native.gravity = pin.Motion(np.array([0.3, -1.2, -9.0]), np.zeros(3))
    model, data = go.Model(native, hand, backend), native.createData()
    points = rng.uniform(-3.0, 3.0, (20, model.dof))
    expected = [pin.computePotentialEnergy(native, data, configuration(native, q)) for q in points]
    assert close(np.array([model.potential_energy(q) for q in points]), np.array(expected))


@pytest.mark.parametrize("name", systems())
def test_kinetic_energy_and_coriolis_force(
    name: str, backend: str, rng: np.random.Generator
) -> None:
    native, hand = system(name)
    model, weightless = go.Model(native, hand, backend), native.copy()
    weightless.gravity = pin.Motion.Zero()
    data, metric = weightless.createData(), go.KineticEnergy(model)
    for _ in range(8):
        q, v = rng.uniform(-3.0, 3.0, (2, model.dof))
        full = configuration(native, q)
        energy = pin.computeKineticEnergy(weightless, data, full, v)
        assert model.kinetic_energy(q, v) == pytest.approx(energy, rel=RELATIVE)
        force = pin.nonLinearEffects(weightless, data, full, v)
        # Terms cancel, so rounding is relative to the terms.
        terms = np.einsum("ijk,j,k->i", np.abs(metric.christoffel(q)), np.abs(v), np.abs(v))
        assert np.abs(model.coriolis_force(q, v) - force).max() <= RELATIVE * terms.max()


@pytest.mark.slow
@pytest.mark.parametrize("name", systems())
def test_coriolis_terms(name: str, backend: str, rng: np.random.Generator) -> None:
    native, hand = system(name)
    metric = go.KineticEnergy(go.Model(native, hand, backend))
    weightless = native.copy()
    weightless.gravity = pin.Motion.Zero()
    data = weightless.createData()
    for _ in range(8):
        q, v = rng.uniform(-3.0, 3.0, (2, metric.dim))
        expected = pin.rnea(weightless, data, configuration(native, q), v, np.zeros(metric.dim))
        found = np.einsum("ijk,j,k->i", metric.christoffel(q), v, v)
        # Terms cancel, so rounding is relative to the terms.
        terms = np.einsum("ijk,j,k->i", np.abs(metric.christoffel(q)), np.abs(v), np.abs(v))
        assert np.abs(found - expected).max() <= RELATIVE * terms.max()


@pytest.mark.parametrize("name", systems())
def test_inverse_dynamics(name: str, backend: str, rng: np.random.Generator) -> None:
    native, hand = system(name)
    native.armature = rng.uniform(0.1, 1.0, native.nv)
    free_fall = np.array([3.0, -8.0, -5.0])
    native.gravity = pin.Motion(free_fall, np.zeros(3))
    model, data = go.Model(native, hand, backend), native.createData()
    q, v, a = rng.uniform(-3.0, 3.0, (3, 20, model.dof))
    expected = [
        pin.rnea(native, data, configuration(native, q[k]), v[k], a[k]) for k in range(len(q))
    ]
    found = model.inverse_dynamics(q, v, a, free_fall)
    assert close(found, np.array(expected))
    assert np.array_equal(model.inverse_dynamics(q[0], v[0], a[0], free_fall), found[0])
    by_terms = model.mass_matrix(q[0]) @ a[0] + model.coriolis_force(q[0], v[0])
    assert close(model.inverse_dynamics(q[0], v[0], a[0], np.zeros(3)), by_terms)


def test_inverse_dynamics_of_wrong_states_names_the_argument() -> None:
    model = go.human_arm("right")
    rows = np.zeros((4, model.dof))
    with pytest.raises(ValueError, match="v must be finite, of shape"):
        model.inverse_dynamics(rows, rows[:2], rows)
    with pytest.raises(ValueError, match="gravity must have shape"):
        model.inverse_dynamics(rows[0], rows[0], rows[0], (0.0, 9.81))


def test_trees_that_are_not_numbered_depth_first(backend: str, rng: np.random.Generator) -> None:
    """There crba omits entries, unlike the torques of unit accelerations."""
    native = random_tree(rng, depth_first=False)
    model = go.Model(native, "tool", backend)
    native.gravity = pin.Motion.Zero()
    data, q, still = native.createData(), rng.uniform(-3.0, 3.0, model.dof), np.zeros(model.dof)
    full = configuration(native, q)
    columns = [pin.rnea(native, data, full, still, unit) for unit in np.eye(model.dof)]
    assert not close(np.triu(pin.crba(native, data, full)), np.triu(np.array(columns)))
    assert close(model.mass_matrix(q), np.array(columns))
    v = rng.uniform(-3.0, 3.0, model.dof)
    assert model.kinetic_energy(q, v) == pytest.approx(v @ np.array(columns) @ v / 2, rel=RELATIVE)
    assert close(model.coriolis_force(q, v), pin.nonLinearEffects(native, data, full, v))


def test_armature_adds_to_the_diagonal(backend: str, rng: np.random.Generator) -> None:
    native = random_tree(rng)
    bare = go.Model(native, "tool", backend)
    native.armature = rng.uniform(0.1, 1.0, native.nv)
    model = go.Model(native, "tool", backend)
    q, v = rng.uniform(-1.0, 1.0, (2, model.dof))
    upper = np.triu(pin.crba(native, native.createData(), configuration(native, q)))
    tensor = upper + np.triu(upper, 1).T
    assert close(model.mass_matrix(q), tensor)
    assert model.kinetic_energy(q, v) == pytest.approx(v @ tensor @ v / 2, rel=RELATIVE)
    assert np.array_equal(model.coriolis_force(q, v), bare.coriolis_force(q, v))


@pytest.mark.parametrize("name", systems())
def test_backends_agree(name: str, rng: np.random.Generator) -> None:
    """In values, and in the second derivatives for the optimizer."""
    if missing := dynamics.why_unavailable("pinocchio.casadi"):
        pytest.skip(f"pinocchio.casadi cannot be used here: {missing}")
    native, hand = system(name)
    pair = [go.Model(native, hand, backend) for backend in dynamics.BACKENDS]
    hessians = [lagrangian_hessian(model) for model in pair]
    for _ in range(5):
        q, v = rng.uniform(-3.0, 3.0, (2, native.nv))
        assert close(*(model.mass_matrix(q) for model in pair))
        assert close(*(model.coriolis_force(q, v) for model in pair))
        assert close(*(np.array(model.kinetic_energy(q, v)) for model in pair))
        assert close(*(model.hand_jacobian(q) for model in pair))
        for found, expected in zip(*(model.hand_pose(q) for model in pair), strict=True):
            assert close(found, expected)
        assert close(*(np.array(hessian(q, v)) for hessian in hessians))


def test_rounding_noise_of_a_file_does_not_grow_the_graph(backend: str) -> None:
    """A rotation by pi / 2 is as sparse as if given as a matrix."""
    quarter = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    counts = []
    for turn in (quarter, pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0)):
        placement, native, parent = pin.SE3(turn, np.array([0.1, 0.2, 0.3])), pin.Model(), 0
        for index in range(5):
            parent = native.addJoint(parent, pin.JointModelRZ(), placement, f"joint{index}")
            body = pin.Inertia(1.0, np.array([0.1, 0.2, 0.3]), np.diag([1.0, 2.0, 2.5]))
            native.appendBodyToJoint(parent, body, pin.SE3.Identity())
        native.addFrame(pin.Frame("tool", parent, placement, pin.FrameType.OP_FRAME))
        model, q = go.Model(native, "tool", backend), ca.SX.sym("q", 5)
        outputs = [model.mass_matrix(q), model.coriolis_force(q, q), *model.hand_pose(q)]
        counts.append(ca.Function("f", [q], outputs).n_instructions())
    assert counts[0] == counts[1]


def lagrangian_hessian(model: go.Model) -> ca.Function:
    """Second derivatives of v' G(q) v / 2 with respect to q and v."""
    q, v = ca.SX.sym("q", model.dof), ca.SX.sym("v", model.dof)
    energy = ca.bilin(model.mass_matrix(q), v, v) / 2
    return ca.Function("hessian", [q, v], [ca.hessian(energy, ca.vertcat(q, v))[0]])


def test_backend_is_chosen_by_argument_then_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(dynamics.ENVIRONMENT_VARIABLE, "built-in")
    assert go.human_arm().backend == "built-in"
    monkeypatch.setenv(dynamics.ENVIRONMENT_VARIABLE, "abacus")
    with pytest.raises(ValueError, match=r"backend must be one of.*'abacus'"):
        go.human_arm()
    assert go.human_arm(backend="built-in").backend == "built-in"


@pytest.fixture
def no_interface(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[pytest.MonkeyPatch]:
    """An environment in which Pinocchio's CasADi interface is neither installed nor built."""
    monkeypatch.delenv(dynamics.ENVIRONMENT_VARIABLE, raising=False)
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(tmp_path))
    missing = ModuleNotFoundError("No module", name="pinocchio.casadi")
    monkeypatch.setattr(importlib, "import_module", fails(missing))
    dynamics._module.cache_clear()
    yield monkeypatch
    dynamics._module.cache_clear()


def fails(error: ImportError) -> Callable[[str], None]:
    def import_module(name: str) -> None:
        assert name == "pinocchio.casadi"
        raise error

    return import_module


def test_the_default_does_not_depend_on_what_is_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(dynamics.ENVIRONMENT_VARIABLE, raising=False)
    assert go.human_arm().backend == "built-in"
    monkeypatch.setenv(dynamics.ENVIRONMENT_VARIABLE, "")
    assert go.human_arm().backend == "built-in"


def test_missing_backend_is_named(no_interface: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match=r"'pinocchio\.casadi' cannot be.*make pinocchio-casadi"):
        go.human_arm(backend="pinocchio.casadi")
    no_interface.setenv(dynamics.ENVIRONMENT_VARIABLE, "pinocchio.casadi")
    with pytest.raises(ValueError, match=r"'pinocchio\.casadi' cannot be.*make pinocchio-casadi"):
        go.human_arm()


def test_an_interface_for_other_versions_is_named(
    no_interface: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "pinocchio_casadi").mkdir()
    (tmp_path / "pinocchio_casadi" / "pin-3.0.0_casadi-3.6.5_elsewhere_0_0.so").touch()
    with pytest.raises(ValueError, match=r"for other versions \(pin-3\.0\.0_.*not for pin-4"):
        go.human_arm(backend="pinocchio.casadi")


def test_a_damaged_interface_is_named(no_interface: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "pinocchio_casadi").mkdir(mode=0o700)
    (tmp_path / "pinocchio_casadi" / f"{prefix()}0.so").write_bytes(b"no library")
    with pytest.raises(ValueError, match=r"0\.so cannot be loaded"):
        go.human_arm(backend="pinocchio.casadi")


def test_a_module_that_cannot_be_imported_is_named(no_interface: pytest.MonkeyPatch) -> None:
    broken = ImportError("undefined symbol: _ZN6casadi")
    no_interface.setattr(importlib, "import_module", fails(broken))
    assert go.human_arm().backend == "built-in"  # does not even try
    with pytest.raises(ValueError, match=r"is installed, but cannot be imported: undefined symbol"):
        go.human_arm(backend="pinocchio.casadi")


def test_a_composite_of_one_joint_is_that_joint(backend: str, rng: np.random.Generator) -> None:
    """Also where it has a placement of its own."""
    native, parent = pin.Model(), 0
    for index, kind in enumerate((pin.JointModelRZ(), pin.JointModelHX(0.2), pin.JointModelPY())):
        placement = pin.SE3(pin.rpy.rpyToMatrix(rng.uniform(-1.0, 1.0, 3)), rng.normal(size=3))
        joint = pin.JointModelComposite(kind, placement)
        parent = native.addJoint(parent, joint, placement, f"joint{index}")
        body = pin.Inertia(1.5, rng.normal(size=3), np.diag([1.0, 2.0, 2.5]))
        native.appendBodyToJoint(parent, body, pin.SE3.Identity())
    native.addFrame(pin.Frame("tool", parent, placement, pin.FrameType.OP_FRAME))
    model, data, q = go.Model(native, "tool", backend), native.createData(), rng.normal(size=3)
    upper = np.triu(pin.crba(native, data, q))
    assert close(model.mass_matrix(q), upper + np.triu(upper, 1).T)
    pin.framesForwardKinematics(native, data, q)
    assert close(model.hand_pose(q)[1], data.oMf[native.getFrameId("tool")].translation)


@pytest.mark.parametrize(
    "joint", [pin.JointModelSpherical(), pin.JointModelFreeFlyer(), pin.JointModelPlanar()]
)
def test_joints_with_several_degrees_of_freedom_are_rejected_by_name(joint: pin.JointModel) -> None:
    native = pin.Model()
    index = native.addJoint(0, joint, pin.SE3.Identity(), "hip")
    native.addFrame(pin.Frame("foot", index, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    with pytest.raises(ValueError, match=f"joint 'hip' is a {joint.shortname()}"):
        go.Model(native, "foot")


def test_symbolic_arguments_give_symbolic_results(arm: go.Model) -> None:
    for kind in (ca.SX, ca.MX):
        q = kind.sym("q", arm.dof)
        assert isinstance(arm.mass_matrix(q), kind)
        assert isinstance(arm.kinetic_energy(q, q), kind)
        assert isinstance(arm.coriolis_force(q, np.ones(arm.dof)), kind)
        assert all(isinstance(part, kind) for part in arm.hand_pose(q))
