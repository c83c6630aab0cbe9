"""The temporal path."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go
from geodesic_ocp.ipopt import Ipopt


def cubic(length: float, duration: float, start: float, end: float, t: np.ndarray) -> np.ndarray:
    """The unique cubic with these four boundary values, which satisfies the Euler equation."""
    square = (3 * length - (2 * start + end) * duration) / duration**2
    cube = (-2 * length + (start + end) * duration) / duration**3
    return start * t + square * t**2 + cube * t**3


@given(
    length=st.floats(0.0, 10.0),
    duration=st.floats(0.01, 20.0),
    start=st.floats(-2.0, 3.0),
    end=st.floats(-2.0, 3.0),
)
def test_time_law_without_bounds_is_the_cubic(
    length: float, duration: float, start: float, end: float
) -> None:
    law = go.trajectory.time_law(length, duration, start, end)
    t = np.linspace(0.0, duration, 21)
    size = max(length, duration * max(abs(start), abs(end)), 1e-12)
    expected = cubic(length, duration, start, end, t)
    assert np.abs(law(t) - expected).max() <= 1e-9 * size
    assert law(0.0) == 0.0
    assert law(duration) == pytest.approx(length, abs=1e-9 * size)
    assert law(0.0, 1) == pytest.approx(start, abs=1e-9 * size / duration)
    assert law(duration, 1) == pytest.approx(end, abs=1e-9 * size / duration)


@pytest.mark.parametrize("monotone", [False, True])
def test_a_cubic_that_is_monotone_is_kept(monotone: bool) -> None:
    law = go.trajectory.time_law(1.0, 1.0, 0.5, 0.5, monotone=monotone)
    assert law.knots.tolist() == [0.0, 1.0]
    t = np.linspace(0.0, 1.0, 11)
    assert law(t) == pytest.approx(cubic(1.0, 1.0, 0.5, 0.5, t), abs=1e-15)


def solved_by_ipopt(law: go.trajectory.TimeLaw) -> go.trajectory.TimeLaw:
    """The NLP over piecewise cubics whose knots contain those of a law, with its ends and length.

    The speed is a parabola on each piece, whose three Bezier coefficients are not negative.
    """
    knots = np.unique(np.concatenate([np.linspace(*piece, 4) for piece in pairwise(law.knots)]))
    count, h = knots.size, np.diff(knots)
    s, u = ca.SX.sym("s", count), ca.SX.sym("u", count)
    chord, start, stop = (s[1:] - s[:-1]) / h, u[:-1], u[1:]
    # The acceleration is linear on a piece: its values at the piece's ends.
    first, last = (6 * chord - 4 * start - 2 * stop) / h, (2 * start + 4 * stop - 6 * chord) / h
    cost = ca.sum1(h / 3 * (first**2 + first * last + last**2))
    solver = Ipopt(
        {"x": ca.vertcat(s, u), "f": cost, "g": 3 * chord - start - stop},
        options={"tol": 1e-11, "bound_relax_factor": 0.0},
    )
    lower = np.repeat([-np.inf, 0.0], count)
    upper = np.full(2 * count, np.inf)
    fixed = [0, count - 1, count, 2 * count - 1]
    lower[fixed] = upper[fixed] = [0.0, law.length, law.speeds[0], law.speeds[-1]]
    guess = np.concatenate([knots * law.length / knots[-1], np.full(count, law.length / knots[-1])])
    limits = {"lbx": lower, "ubx": upper, "lbg": 0.0, "ubg": np.inf}
    outcome = solver(x0=guess, **limits)
    assert outcome.success
    return go.trajectory.TimeLaw(knots, *np.split(outcome.x, 2))


@pytest.mark.parametrize(
    ("length", "start", "end"),
    [
        (0.1, 1.0, 0.5),  # brake, pause, accelerate
        (0.2, 1.0, 0.0),  # brake, then rest
        (0.15, 0.2, 1.0),
    ],
)
def test_closed_form_is_the_optimum_that_ipopt_finds(
    length: float, start: float, end: float
) -> None:
    law = go.trajectory.time_law(length, 1.0, start, end, monotone=True)
    assert law.knots.size > 2
    reference = solved_by_ipopt(law)
    t = np.linspace(0.0, 1.0, 301)
    assert law(t) == pytest.approx(reference(t), abs=1e-7)
    assert law.cost == pytest.approx(reference.cost, rel=1e-7)


def test_the_bound_is_reached_where_the_cubic_first_touches_it() -> None:
    """Where the cubic's speed has its minimum at zero, both forms are the same."""
    # u = (t - 0.4)^2 touches zero at 0.4, from 0.16 to 0.36.
    touching = (0.4**3 + 0.6**3) / 3.0
    t = np.linspace(0.0, 1.0, 101)
    for length in (touching * (1 + 1e-7), touching * (1 - 1e-7)):
        law = go.trajectory.time_law(length, 1.0, 0.16, 0.36, monotone=True)
        assert law(t, 1) == pytest.approx((t - 0.4) ** 2, abs=1e-6)


@given(length=st.floats(0.01, 1.0), start=st.floats(0.0, 5.0), end=st.floats(0.0, 5.0))
def test_speed_of_a_monotone_time_law_is_never_negative(
    length: float, start: float, end: float
) -> None:
    law = go.trajectory.time_law(length, 1.0, start, end, monotone=True)
    speed = max(length, start, end)
    # Also between the knots: s' is a parabola without negative Bezier coefficients.
    assert law(np.linspace(0.0, 1.0, 2001), 1).min() >= -1e-9 * speed
    assert law(1.0) == pytest.approx(length, abs=1e-9 * speed)
    assert law(0.0, 1) == pytest.approx(start, abs=1e-9 * speed)
    assert law.cost >= go.trajectory.time_law(length, 1.0, start, end).cost * (1.0 - 1e-6)


def test_monotone_time_law_with_a_pause_is_optimal() -> None:
    """Decelerate as u (1 - t/a)^2 to rest, pause, accelerate; a and b by a Lagrange multiplier.

    Deceleration costs 4 u^2 / (3 a) and covers u a / 3; at the least cost for a given length, a
    and b have the ratio of the square roots of the end speeds.
    """
    length, start, end = 0.1, 1.0, 0.5
    root = 3 * length / (start**1.5 + end**1.5)
    brake, launch = root * np.sqrt([start, end])
    assert brake + launch < 1.0
    law = go.trajectory.time_law(length, 1.0, start, end, monotone=True)
    best = 4 / 3 * (start**2 / brake + end**2 / launch)
    assert law.cost == pytest.approx(best, rel=1e-9)
    middle = np.linspace(brake, 1.0 - launch, 20)
    assert law(middle, 1) == pytest.approx(np.zeros(20), abs=1e-9)


def test_cost_is_the_integral() -> None:
    law = go.trajectory.time_law(0.4, 1.3, 0.9, 0.1, monotone=True)
    # The midpoint rule on a fine grid.
    t = (np.arange(200_000) + 0.5) / 200_000 * 1.3
    assert law.cost == pytest.approx(1.3 * np.mean(law(t, 2) ** 2), rel=1e-6)


def test_derivatives_match_finite_differences() -> None:
    law = go.trajectory.time_law(1.0, 2.0, 0.1, 0.3)
    t, h = np.linspace(0.1, 1.9, 7), 1e-6
    for order in (1, 2):
        slope = (law(t + h, order - 1) - law(t - h, order - 1)) / (2 * h)
        assert law(t, order) == pytest.approx(slope, abs=1e-7)
    assert law(0.5).shape == ()
    assert law(t, 5).tolist() == [0.0] * 7
    assert law.duration == 2.0
    assert law.length == pytest.approx(1.0)


def test_zero_length_and_zero_speeds_give_rest() -> None:
    law = go.trajectory.time_law(0.0, 1.0, 0.0, 0.0, monotone=True)
    assert not law(np.linspace(0.0, 1.0, 5)).any()


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((1.0, 0.0, 0.0, 0.0), {}, r"duration must be positive \[s\], got 0.0"),
        ((-1.0, 1.0, 0.0, 0.0), {}, "length must not be negative"),
        ((1.0, 1.0, np.nan, 0.0), {}, "start_speed must be a finite number"),
        ((1.0, 1.0, -0.5, 0.0), {"monotone": True}, "start_speed of a monotone time law must not"),
        ((0.0, 1.0, 1.0, 1.0), {"monotone": True}, "too short to stop in"),
    ],
)
def test_infeasible_time_laws_are_refused(
    arguments: tuple[float, ...], options: dict[str, object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        go.trajectory.time_law(*arguments, **options)


def test_arguments_out_of_range_are_named() -> None:
    law = go.trajectory.time_law(1.0, 2.0, 0.0, 0.0)
    with pytest.raises(ValueError, match=r"t must lie in \[0, 2\] s"):
        law(2.1)
    with pytest.raises(ValueError, match="order must not be negative"):
        law(1.0, -1)
