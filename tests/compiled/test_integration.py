"""Integration and parallel transport in the compiled core: orders, agreement, failures."""

from __future__ import annotations

from ctypes import byref, c_double, c_int, c_long, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from all_metrics import METRICS, points
from known_metrics import HalfPlane, Sphere
from motion_files import motion_in

import geodesic_ocp as go
from geodesic_ocp.compiled import library
from geodesic_ocp.compiled.source import STAGE_TIMES
from geodesic_ocp.manifold.kernels import _IntegrationRecord, integrate_by_scipy
from geodesic_ocp.synergies.segment import _Observed, _parallel_components

CURVED = sorted(METRICS.keys() - {"Euclidean"})


class Ending(go.Metric):
    """The half-line q < 1 with ds = (1 - q) dq, whose end is at a finite distance."""

    dim = 1

    def matrix(self, q: Any) -> Any:
        return (1.0 - q) ** 2


def slope(x: list[float], y: list[float]) -> float:
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def pointer(array: np.ndarray) -> c_void_p:
    return c_void_p(array.ctypes.data)


def steps_and_error(tolerance: float) -> tuple[float, float]:
    """Of the half-plane's geodesic (tanh t, 1 / cosh t) over [0, 3]."""
    metric = HalfPlane()
    library = metric.kernels.handle(True)
    assert library is not None
    start, times, states = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 3.0]), np.empty((2, 4))
    record = _IntegrationRecord(0.0, 0.0, 0)
    status = library.integrate_geodesic(
        pointer(start),
        c_int(2),
        pointer(times),
        c_double(tolerance),
        c_long(10_000),
        pointer(states),
        byref(record),
    )
    assert status == 0
    exact = np.array([np.tanh(3.0), 1.0 / np.cosh(3.0)])
    return float(record.steps), float(np.abs(states[1, :2] - exact).max())


@pytest.mark.usefixtures("compiler")
def test_errors_of_the_integration_decrease_with_order_8() -> None:
    steps, errors = zip(*map(steps_and_error, 10.0 ** np.arange(-4.0, -11.0, -1.0)), strict=True)
    assert -9.5 < slope(steps, errors) < -7.0


def latitude(colatitude: float, times: np.ndarray) -> np.ndarray:
    """The circle of latitude, and its velocity, (len(times), 4)."""
    states = np.tile([colatitude, 0.0, 0.0, 1.0], (times.size, 1))
    states[:, 1] = times
    return states


@pytest.mark.usefixtures("compiler")
def test_errors_of_the_transport_decrease_with_order_8() -> None:
    """Along a circle of latitude, vectors turn at the rate cos(colatitude)."""
    angle, colatitude = 6.0, 0.8
    metric, errors, counts = Sphere(), [], [2, 3, 4, 6, 8]
    assert metric.kernels.available()
    turned = angle * np.cos(colatitude)
    exact = np.array([np.cos(turned), -np.sin(turned) / np.sin(colatitude)])
    for count in counts:
        sizes = np.full(count, angle / count)
        times = (angle / count) * (np.arange(count)[:, None] + STAGE_TIMES)
        curve = latitude(colatitude, times.ravel()).reshape(count, STAGE_TIMES.size, 4)
        vectors, estimates = metric.kernels.transport(sizes, curve, np.array([1.0, 0.0]), 1e-9)
        assert vectors.shape == (count, 2)
        assert np.all(estimates > 0.0)
        errors.append(float(np.abs(vectors[-1] - exact).max()))
    assert slope(counts, errors) == pytest.approx(-8.0, abs=0.7)


@pytest.mark.usefixtures("compiler")
def test_components_in_a_parallel_frame_have_order_4() -> None:
    """Along a circle of latitude a parallel vector turns at the rate cos(colatitude)."""
    metric, colatitude = Sphere(), 0.8
    assert metric.kernels.available()
    errors = []
    for steps in (16, 32, 64):
        times = np.linspace(0.0, 4.0, 2 * steps + 1)
        curve = latitude(colatitude, times)
        components, _ = _parallel_components(metric, times[::2], curve, curve[::2, 2:])
        angle = np.cos(colatitude) * times[::2]
        exact = np.sin(colatitude) * np.column_stack([np.sin(angle), np.cos(angle)])
        sign = np.sign(components[1, 0])
        errors.append(np.abs(components * [sign, 1.0] - exact).max())
    assert slope([16, 32, 64], errors) < -3.8
    assert errors[-1] < 1e-6


def test_cuts_are_where_the_velocity_has_turned_from_the_transported_one() -> None:
    times = np.linspace(0.0, 4.0, 201)
    turning = np.cos(0.8) * times
    directions, state = np.column_stack([np.cos(turning), np.sin(turning)]), np.zeros(201, np.uint8)
    cuts = _Observed(times, directions, np.ones(201), state).cuts(0.5, 0.0, 0.0)
    # From the first instant after the cut.
    every = 0.5 / np.cos(0.8)
    assert np.diff(cuts)[0] == pytest.approx(every, abs=1e-4)
    assert np.all((np.diff(cuts)[1:-1] >= every - 1e-4) & (np.diff(cuts)[1:-1] <= every + 0.02))
    state[80:100] = 2  # a long rest is a segment
    state[120] = 1  # no velocity to compare with
    cuts = _Observed(times, directions, np.ones(201), state).cuts(3.0, 0.0, 0.0)
    assert cuts == [0.0, times[80], times[100], 4.0]


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVED)
def test_integrations_agree_with_those_of_scipy(
    name: str, tcc: None, rng: np.random.Generator
) -> None:
    metric = METRICS[name]()
    assert metric.kernels.available()
    q, v = points(metric, rng, 2)
    start, times = np.concatenate([q, 0.3 * v]), np.array([0.0, 0.1, 0.5, 0.6])
    states = metric.kernels.integrate(start, times, 1e-10, 1000)
    expected = integrate_by_scipy(metric.geodesic_equation, start, times, 1e-10, max_steps=1000)
    assert states == pytest.approx(expected, abs=1e-9, rel=1e-9)


@pytest.mark.parametrize(
    ("metric", "start", "tolerance", "max_steps", "words"),
    [
        (HalfPlane(), (0.0, 1.0, 1.0, 0.3), 1e-10, 5, "5 steps were not enough"),
        (Ending(), (0.0, 1.0), 1e-6, 5000, "the step fell to"),
    ],
)
def test_failures_are_those_of_scipy(
    metric: go.Metric,
    start: tuple[float, ...],
    tolerance: float,
    max_steps: int,
    words: str,
    compiler: str,
) -> None:
    kernels = type(metric)().kernels
    assert kernels.available()
    arguments = np.array(start), np.array([0.0, 2.0]), tolerance, max_steps
    with pytest.raises(go.IntegrationFailed, match=words) as compiled:
        kernels.integrate(*arguments)
    with pytest.raises(go.IntegrationFailed, match=words) as by_scipy:
        integrate_by_scipy(metric.geodesic_equation, *arguments[:3], max_steps=max_steps)
    if "fell" in words:  # where the metric is singular
        assert compiled.value.time == pytest.approx(by_scipy.value.time, abs=1e-6)


@pytest.mark.usefixtures("compiler")
def test_a_start_that_is_not_finite_fails() -> None:
    metric = HalfPlane()
    assert metric.kernels.available()
    with pytest.raises(go.IntegrationFailed, match="the step fell to"):
        metric.kernels.integrate(np.array([0.0, 1.0, np.nan, 0.3]), np.array([0.0, 2.0]), 1e-9, 99)


@pytest.mark.slow
@pytest.mark.parametrize("name", CURVED)
def test_parallel_transport_agrees_with_that_of_scipy(
    name: str, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    metric = METRICS[name]()
    q0, q1, v = points(metric, rng, 3)
    path = go.geodesic(metric, q0, q1)
    results = []
    for choice in ("tcc", "none"):
        monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, choice)
        fresh = METRICS[name]()
        if not fresh.kernels.available() and choice != "none":
            pytest.skip("needs TinyCC")
        results.append(go.parallel_transport(fresh, path, v))
        assert fresh.norm(q1, results[-1]) == pytest.approx(fresh.norm(q0, v), rel=1e-8)
    assert results[0] == pytest.approx(results[1], abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("threshold", "min_duration", "hysteresis"),
    [(0.3, 0.1, 0.1), (0.6, 0.1, 0.1), (1.2, 0.05, 0.0), (0.6, 0.0, 0.0)],
)
def test_segments_do_not_depend_on_the_compiler(
    bundled_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    threshold: float,
    min_duration: float,
    hysteresis: float,
) -> None:
    arm = go.human_arm("left", 1.78)
    motion = motion_in(bundled_file, arm.joint_names).filtered()
    segments = []
    for choice in ("tcc", "none"):
        monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, choice)
        metric = go.KineticEnergy(arm)
        if not metric.kernels.available() and choice != "none":
            pytest.skip("needs TinyCC")
        segments.append(
            go.segment(metric, motion, threshold, min_duration=min_duration, hysteresis=hysteresis)
        )
    assert segments[0] == segments[1]
