"""The logarithmic map in the compiled core and by Ipopt."""

from __future__ import annotations

import threading
from ctypes import CFUNCTYPE, byref, c_char, c_int, c_void_p, cast

import casadi as ca
import numpy as np
import pytest
from all_metrics import METRICS, points
from known_metrics import HalfPlane, Sphere
from known_models import planar_arm, random_tree

import geodesic_ocp as go
from geodesic_ocp.compiled import library
from geodesic_ocp.logarithm import by_newton
from geodesic_ocp.logarithm.by_newton import STEP, Levels
from geodesic_ocp.manifold import kernels
from geodesic_ocp.manifold.kernels import Statistics, Tolerances
from geodesic_ocp.trajectory.grid import Grid

Q0, Q1 = np.array([0.3, 1.2]), np.array([1.4, 0.9])
ALL = {
    **METRICS,
    "planar arm with five links": lambda: go.KineticEnergy(
        planar_arm((1.0,) * 5, (1.3,) * 5, (0.4,) * 5, (0.2,) * 5)
    ),
    # The tree of METRICS has a constant tensor.
    "branching mechanism": lambda: go.KineticEnergy(
        go.Model(random_tree(np.random.default_rng(5), joints=6), "tool")
    ),
    "human arm of 75 kg": lambda: go.KineticEnergy(go.human_arm("right", 1.8, 75.0)),
}


@pytest.mark.parametrize("name", ["half-plane", "gravity", "region", *[*ALL][len(METRICS) :]])
@pytest.mark.usefixtures("tcc")
def test_both_routes_agree(name: str) -> None:
    q0, q1 = points(ALL[name](), np.random.default_rng(7), 2)
    by_ipopt, compiled = (go.log(ALL[name](), q0, q1, solver=each) for each in ("ipopt", "newton"))
    assert compiled == pytest.approx(by_ipopt, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["human arm", "branching mechanism"])
def test_optimized_code_agrees(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if library.system_compiler() is None:
        pytest.skip("needs a compiler of the system")
    metric = ALL[name]()
    q0, q1 = points(metric, np.random.default_rng(7), 2)
    expected = go.log(metric, q0, q1, solver="ipopt")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "system")
    optimized = ALL[name]()
    assert go.log(optimized, q0, q1) == pytest.approx(expected, abs=1e-9)
    assert optimized.kernels.compiler_name == "system"


@pytest.mark.usefixtures("compiler")
def test_the_sphere_at_any_distance() -> None:
    for angle in (1e-6, 0.1, 1.0, 2.0, 3.0, 3.1):
        velocity = go.log(Sphere(), [np.pi / 2, 0.0], [np.pi / 2, angle])
        assert velocity == pytest.approx([0.0, angle], abs=1e-9)


def status_of(
    metric: go.Metric,
    levels: Levels,
    tolerances: Tolerances,
    x: np.ndarray | None = None,
    ends: tuple[np.ndarray, np.ndarray] = (Q0, Q1),
) -> tuple[int, Statistics]:
    """Status and statistics of the compiled log map from the straight line, or from nodes x."""
    q0, q1 = ends
    assert metric.kernels.available()
    start = by_newton._start(levels, q0, q1, None) if x is None else x
    _, _, status, statistics = metric.kernels.log_map(
        q0, q1, start, levels.structures, levels.first, tolerances
    )
    return status, statistics


def levels(*grids: tuple[int, int], first: int = 0) -> Levels:
    return Levels(first, tuple(Grid(*each) for each in grids))


USUAL = Tolerances(STEP, 1e-10, 1e-9)


@pytest.mark.usefixtures("tcc")
def test_the_first_level_that_is_fine_enough_gives_the_result() -> None:
    far = np.array([-4.0, 0.3]), np.array([4.0, 0.3])
    for grids, ends, last in (
        (levels((1, 30), (2, 30)), (Q0, Q1), 0),
        (levels((1, 3), (1, 30), (2, 30)), far, 1),
    ):
        status, statistics = status_of(HalfPlane(), grids, USUAL, ends=ends)
        assert status == 0
        assert statistics.level == last
        assert statistics.error <= 1e-9
        assert statistics.newton_steps > 0
        assert statistics.integrations >= 2


def changed(name: str, factor: float) -> Levels:
    result = levels((1, 12))
    result._arrays[0][name] *= factor
    return result


@pytest.mark.usefixtures("tcc")
def test_every_way_to_fail() -> None:
    few = levels((1, 12))
    few.structures[0].max_steps = 1
    below = np.linspace([0.3, 1.2], [1.4, 0.9], 13)
    below[6, 1] = np.nan
    far = np.array([-2.0, 0.3]), np.array([2.0, 0.3])
    assert status_of(HalfPlane(), levels((1, 2)), USUAL, ends=far)[0] == 21
    for status, grids, tolerances, x in (
        (11, few, USUAL, None),
        (12, changed("products", -1.0), USUAL, None),
        (13, changed("products", 1e-9), USUAL, None),
        (14, levels((1, 12)), USUAL, below),
        (20, levels((1, 12)), Tolerances(1e-90, 1e-10, 1e-9), None),
        (22, levels((1, 2)), Tolerances(STEP, 0.0, 0.0), None),
    ):
        assert status_of(HalfPlane(), grids, tolerances, x)[0] == status
        assert status in by_newton._STATUS


class Chasm(go.Metric):
    """Flat, except that it is undefined for 0.5 < q0 < 0.6."""

    dim = 2

    def matrix(self, q: ca.SX) -> ca.SX:
        return ca.SX.eye(2) * (1.0 + q[1] ** 2 + 1e-30 * ca.sqrt((q[0] - 0.5) * (q[0] - 0.6)))


@pytest.mark.parametrize("compiler", ["tcc", "none"])
def test_where_the_metric_is_undefined(compiler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, compiler)
    with pytest.raises(ValueError, match="the metric is not finite and positive along the guess"):
        go.log(Chasm(), (0.0, 0.2), (1.0, 0.3))
    q0, q1 = (0.0, 0.2), (0.4, 0.3)
    assert go.exp(Chasm(), q0, go.log(Chasm(), q0, q1)) == pytest.approx(q1, abs=1e-8)


@pytest.mark.parametrize("metric", [HalfPlane(), Sphere()], ids=["half-plane", "sphere"])
@pytest.mark.usefixtures("tcc")
def test_continuation_in_an_added_diagonal(metric: go.Metric) -> None:
    grids = by_newton._CONTINUED
    assert metric.kernels.available()
    added = np.outer(by_newton._ADDED, np.diag(metric.matrix(Q0)))
    x = by_newton._start(grids, Q0, Q1, None)
    x[1:-1] += 0.2 * np.random.default_rng(0).normal(size=x[1:-1].shape)
    attempt = by_newton._pass(metric, Q0, Q1, grids, x, added)
    assert attempt.reason == ""
    assert attempt.velocity is not None
    assert go.exp(metric, Q0, attempt.velocity) == pytest.approx(Q1, abs=1e-9)


@pytest.mark.parametrize("segments", [1, 2, 4])
@pytest.mark.usefixtures("tcc")
def test_one_level_of_any_number_of_segments(segments: int) -> None:
    """The Hessian is factored segment by segment."""
    status, statistics = status_of(HalfPlane(), levels((segments, 24 // segments)), USUAL)
    assert status == 0
    assert statistics.newton_steps < 12


@pytest.mark.parametrize("degree", [2, 3])
def test_the_discrete_energy_of_a_geodesic_converges_with_twice_the_degree(degree: int) -> None:
    metric = HalfPlane()
    path = np.array([0.5, 1.0])  # (tanh t, 1 / cosh t) at unit speed, of energy 1 / 2
    errors, counts = [], [4, 8, 16]
    for segments in counts:
        grid = Grid(segments, degree)
        t = grid.nodes + path[0]
        x = np.column_stack([np.tanh(t), 1.0 / np.cosh(t)])
        errors.append(abs(go.Path(metric, grid, x).discrete_energy - 0.5))
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2 * degree, abs=0.4)


def test_the_pointers_to_lapack_and_blas(rng: np.random.Generator) -> None:
    a = rng.normal(size=(6, 6))
    matrix = np.asfortranarray(a @ a.T + np.eye(6))
    expected = np.linalg.cholesky(matrix).T
    factor, info, size = matrix.copy(order="F"), c_int(7), c_int(6)
    as_function = CFUNCTYPE(None, *[c_void_p] * 5)
    potrf = as_function(kernels.blas().potrf)
    upper = c_char(b"U")

    def at(value: object) -> c_void_p:
        return cast(byref(value), c_void_p)  # type: ignore[arg-type]

    potrf(at(upper), at(size), factor.ctypes.data, at(size), at(info))
    assert info.value == 0
    assert np.triu(factor) == pytest.approx(expected, abs=1e-12)
    indefinite = np.asfortranarray(np.diag([1.0, 2.0, -1.0, 1.0, 1.0, 1.0]))
    potrf(at(upper), at(size), indefinite.ctypes.data, at(size), at(info))
    assert info.value == 3


def test_threads_of_blas_are_restored_after_the_last_user() -> None:
    openblas = kernels._openblas()
    if openblas is None:
        pytest.skip("SciPy has no OpenBLAS of its own here")
    before = openblas.scipy_openblas_get_num_threads()
    entered, leave = threading.Event(), threading.Event()

    def other() -> None:
        with kernels.one_blas_thread:
            entered.set()
            leave.wait()

    thread = threading.Thread(target=other)
    thread.start()
    entered.wait()
    with kernels.one_blas_thread:
        assert openblas.scipy_openblas_get_num_threads() == 1
    assert openblas.scipy_openblas_get_num_threads() == 1
    leave.set()
    thread.join()
    assert openblas.scipy_openblas_get_num_threads() == before
