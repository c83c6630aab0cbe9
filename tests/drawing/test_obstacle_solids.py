"""Obstacles, carried objects and collision bodies as surfaces."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.drawing.surroundings import (
    carried_obstacles,
    collision_bodies,
    obstacle_solids,
)

ARM = go.human_arm()
Q = np.linspace([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], [0.9, 0.3, -0.2, 1.5, 0.0, 0.1, 0.0], 5)
LOW, HIGH = np.array([-0.4, -0.2, -0.8]), np.array([0.5, 0.7, 0.4])
NUMBER = st.floats(-1.0, 1.0)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Of a closed surface; positive if it is counter-clockwise seen from outside."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@given(VECTOR, VECTOR, st.floats(0.01, 0.5))
def test_capsules_and_balls_are_closed_and_where_they_should_be(
    start: tuple[float, float, float], end: tuple[float, float, float], radius: float
) -> None:
    (solid,) = obstacle_solids([go.Capsule(start, end, radius)], LOW, HIGH)
    length = float(np.linalg.norm(np.subtract(end, start)))
    inside = volume(solid.vertices, solid.triangles)
    exact = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert 0.95 * exact < inside < exact
    along = np.subtract(end, start)
    share = (solid.vertices - start) @ along / max(length**2, 1e-300)
    nearest = np.array(start) + np.clip(share, 0.0, 1.0)[:, None] * along
    distances = np.linalg.norm(solid.vertices - nearest, axis=1)
    assert_allclose(distances, radius, rtol=1e-6, atol=1e-9)


@given(VECTOR, VECTOR.filter(lambda normal: np.linalg.norm(normal) > 0.1))
def test_the_face_of_a_half_space_lies_on_its_plane_and_covers_the_scene(
    point: tuple[float, float, float], normal: tuple[float, float, float]
) -> None:
    space = go.HalfSpace(point, normal, "table")
    (solid,) = obstacle_solids([space], LOW, HIGH)
    assert solid.unbounded
    assert volume(solid.vertices, solid.triangles) > 0.0
    heights = (solid.vertices - point) @ space.normal
    assert heights.max() == pytest.approx(0.0, abs=1e-9)
    assert heights.min() < -1e-3
    face = solid.vertices[heights > -1e-9]
    assert len(face) == 4
    # Every corner of the scene, seen along the normal, lies within the face.
    middle = face.mean(axis=0)
    edges = face - face[0]
    order = np.argsort(np.linalg.norm(edges, axis=1))
    corners = np.array(np.meshgrid(*zip(LOW, HIGH, strict=True))).reshape(3, -1).T
    for edge in edges[order[1:3]]:
        half = np.linalg.norm(edge) / 2.0
        assert np.abs((corners - middle) @ edge / (2.0 * half)).max() <= half


def test_a_box_is_where_its_corners_are() -> None:
    turn = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    (solid,) = obstacle_solids([go.Box((1.0, 0.0, 0.0), (0.2, 0.4, 0.6), turn)], LOW, HIGH)
    assert volume(solid.vertices, solid.triangles) == pytest.approx(0.048)
    assert_allclose(solid.vertices.min(axis=0), [0.8, -0.1, -0.3])
    assert_allclose(solid.vertices.max(axis=0), [1.2, 0.1, 0.3])


def test_symbols_are_left_out_and_others_keep_their_names() -> None:
    obstacles = [
        go.Ball((0.0, 0.0, 0.0), 0.1),
        go.Ball(ca.SX.sym("centre", 3), 0.1, name="somewhere"),
        go.Ball((0.0, 0.0, 0.0), 0.1, link="right hand", name="cup"),
        go.HalfSpace((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), "floor"),
    ]
    assert [solid.name for solid in obstacle_solids(obstacles, LOW, HIGH)] == [
        "obstacle 0",
        "floor",
    ]


def test_what_a_link_carries_moves_with_it() -> None:
    cup = go.Ball((0.0, 0.05, 0.0), 0.04, link="right hand", name="cup")
    (actor,) = carried_obstacles(ARM, Q, [cup, go.Ball((0.0, 0.0, 0.0), 0.1)])
    (mesh,) = actor.meshes
    centres = actor.rotations[mesh.link] @ mesh.vertices.mean(axis=0) + actor.positions[mesh.link]
    rotations, positions = ARM.frame_pose("right hand", Q)
    assert_allclose(centres, rotations @ cup.centre + positions, atol=1e-9)
    assert not carried_obstacles(ARM, Q, [go.Ball((0.0, 0.0, 0.0), 0.1)])


def test_collision_bodies_of_some_links() -> None:
    (every,), (hand,) = collision_bodies(ARM, Q), collision_bodies(ARM, Q, {"right hand"})
    assert len(every.meshes) == len(ARM.bodies)
    assert [mesh.link for mesh in hand.meshes] == ["right hand"]
    assert hand.translucent
    assert not collision_bodies(go.Model(ARM.pin, ARM.hand), Q)
