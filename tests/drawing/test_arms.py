"""Arms in figures: projections, outlines, and from where a motion is seen."""

from __future__ import annotations

from typing import Any

import matplotlib.colors
import matplotlib.style
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_models import planar_arm
from matplotlib.figure import Figure

import geodesic_ocp as go
from geodesic_ocp.drawing.actors import extreme_points
from geodesic_ocp.drawing.arm_shapes import (
    DIRECTIONS,
    Postures,
    approach,
    gap_directions,
    obstacle_shape,
    outline_of_all,
    posture_shapes,
)
from geodesic_ocp.drawing.arm_strip import StripArm, draw_arm_strip, draw_overlay
from geodesic_ocp.drawing.best_view import across, best_view, plane_of
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.drawing.raster import outlines

BENT = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
angles = st.floats(-180.0, 180.0)
heights = st.floats(-80.0, 80.0)


@pytest.fixture(scope="module")
def lifted() -> Postures:
    """A person's right arm that is raised in front, at three instants."""
    return Postures.of(go.human_arm("right"), np.outer([0.2, 0.9, 1.6], [1.0, 0, 0, 0.3, 0, 0, 0]))


@given(angles, heights)
def test_a_view_is_a_parallel_projection_with_z_up(azimuth: float, elevation: float) -> None:
    view = Camera.around_z(azimuth, elevation)
    points = np.random.default_rng(0).normal(size=(5, 3))
    flat, depth = view.plane(points), view.depth(points)
    assert np.sum(flat**2, axis=1) + depth**2 == pytest.approx(np.sum(points**2, axis=1))
    x, y = view.plane([0.0, 0.0, 1.0])
    assert x == pytest.approx(0.0, abs=1e-9)
    assert y == pytest.approx(np.cos(np.deg2rad(elevation)))


def test_views_say_from_where_they_are() -> None:
    person, robot = 1, 0  # face along y, and along x
    assert Camera.of_axes((0, 1)).side(person) == "seen from above"
    assert Camera.of_axes((0, 2)).side(person) == "seen from the back"
    assert Camera.around_z(90.0, 0.0).side(person) == "seen from the front"
    assert Camera.around_z(0.0, 0.0).side(person) == "seen from the right"
    assert Camera.around_z(0.0, 0.0).side(robot) == "seen from the front"
    assert Camera.around_z(-45.0, 20.0).side(robot) == "seen from the front right and above"


@pytest.mark.parametrize("azimuth", [0.0, 70.0])
def test_outlines_of_links_have_the_extent_of_their_meshes(azimuth: float) -> None:
    arm, view = go.human_arm("right"), Camera.around_z(azimuth, 10.0)
    postures = Postures.of(arm, np.zeros((1, arm.dof)))
    shapes = posture_shapes(postures, 0, view, still=False)
    for shape, (actor, link, _, vertices, _) in zip(shapes, postures.links, strict=False):
        corners, drawn = view.plane(actor.placed(link, vertices)[0]), np.concatenate(shape.outlines)
        assert drawn.min(axis=0) == pytest.approx(corners.min(axis=0), abs=1e-9)
        assert drawn.max(axis=0) == pytest.approx(corners.max(axis=0), abs=1e-9)
    assert {"head", "thorax", "left hand"} <= {link for _, link, *_ in postures.links}


def test_extreme_points_of_a_ball_are_those_of_all_directions() -> None:
    ball = np.random.default_rng(2).normal(size=(5000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    few = extreme_points(ball)
    assert len(few) <= 400
    assert (few @ ball.T).max(axis=0) == pytest.approx(1.0, abs=0.02)


def test_a_link_that_is_not_convex_is_seen_so() -> None:
    """Seen along its edge, the corner that an L leaves free stays free."""
    import trimesh

    bars = [trimesh.creation.box((1.0, 0.1, 0.1)), trimesh.creation.box((0.1, 0.1, 1.0))]
    bars[0].apply_translation((0.5, 0.0, 0.0))
    bars[1].apply_translation((0.0, 0.0, 0.5))
    corner = trimesh.util.concatenate(bars)
    corners = Camera.of_axes((0, 2)).plane(corner.vertices)
    (line,) = outlines(corners, np.array(corner.faces))
    x, y = line.T
    area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert area == pytest.approx(0.1 + 0.1 - 0.05 * 0.05, rel=0.02)
    for bar, along in ((x, y), (y, x)):  # they do not leave the bars
        assert np.all((bar < 0.06) | (along < 0.06))


@pytest.mark.slow
def test_the_rest_of_a_person_is_grey_and_stays(lifted: Postures) -> None:
    view = Camera.around_z(0.0, 0.0)
    first, last = (posture_shapes(lifted, index, view) for index in (0, 2))
    same = [np.array_equal(a.outlines[0], b.outlines[0]) for a, b in zip(first, last, strict=True)]
    assert 0 < sum(same) < len(same)
    grey = {shape.face for shape, fixed in zip(first, same, strict=True) if fixed}
    assert len(grey) == 1
    assert len(posture_shapes(lifted, 0, view, still=False)) == len(same) - sum(same)


def test_an_outline_is_that_of_the_union() -> None:
    circles = np.concatenate([0.5 * DIRECTIONS, 0.5 * DIRECTIONS + [0.6, 0.0]])
    fan = np.array([[0, k, k + 1] for k in range(1, 63)])
    (line,) = outlines(circles, np.concatenate([fan, fan + 64]))
    for centre in ([0.0, 0.0], [0.6, 0.0]):
        assert np.linalg.norm(line - centre, axis=1).min() > 0.499
    assert line[:, 0].min() == pytest.approx(-0.5)
    assert line[:, 0].max() == pytest.approx(1.1)


def test_the_outline_of_all_is_around_all_that_moves(lifted: Postures) -> None:
    view = Camera.of_axes((1, 2))
    line = outline_of_all(lifted, 1, view)
    every = np.concatenate([view.plane(points[1]) for points in lifted.moving])
    assert np.nanmin(line, axis=0) == pytest.approx(every.min(axis=0), abs=0.005)
    assert np.nanmax(line, axis=0) == pytest.approx(every.max(axis=0), abs=0.005)


def test_a_planar_arm_is_seen_at_right_angles_to_its_plane() -> None:
    arm = planar_arm((0.5, 0.2), (1.0, 1.0), (0.2, 0.1), (0.01, 0.01))
    view = plane_of(Postures.of(arm, [[0.0, 0.4], [0.5, 0.8]]))
    assert view is not None
    assert view.axis == 2


def test_a_motion_is_seen_across_and_not_from_behind_the_person(lifted: Postures) -> None:
    view = best_view(lifted)
    assert view.axis == 0
    assert view.towards[0] > 0.0  # the right arm is on this side
    assert across(view, lifted).towards[1] > 0.0  # from the front


def test_a_wall_is_seen_edge_on(lifted: Postures) -> None:
    wall = go.HalfSpace((0.0, 0.8, 0.0), (0.3, -1.0, 0.0))
    view = best_view(lifted, obstacles=[wall])
    assert view.towards @ np.array(wall.normal) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("side", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_a_gap_between_hand_and_obstacle_is_seen(side: tuple[float, float, float]) -> None:
    """The view is nearly across the line between the nearest points."""
    arm = go.human_arm("right")
    q = np.linspace(0.8, 1.2, 21)[:, None] * BENT
    hand = arm.hand_pose(q[10])[1]
    ball = go.Ball(tuple(hand + 0.2 * np.array(side)), 0.05)
    near = approach(arm, q, [ball])
    assert near is not None
    lines = gap_directions(near)
    view = best_view(Postures.of(arm, q[::5]), obstacles=[ball], nearest=lines, closest=2)
    assert np.abs(lines @ view.towards).mean() < 0.5


def test_the_nearest_approach_is_that_of_the_distances() -> None:
    arm = go.human_arm("right")
    q, ball = np.linspace(0.5, 1.5, 11)[:, None] * BENT, go.Ball((0.1, 0.5, -0.1), 0.04)
    near = approach(arm, q, [ball])
    assert near is not None
    expected = [min(go.distances.signed_distances(arm, row, [ball]).values()) for row in q]
    assert near.distances == pytest.approx(expected, abs=1e-6)
    assert np.linalg.norm(near.ends - near.starts, axis=1) == pytest.approx(np.abs(near.distances))
    assert approach(arm, q, []) is None


def test_obstacles_have_their_size() -> None:
    view = Camera.around_z(20.0, 30.0)
    ball = obstacle_shape(go.Ball((1.0, 2.0, 3.0), 0.2), view)
    assert ball is not None
    centre = view.plane([1.0, 2.0, 3.0])
    assert np.linalg.norm(ball.outlines[0] - centre, axis=1) == pytest.approx(0.2)
    post = obstacle_shape(go.Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1), Camera.of_axes((0, 2)))
    assert post is not None
    assert np.ptp(post.outlines[0], axis=0) == pytest.approx([0.2, 1.2])
    table = go.HalfSpace((0.0, 0.0, 0.4), (0.0, 0.0, 1.0))
    box = np.zeros(2), np.ones(2)
    behind = obstacle_shape(table, Camera.of_axes((0, 2)), box)
    assert behind is not None
    assert np.ptp(behind.outlines[0], axis=0) == pytest.approx([1.0, 0.4])
    assert obstacle_shape(table, Camera.of_axes((0, 1)), box) is None


def test_a_strip_is_to_scale_and_marks_targets(lifted: Postures) -> None:
    axes = Figure().add_subplot()
    path = np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.4]])
    targets = lifted.hands[:, 0]
    view = Camera.of_axes((1, 2))
    table = go.HalfSpace((0.0, 0.0, -0.5), (0.0, 0.0, 1.0))
    labels = ["a", "b", "c"]
    arms = [StripArm(lifted)]
    draw_arm_strip(axes, [view], labels, arms, paths=[path], targets=targets, obstacles=[table])
    paths = [line for line in axes.get_lines() if len(line.get_xydata()) == 2][:3]
    steps = [np.diff(line.get_xydata(), axis=0)[0] for line in paths]
    assert np.array(steps) == pytest.approx(np.tile([0.3, 0.4], (3, 1)))
    crosses = [line.get_xydata()[0] for line in axes.get_lines() if line.get_marker() == "+"]
    starts = np.array([line.get_xydata()[0] for line in paths])
    assert np.array(crosses) - starts == pytest.approx(view.plane(targets))
    assert {"a", "b", "c"} <= {text.get_text() for text in axes.texts}
    hatched = [each for each in axes.collections if each.get_hatch()]
    assert len(hatched) == 3  # the table below each


@pytest.mark.slow
@pytest.mark.parametrize("style", ["default", "dark_background"])
def test_what_is_written_in_a_strip_is_read_on_white_and_on_black(
    style: str, lifted: Postures
) -> None:
    """By https://www.w3.org/TR/WCAG22/#dfn-contrast-ratio."""
    with matplotlib.style.context(style):
        figure = Figure()
        axes = figure.add_subplot()
        arms, views = [StripArm(lifted)], [Camera.of_axes((1, 2)), Camera.around_z(30.0, 20.0)]
        draw_arm_strip(axes, views, ["a", "b", "c"], arms, title="robot $x^$ of _a & b")
        figure.draw_without_rendering()  # the title is text, not a formula
    written = [*(text.get_color() for text in axes.texts), axes.get_lines()[-1].get_color()]
    behind = luminance(figure.get_facecolor())
    for colour in written:
        low, high = sorted([luminance(colour), behind])
        assert (high + 0.05) / (low + 0.05) > 4.0


def luminance(colour: Any) -> float:
    rgb = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_an_overlay_grows_darker_and_has_units() -> None:
    axes = Figure().add_subplot()
    arm = planar_arm((0.5, 0.2), (1.0, 1.0), (0.2, 0.1), (0.01, 0.01))
    postures = Postures.of(arm, [[0.0, 0.4], [0.5, 0.8], [1.0, 1.0]])
    draw_overlay(axes, Camera.of_axes((0, 1)), postures, ["0", "0.5", "1"])
    light = [each.get_edgecolor()[0, :3].sum() for each in axes.collections]
    assert light == sorted(light, reverse=True)
    assert axes.get_xlabel() == "x [m]"
    assert axes.get_ylabel() == "y [m]"
    assert [text.get_text() for text in axes.texts] == ["0", "0.5", "1"]
