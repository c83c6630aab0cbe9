"""The figure of an analysis: the strip of arms, and errors over time."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import geodesic_ocp as go
from geodesic_ocp.drawing.analysis_figure import draw_analysis, draw_error_over_time
from geodesic_ocp.drawing.arm_shapes import Postures
from geodesic_ocp.drawing.arm_strip import StripArm, strip_instants
from geodesic_ocp.drawing.camera import Camera

TIME = np.linspace(0.0, 2.0, 101)
SEGMENTS = [(0, 10), (10, 70), (70, 75), (75, 100)]


def test_instants_are_halfway_between_cuts_and_follow_the_longest_segments() -> None:
    assert strip_instants(SEGMENTS, 4) == [40, 87]  # at 12, 37, 62 and 87 of 100 samples
    assert strip_instants(SEGMENTS, 100) == [5, 40, 72, 87]


@pytest.fixture(scope="module")
def arms() -> tuple[StripArm, StripArm]:
    """A person's arm, and a prediction."""
    q = np.outer([0.0, 0.5, 1.0], [1.0, 0.2, -0.5, 0.6, 0.1, 0.2, 0.1])
    model = go.human_arm("right")
    observed, predicted = Postures.of(model, q), Postures.of(model, q + 0.05)
    return StripArm(observed), StripArm(predicted, "predicted", "predicted", False)


@pytest.fixture
def figure(arms: tuple[StripArm, StripArm]) -> Figure:
    """Of an arm with two links, a prediction and two others that are worse."""
    hand = np.stack([TIME, TIME**2, 0 * TIME], axis=1)
    bump = np.sin(np.pi * TIME / 2.0)
    joints = {"good": 0.01 * bump, "worse": 0.02 * bump, "far worse": 0.5 * bump}
    distances = {"good": 0.002 * bump, "worse": 0.003 * bump, "far worse": 0.004 * bump}
    drawn = Figure(layout="constrained")
    views = Camera.of_axes((1, 2)), Camera.of_axes((0, 2))
    hands, each = {"hand": (hand, hand + 0.01)}, {"hand": distances}
    instants = [5, 40, 87]
    draw_analysis(drawn, TIME, SEGMENTS, instants, views, arms, hands, joints, each, draw)
    return drawn


def draw(axes: object) -> None:
    axes.set_xlabel("number of synergies")  # type: ignore[attr-defined]


@pytest.mark.slow
def test_arms_are_drawn_in_both_views(figure: Figure) -> None:
    strip = figure.axes[0]
    outlines = [line for line in strip.get_lines() if line.get_linestyle() != "-"]
    assert len(outlines) == 3 * 2  # a predicted arm in each view at each instant
    bodies = [path for each in strip.collections for path in each.get_paths()]
    assert len(bodies) >= 3 * 2 * 6  # upper arm, forearm, hand, head, thorax and more
    times = [text.get_text() for text in strip.texts if text.get_text().endswith(" s")]
    assert times == ["0.1 s", "0.8 s", "1.7 s"]
    assert {"seen from the right", "seen from the back"} <= {
        text.get_text() for text in strip.texts
    }
    legend = [text.get_text() for text in strip.get_legend().get_texts()]
    assert legend == ["arm", "predicted"]


@pytest.mark.slow
def test_panels_have_units_and_the_curve_is_drawn(figure: Figure) -> None:
    joints, hand = figure.axes[1:3]
    assert joints.get_ylabel() == "joints [rad]"
    assert hand.get_ylabel() == "hand [mm]"
    assert hand.get_lines()[0].get_ydata() == pytest.approx(2.0 * np.sin(np.pi * TIME / 2.0))
    assert figure.axes[-1].get_xlabel() == "number of synergies"
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert names == ["good", "worse", "far worse"]


@pytest.mark.slow
def test_what_exceeds_the_scale_is_written(figure: Figure) -> None:
    joints, hand = figure.axes[1:3]
    assert joints.get_ylim() == pytest.approx((0.0, 0.032))
    assert [text.get_text() for text in joints.texts] == ["up to 0.5"]
    assert not hand.texts


def test_an_exact_prediction_has_a_scale() -> None:
    axes = Figure().add_subplot()
    draw_error_over_time(axes, TIME, SEGMENTS, {"exact": 0.0 * TIME}, "joints [rad]")
    assert axes.get_ylim()[1] > 0.0
