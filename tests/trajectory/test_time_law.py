"""The temporal path."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go


def cubic(length: float, duration: float, start: float, end: float, t: np.ndarray) -> np.ndarray:
    """The one cubic with these four boundary values: what calculus of variations gives."""
    square = (3 * length - (2 * start + end) * duration) / duration**2
    cube = (-2 * length + (start + end) * duration) / duration**3
    return start * t + square * t**2 + cube * t**3


@given(
    length=st.floats(0.0, 10.0),
    duration=st.floats(0.01, 20.0),
    start=st.floats(-2.0, 3.0),
    end=st.floats(-2.0, 3.0),
)
def test_unconstrained_is_the_cubic(
    length: float, duration: float, start: float, end: float
) -> None:
    law = go.time_law(length, duration, start, end)
    t = np.linspace(0.0, duration, 21)
    size = max(length, duration * max(abs(start), abs(end)), 1e-12)
    expected = cubic(length, duration, start, end, t)
    assert np.abs(law(t) - expected).max() <= 1e-9 * size
    assert law(0.0) == 0.0
    assert law(duration) == pytest.approx(length, abs=1e-9 * size)
    assert law(0.0, 1) == pytest.approx(start, abs=1e-9 * size / duration)
    assert law(duration, 1) == pytest.approx(end, abs=1e-9 * size / duration)


@given(length=st.floats(0.01, 1.0), start=st.floats(0.0, 5.0), end=st.floats(0.0, 5.0))
def test_monotone_laws_never_run_backwards(length: float, start: float, end: float) -> None:
    law = go.time_law(length, 1.0, start, end, monotone=True)
    speed = max(length, start, end)
    # Between the knots too: s' is a parabola with no coefficient below zero.
    assert law(np.linspace(0.0, 1.0, 2001), 1).min() >= -1e-9 * speed
    assert law(1.0) == pytest.approx(length, abs=1e-9 * speed)
    assert law(0.0, 1) == pytest.approx(start, abs=1e-9 * speed)
    assert law.cost >= go.time_law(length, 1.0, start, end).cost * (1.0 - 1e-6)


def test_monotone_law_that_waits_is_the_optimal_one() -> None:
    """Brake along u (1 - t/a)^2 to a halt, wait, start again; a and b by a Lagrange multiplier.

    Braking costs 4 u^2 / (3 a) and covers u a / 3; the least cost for a given length has a and b
    in the ratio of the roots of the end speeds.
    """
    length, start, end = 0.1, 1.0, 0.5
    root = 3 * length / (start**1.5 + end**1.5)
    brake, launch = root * np.sqrt([start, end])
    assert brake + launch < 1.0
    law = go.time_law(length, 1.0, start, end, monotone=True)
    best = 4 / 3 * (start**2 / brake + end**2 / launch)
    assert law.cost == pytest.approx(best, rel=1e-3)
    assert law.cost >= best * (1.0 - 1e-9)
    middle = np.linspace(brake + 0.02, 1.0 - launch - 0.02, 20)
    assert law(middle, 1) == pytest.approx(np.zeros(20), abs=1e-3)


def test_bounded_speed_is_kept_and_used() -> None:
    free = go.time_law(0.9, 1.0, 0.0, 0.0)
    law = go.time_law(0.9, 1.0, 0.0, 0.0, max_speed=1.2)
    assert free(0.5, 1) == pytest.approx(1.35)
    speeds = law(np.linspace(0.0, 1.0, 2001), 1)
    assert speeds.max() <= 1.2 * (1 + 1e-9)
    assert speeds.max() == pytest.approx(1.2, abs=1e-6)
    assert law.cost > free.cost


@pytest.mark.parametrize("ends", [(0.08, 0.08), (0.3, 0.0), (0.7, 1.0)])
@pytest.mark.parametrize("room", [0.002, 0.005, 0.05])
def test_hardly_any_room_below_the_bound(room: float, ends: tuple[float, float]) -> None:
    """Nearly all of the way at full speed, after braking or launching at once."""
    law = go.time_law(1.0, 1.0, *ends, max_speed=1.0 + room)
    speeds = law(np.linspace(0.0, 1.0, 2001), 1)
    assert speeds.max() <= (1.0 + room) * (1 + 1e-9)
    assert law(1.0) == pytest.approx(1.0, abs=1e-9)
    assert [law(0.0, 1), law(1.0, 1)] == pytest.approx(ends, abs=1e-9)


def test_cost_is_the_integral() -> None:
    law = go.time_law(0.4, 1.3, 0.9, 0.1, monotone=True)
    # The midpoint rule on a fine grid.
    t = (np.arange(200_000) + 0.5) / 200_000 * 1.3
    assert law.cost == pytest.approx(1.3 * np.mean(law(t, 2) ** 2), rel=1e-6)


def test_derivatives_and_shapes() -> None:
    law = go.time_law(1.0, 2.0, 0.1, 0.3)
    t, h = np.linspace(0.1, 1.9, 7), 1e-6
    for order in (1, 2):
        slope = (law(t + h, order - 1) - law(t - h, order - 1)) / (2 * h)
        assert law(t, order) == pytest.approx(slope, abs=1e-7)
    assert law(0.5).shape == ()
    assert law(t, 5).tolist() == [0.0] * 7
    assert law.duration == 2.0
    assert law.length == pytest.approx(1.0)


def test_no_length_and_no_speed_is_rest() -> None:
    law = go.time_law(0.0, 1.0, 0.0, 0.0, monotone=True)
    assert not law(np.linspace(0.0, 1.0, 5)).any()


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((1.0, 0.0, 0.0, 0.0), {}, r"duration must be positive \[s\], got 0.0"),
        ((-1.0, 1.0, 0.0, 0.0), {}, "length must not be negative"),
        ((1.0, 1.0, np.nan, 0.0), {}, "start_speed must be finite"),
        ((1.0, 1.0, -0.5, 0.0), {"monotone": True}, r"start_speed -0.5 lies outside \[0.0, inf\]"),
        ((1.0, 1.0, 0.0, 3.0), {"max_speed": 2.0}, r"end_speed 3 lies outside \[-inf, 2\]"),
        ((1.0, 1.0, 0.0, 0.0), {"max_speed": 0.5}, "0.5 is too low to cover 1 in 1 s"),
        ((0.0, 1.0, 1.0, 1.0), {"monotone": True}, "too short to stop in"),
        ((1.0, 1.0, 0.0, 0.0), {"max_speed": 1.0}, "needs the full speed throughout"),
        ((1.0, 1.0, 0.0, 0.0), {"max_speed": 0.0}, "max_speed must be positive"),
    ],
)
def test_impossible_laws_are_refused(
    arguments: tuple[float, ...], options: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        go.time_law(*arguments, **options)


def test_arguments_outside_the_law_are_named() -> None:
    law = go.time_law(1.0, 2.0, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"t must lie in \[0, 2\] s"):
        law(2.1)
    with pytest.raises(ValueError, match="order must not be negative"):
        law(1.0, -1)
