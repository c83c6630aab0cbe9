"""Clearances in a scene: the distances of the constraints, between points on the surfaces."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.drawing.surroundings import MOST, clearances

ARM = go.human_arm()
BODIES = [
    go.Ball((0.2, 0.35, -0.15), 0.06, name="lamp"),
    go.Capsule((0.3, -0.2, -0.4), (0.1, 0.5, 0.3), 0.02, name="pole"),
    go.Capsule((0.0, 0.05, -0.1), (0.0, 0.05, 0.1), 0.03, link="right hand", name="stick"),
    go.HalfSpace((0.0, 0.3, -0.6), (0.0, -0.2, 1.0), name="table"),
]
PAIRS = [("right upper arm", "right hand")]
UNIT = st.floats(0.0, 1.0)


def configurations(shares: list[list[float]]) -> np.ndarray:
    """Configurations within the joint limits."""
    return ARM.lower + np.array(shares) * (ARM.upper - ARM.lower)


@pytest.mark.slow
@given(shares=st.lists(st.lists(UNIT, min_size=7, max_size=7), min_size=1, max_size=4))
def test_distances_are_those_of_the_constraints(shares: list[list[float]]) -> None:
    q = configurations(shares)
    gaps = clearances(ARM, q, BODIES, pairs=PAIRS, most=100)
    expected = [go.distances.signed_distances(ARM, row, BODIES, pairs=PAIRS) for row in q]
    assert [gap.name for gap in gaps] == list(expected[0])
    for gap in gaps:
        assert_allclose(gap.distances, [each[gap.name] for each in expected], rtol=0, atol=1e-9)
        # The points are as far apart as the bodies, on either side of the surfaces.
        apart = np.linalg.norm(gap.ends - gap.starts, axis=1)
        assert_allclose(apart, np.abs(gap.distances), rtol=0, atol=1e-9)


def test_nearest_points_lie_on_the_surfaces() -> None:
    q = configurations([[0.3] * 7, [0.6] * 7])
    by_name = {gap.name: gap for gap in clearances(ARM, q, BODIES, most=100)}
    to_ball = by_name["right hand to lamp"].ends - BODIES[0].centre
    assert_allclose(np.linalg.norm(to_ball, axis=1), BODIES[0].radius, rtol=0, atol=1e-12)
    for name in ("right forearm to table", "right forearm to table (2)"):
        heights = (by_name[name].ends - BODIES[3].point) @ BODIES[3].normal
        assert_allclose(heights, 0.0, rtol=0, atol=1e-12)


def test_of_many_gaps_the_closest_are_kept() -> None:
    balls = [go.Ball((0.1 * k, 0.5, 0.0), 0.02) for k in range(8)]
    q = configurations([[0.4] * 7])
    every = clearances(ARM, q, balls, most=1000)
    few = clearances(ARM, q, balls)
    assert len(every) > len(few) == MOST
    farthest_kept = max(float(gap.distances.min()) for gap in few)
    kept = {gap.name for gap in few}
    assert all(gap.distances.min() >= farthest_kept for gap in every if gap.name not in kept)


def test_gaps_are_those_of_the_named_constraints() -> None:
    q = configurations([[0.4] * 7])
    (one,) = clearances(ARM, q, BODIES, names={"right hand to lamp", "joint limits"})
    assert one.name == "right hand to lamp"
    assert len(clearances(ARM, q, BODIES[:1], names={"my own constraint"})) == 3


def test_without_bodies_or_numbers_there_are_no_gaps() -> None:
    q = configurations([[0.4] * 7])
    bare = go.Model(ARM.pin, ARM.hand)
    assert clearances(bare, q, BODIES) == ()
    somewhere = go.Ball(ca.SX.sym("centre", 3), 0.1)
    assert clearances(ARM, q, [somewhere]) == ()


def test_links_that_do_not_exist_are_named() -> None:
    with pytest.raises(ValueError, match="has no body at 'tail'"):
        clearances(ARM, configurations([[0.4] * 7]), BODIES, links=["tail"])
