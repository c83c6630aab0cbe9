"""Searches for configurations from many starts at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.pose_search import PoseSearch, pose_steps, search_simultaneously

LOWER, UPPER = np.array([-np.pi, -2.0]), np.array([np.pi, 2.0])
LIMITS = LOWER, UPPER


def two_links(
    target: Array, near: Array, bounds: tuple[Array, Array]
) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Errors of the end of two links of one metre, and steps that reduce them."""

    def steps(q: Array) -> tuple[Array, Array, Array]:
        one, both = q[:, 0], q.sum(axis=1)
        end = np.stack([np.cos(one) + np.cos(both), np.sin(one) + np.sin(both)], axis=1)
        by_both = np.stack([-np.sin(both), np.cos(both)], axis=1)
        by_one = np.stack([-np.sin(one), np.cos(one)], axis=1) + by_both
        errors, jacobians = end - target, np.stack([by_one, by_both], axis=2)
        return errors, *pose_steps(q, errors, jacobians, bounds, near, 1e-2)

    return steps


def test_both_elbow_configurations_are_found(rng: np.random.Generator) -> None:
    starts = rng.uniform(LOWER, UPPER, (10, 2))
    target = np.array([np.sqrt(2.0), 0.0])
    found = search_simultaneously(two_links(target, starts[0], LIMITS), starts, LIMITS, 10)
    attained = found.q[found.errors <= 1e-11]
    assert {round(float(np.sign(q[1]))) for q in attained} == {-1, 1}
    assert_allclose(np.abs(attained[:, 1]), np.pi / 2.0, atol=1e-9)


def test_bounds_exclude_configurations(rng: np.random.Generator) -> None:
    target = np.array([np.sqrt(2.0), 0.0])
    bounds = np.array([-np.pi, 0.1]), UPPER
    starts = rng.uniform(*bounds, (10, 2))
    found = search_simultaneously(two_links(target, starts[0], bounds), starts, bounds, 10)
    attained = found.q[found.errors <= 1e-11]
    assert len(attained)
    assert_allclose(attained, np.tile([-np.pi / 4.0, np.pi / 2.0], (len(attained), 1)), atol=1e-9)


def test_least_error_out_of_reach(rng: np.random.Generator) -> None:
    starts = rng.uniform(LOWER, UPPER, (10, 2))
    target = np.array([3.0, 0.0])
    found = search_simultaneously(two_links(target, starts[0], LIMITS), starts, LIMITS, 10)
    assert len(found.q) == len(starts)
    assert abs(found.errors.min() - 1.0) < 1e-2


def test_redundancy_serves_to_stay_near(arm: go.Model) -> None:
    """The only configuration within a box around the start that has the start's own pose."""
    start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    rotation, position = arm.hand_pose(start)
    box = start - 0.05, start + 0.05

    def within(place: np.ndarray) -> list[np.ndarray]:
        search = PoseSearch.checked("test", arm, start + 0.03, place, rotation)
        search = replace(search, bounds=box)
        return search.simultaneously(search.starts(4), np.ones(6), 1, np.inf)[0]

    q, *_ = within(position)
    assert np.all((q >= box[0]) & (q <= box[1]))
    assert_allclose(arm.hand_pose(q)[1], position, atol=1e-9)
    assert within(position + 0.2) == []
