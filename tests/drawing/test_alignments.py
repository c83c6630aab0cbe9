"""The figure of an alignment: a robot and a person's arm in corresponding postures."""

from __future__ import annotations

from dataclasses import replace

import matplotlib.axes
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.drawing.alignments import alignment_figure

PERSON = go.human_arm("right")


def drawn(aligned: go.retargeting.Alignment, robot: go.Model) -> list[matplotlib.axes.Axes]:
    """Panels: from behind hanging, bent, reaching; the same from the right."""
    return list(alignment_figure(robot, aligned, PERSON).axes)


def body(axes: matplotlib.axes.Axes) -> np.ndarray:
    """Corners of what moves of the robot (m, 2)."""
    every = [each for each in axes.collections if isinstance(each, PolyCollection)]
    paths = [path for each in every if each.zorder >= 2.0 for path in each.get_paths()]
    return np.concatenate([path.vertices for path in paths])


def outline(axes: matplotlib.axes.Axes) -> np.ndarray:
    """Of the person, (m, 2)."""
    (line,) = (each for each in axes.lines if each.get_label() == "person, scaled")
    points = np.asarray(line.get_xydata())
    return points[np.isfinite(points[:, 0])]


@pytest.mark.slow
@pytest.mark.parametrize("base", [np.eye(3), Rotation.from_rotvec([0.0, 1.2, 0.4]).as_matrix()])
def test_a_larger_person_is_where_the_person_scaled_is(base: np.ndarray) -> None:
    """Whichever axes its base has; the figure is in the person's."""
    larger = go.human_arm("right", 2.1)
    aligned = replace(go.retargeting.align(larger), base=base)
    chain = larger.pin.copy()
    chain.jointPlacements[1].rotation = base @ chain.jointPlacements[1].rotation
    robot = go.Model(chain, larger.hand, shapes=larger.bodies)
    panels = drawn(aligned, robot)
    for axes in panels:
        assert "out of reach" not in axes.get_title()
        every = np.concatenate([body(axes), outline(axes)])
        (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
        assert np.all(every > [x0, y0])
        assert np.all(every < [x1, y1])
    # The elbow may be elsewhere on its circle; the hand, which is lowest or foremost, is not.
    for number in (0, 3):
        lowest = body(panels[number])[:, 1].min()
        assert lowest == pytest.approx(outline(panels[number])[:, 1].min(), abs=1e-9)
    for number in (4, 5):
        foremost = body(panels[number])[:, 0].max()
        assert foremost == pytest.approx(outline(panels[number])[:, 0].max(), abs=1e-9)


@pytest.mark.slow
def test_what_points_where_is_drawn() -> None:
    """The fingers of a hanging arm down, and away from who sees the reaching one from behind."""
    panels = drawn(go.retargeting.align(PERSON), PERSON)
    assert [axes.get_title() for axes in panels[:3]] == [
        "hanging",
        "elbow bent",
        "reaching forward",
    ]
    fingers, right = panels[0].texts
    assert fingers.xy[1] < fingers.xyann[1]
    assert right.xy[0] > right.xyann[0]
    assert len(panels[2].texts) == 1  # only that to the right is seen as an arrow
    (forward,) = panels[5].texts
    assert forward.xy[0] > forward.xyann[0]


@pytest.mark.slow
def test_postures_out_of_reach_are_named() -> None:
    aligned = replace(go.retargeting.align(PERSON), length=3.0 * PERSON.reach)
    titles = [axes.get_title() for axes in drawn(aligned, PERSON)[:3]]
    assert "out of reach by" in titles[0]
    assert titles[0].startswith("hanging")
