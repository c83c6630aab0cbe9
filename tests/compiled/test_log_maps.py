"""Many logarithms at once: as one by one, by every compiler; the shortest of many starts."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from all_metrics import METRICS, points
from known_metrics import HalfPlane, Sphere

import geodesic_ocp as go
from geodesic_ocp.compiled import library
from geodesic_ocp.compiled.source import source_text
from geodesic_ocp.logarithm.by_newton import find_many_by_newton


class Bumps(go.Metric):
    """A metric with a comparison, a conditional, and functions that libmvec has and has not."""

    dim, periods = 2, (np.inf, 2.0 * np.pi)

    def matrix(self, q):  # type: ignore[no-untyped-def]
        x, y = q[0], q[1]
        height = ca.if_else(x < 9.0, 1.0, 2.0) * ca.fmax(0.1, ca.exp(0.5 * ca.sin(y)))
        slope = ca.atan2(ca.cos(y), 3.0 + x**2)
        return ca.diag(ca.vertcat(height, 1.0 + slope**2))


def pairs(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    q0, q1 = (np.array([1.2, 1.0]) + rng.uniform(-0.7, 0.7, (count, 2)) for _ in range(2))
    q1[1], q1[2] = q0[1], q0[2] + 1e-8  # the same, and too near for Newton's method
    return q0, q1


def check_rows(metric: go.Metric, q0: np.ndarray, q1: np.ndarray) -> None:
    """Compare the logarithms in one call with those one by one."""
    expected = np.array([go.log(metric, *pair) for pair in zip(q0, q1, strict=True)])
    assert np.abs(go.log(metric, q0, q1) - expected).max() <= 1e-10
    lengths = [metric.norm(*each) for each in zip(q0, expected, strict=True)]
    assert go.distance(metric, q0, q1) == pytest.approx(lengths, abs=1e-10)


def test_rows_agree_with_the_loop(compiler: str) -> None:
    metric, (q0, q1) = Bumps(), pairs(21)
    check_rows(metric, q0, q1)
    q1[9, 0] = np.nan
    with pytest.raises(ValueError, match="row 9: q1 must"):
        go.log(metric, q0, q1)
    found = find_many_by_newton(metric, q0[10:], q1[10:])
    assert compiler == "system" or found is None
    assert found is None or np.all(np.isfinite(found.velocities))


def test_the_shortest_of_many_starts(compiler: str) -> None:
    """The way backwards is shorter than that of the straight line."""
    metric = Bumps()
    start, far, near = [0.2, 0.1], [0.9, 5.0], [0.9, 5.0 - 2.0 * np.pi]
    shortest = go.log(metric, start, near)
    assert metric.norm(start, shortest) < 0.5 * go.distance(metric, start, far, wrap=False)
    assert go.log(metric, start, far, num_starts=9) == pytest.approx(shortest, abs=1e-9)
    found = go.geodesic(metric, start, far, num_starts=9)
    assert found.velocity == pytest.approx(shortest, abs=1e-9)
    assert compiler == metric.kernels.compiler_name


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(METRICS.keys() - {"gravity"}))  # takes half a minute
def test_all_metrics(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if library.system_compiler() is None:
        pytest.skip("needs a compiler of the system")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "system")
    metric, rng = METRICS[name](), np.random.default_rng(7)
    if isinstance(metric, Sphere | HalfPlane):
        check_rows(metric, *pairs(21))
    else:
        check_rows(metric, *np.swapaxes([points(metric, rng, 2) for _ in range(9)], 0, 1))


def test_vectors_lack_some_operations() -> None:
    class Rounded(Bumps):
        def matrix(self, q):  # type: ignore[no-untyped-def]
            return super().matrix(q) * (1.0 + ca.floor(q[0]) ** 2)

    with_vectors, without = (
        source_text(each.kernel_functions, 2).split("#define WORK_SIZE")[0]
        for each in (Bumps(), Rounded())
    )
    assert "lanes_geodesic_rate" in with_vectors
    assert "lanes_geodesic_rate" not in without
