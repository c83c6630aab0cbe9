"""Distances between collision bodies, compared with coal and finite differences."""

from __future__ import annotations

from typing import Any

import casadi as ca
import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go
from geodesic_ocp.model.distances import LineSegment, segment_distance


def segment(start: Any, end: Any) -> LineSegment:
    along = np.subtract(end, start)
    return LineSegment(ca.SX(ca.DM(start)), ca.SX(ca.DM(along)), ca.SX(float(along @ along)))


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(ca.DM(segment_distance(segment(*one), segment(*other))))


def coals_distance(one: np.ndarray, other: np.ndarray) -> float:
    """By coal, for thin capsules along the segments."""
    radius, placed = 1e-3, []
    for start, end in (one, other):
        along = end - start
        length = float(np.linalg.norm(along))
        z = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        x = np.linalg.svd(z[None])[2][1]
        rotation = np.column_stack([x, np.cross(z, x), z])
        placed.append((coal.Capsule(radius, length), coal.Transform3s(rotation, (start + end) / 2)))
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    (first, at_first), (second, at_second) = placed
    found = coal.distance(first, at_first, second, at_second, request, result)
    return float(found + 2.0 * radius)


@pytest.mark.slow
def test_distances_agree_with_coal(rng: np.random.Generator) -> None:
    for _ in range(500):
        one, other = rng.normal(size=(2, 2, 3)) * rng.uniform(0.05, 1.0, (2, 1, 1))
        other = other + rng.normal(size=3)
        expected = coals_distance(one, other)
        if expected > 1e-2:
            assert distance(one, other) == pytest.approx(expected, abs=1e-7)


def test_the_distance_is_the_minimum_over_all_points(rng: np.random.Generator) -> None:
    """Independent of any geometry library: no pair of points on the segments is closer."""
    fractions = np.linspace(0.0, 1.0, 201)[:, None]
    for _ in range(50):
        one, other = rng.normal(size=(2, 2, 3))
        points = [start + fractions * (end - start) for start, end in (one, other)]
        apart = np.linalg.norm(points[0][:, None] - points[1][None], axis=2).min()
        found = distance(one, other)
        assert found <= apart + 1e-12
        assert found >= apart - 0.03  # spacing of the points


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ([(0, 0, 0), (1, 0, 0)], [(0, 1, 0), (1, 1, 0)], 1.0),  # parallel
        ([(0, 0, 0), (1, 0, 0)], [(3, 0, 0), (2, 0, 0)], 1.0),  # collinear
        ([(0, 0, 0), (1, 0, 0)], [(0.3, 2, 0), (0.7, 2, 0)], 2.0),  # parallel, partly overlapping
        ([(0, 0, 0), (1, 0, 0)], [(4, 4, 0), (5, 4, 0)], 5.0),
        ([(0, 0, 0), (0, 0, 0)], [(0, -1, 2), (0, 1, 2)], 2.0),  # a point
        ([(0, -1, 2), (0, 1, 2)], [(0, 3, 2), (0, 3, 2)], 2.0),
        ([(0, 0, 0), (0, 0, 0)], [(0, 3, 4), (0, 3, 4)], 5.0),
        ([(-1, 0, 0), (1, 0, 0)], [(0, -1, 0), (0, 1, 0)], 0.0),  # crossing
    ],
)
def test_special_positions(one: Any, other: Any, expected: float) -> None:
    assert distance(np.array(one), np.array(other)) == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 10_000))
def test_derivatives_agree_with_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = ca.SX.sym("x", 6)
    other = segment(*(rng.normal(size=(2, 3)) + np.array([2.0, 0.0, 0.0])))
    along = x[3:] - x[:3]
    # The squared length is a constant, so the segment moves rigidly.
    given_ends = rng.normal(size=6)
    square = float(np.sum((given_ends[3:] - given_ends[:3]) ** 2))
    expression = segment_distance(LineSegment(x[:3], along, ca.SX(square)), other)
    function = ca.Function("d", [x], [expression, ca.gradient(expression, x)])
    spin = ca.skew(rng.normal(size=3)).full()
    twist = np.concatenate([spin @ end + [0.1, 0.2, 0.3] for end in np.split(given_ends, 2)])
    step = 1e-5
    ahead, behind = (float(function(given_ends + h * twist)[0]) for h in (step, -step))
    slope = float(ca.dot(function(given_ends)[1], twist))
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), abs=2e-4)


def test_numeric_and_symbolic_distances_agree(arm: go.Model, rng: np.random.Generator) -> None:
    obstacles = [
        go.Ball((0.1, 0.3, -0.2), 0.05, name="lamp"),
        go.Capsule((0.0, 0.4, -0.5), (0.3, 0.4, -0.5), 0.02),
        go.HalfSpace((0.0, 0.0, -0.6), (0.0, 0.0, 2.0), "table"),
    ]
    pairs = [("right upper arm", "right hand")]
    q, x = rng.uniform(arm.lower, arm.upper), ca.MX.sym("q", arm.dof)
    numbers = go.distances.signed_distances(arm, q, obstacles, pairs=pairs)
    symbols = go.distances.signed_distances(arm, x, obstacles, pairs=pairs)
    assert list(numbers) == list(symbols)
    assert len(numbers) == 3 * 4 + 1
    assert {"right hand to lamp", "right forearm to obstacle 1", "right hand to table"} <= set(
        numbers
    )
    function = ca.Function("distances", [x], [ca.vertcat(*symbols.values())])
    assert function(q).full()[:, 0] == pytest.approx(list(numbers.values()), abs=1e-15)


def test_heights_above_a_table(arm: go.Model) -> None:
    """Heights of joints and fingertips of the hanging arm, less the radius."""
    found = go.distances.signed_distances(
        arm, np.zeros(7), [go.HalfSpace((5.0, 5.0, -1.0), (0, 0, 3.0), "table")]
    )
    upper, fore, hand = (body.radius for body in arm.bodies)
    elbow, wrist = 0.188 * 1.75, (0.188 + 0.145) * 1.75
    assert found["right upper arm to table"] == pytest.approx(1.0 - upper)
    assert found["right upper arm to table (2)"] == pytest.approx(1.0 - elbow - upper)
    assert found["right forearm to table (2)"] == pytest.approx(1.0 - wrist - fore)
    assert found["right hand to table (2)"] == pytest.approx(1.0 - wrist - 0.108 * 1.75 - hand)


def test_errors_name_links_and_arguments(arm: go.Model) -> None:
    ball, q = go.Ball((1.0, 0.0, 0.0), 0.1), np.zeros(7)
    assert list(go.distances.signed_distances(arm, q, [ball], links=["right hand"])) == [
        "right hand to obstacle 0"
    ]
    with pytest.raises(
        ValueError, match=r"links: .* no body at 'hand'; links with bodies: right upp"
    ):
        go.distances.signed_distances(arm, q, [ball], links=["hand"])
    with pytest.raises(ValueError, match=r"pairs: .* no body at 'left hand'"):
        go.distances.signed_distances(arm, q, pairs=[("right hand", "left hand")])
    with pytest.raises(ValueError, match="pairs must be a list of pairs of two different links"):
        go.distances.signed_distances(arm, q, pairs=[("right hand", "right hand")])
    with pytest.raises(ValueError, match="obstacles must be Ball, Capsule, Box or HalfSpace"):
        go.distances.signed_distances(arm, q, ["wall"])
    with pytest.raises(ValueError, match="has no bodies"):
        go.distances.signed_distances(arm.with_bodies(), q, [ball])
    with pytest.raises(ValueError, match="q must have shape"):
        go.distances.signed_distances(arm, q[:3], [ball])


def test_an_obstacle_on_a_link_is_ignored_for_that_link(arm: go.Model) -> None:
    """Neither has an empty list of links any distances."""
    tool = go.Capsule((0.0, 0.0, -0.2), (0.0, 0.0, -0.4), 0.01, "right hand", "tool")
    names = list(go.distances.signed_distances(arm, np.zeros(7), [tool]))
    assert names == ["right upper arm to tool", "right forearm to tool"]
    assert go.distances.signed_distances(arm, np.zeros(7), [tool], links=[]) == {}
    with pytest.raises(ValueError, match="links must be a list of links, got 'right hand'"):
        go.distances.signed_distances(arm, np.zeros(7), [tool], links="right hand")


def test_pairs_of_links_leave_out_adjacent_ones() -> None:
    pytest.importorskip("geodesic_ocp.execution")
    arms = go.model.combine(
        go.human_arm("left"), go.human_arm("right"), placements=((-0.2, 0, 0), (0.2, 0, 0))
    )
    pairs = go.execution.link_pairs(arms).constrained
    assert ("left hand", "right hand") in pairs
    assert ("left upper arm", "left hand") in pairs
    assert ("left upper arm", "left forearm") not in pairs
    assert len(pairs) == 9 + 2  # any two of different arms, and the ends of each
    assert len(go.distances.signed_distances(arms, np.zeros(14), pairs=pairs)) == len(pairs)
