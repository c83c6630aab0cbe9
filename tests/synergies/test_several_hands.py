"""Analyses of models with several hands: both arms, with and without the trunk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from motion_files import motion_in
from table_rows import header_of, rows_of_table

import geodesic_ocp as go

SHOULDERS = [(0.2, 0.0, 0.0), (-0.2, 0.0, 0.0)]
TIME = np.arange(150) / 100.0
NAMED = ("right hand [m]", "right hand [rad]", "left hand [m]", "left hand [rad]")


@pytest.fixture(scope="module")
def arms() -> list[go.Model]:
    return [go.human_arm("right"), go.human_arm("left")]


@pytest.fixture(scope="module")
def both(arms: list[go.Model]) -> go.Model:
    return go.model.combine(*arms, placements=SHOULDERS)


def swing(model: go.Model) -> go.Motion:
    """All joints move within their limits, at different rates."""
    centre, width = (model.lower + model.upper) / 2.0, (model.upper - model.lower) / 8.0
    rates = np.linspace(2.0, 4.0, model.dof)
    q = centre + width * np.sin(np.outer(TIME, rates) + np.arange(model.dof))
    return go.Motion(TIME, q, model.joint_names)


@pytest.fixture(scope="module")
def analysis(both: go.Model) -> go.synergies.Analysis:
    return go.analyse(both, swing(both))


def test_errors_of_each_hand_are_those_of_its_arm(both: go.Model, arms: list[go.Model]) -> None:
    motion = swing(both)
    late = go.Motion(TIME, motion.q + 0.03 * np.arange(14), motion.joint_names)
    errors = go.synergies.motion_errors(both, motion, late)
    alone = [go.synergies.motion_errors(arm, motion, late) for arm in arms]
    assert [hand.name for hand in errors.hands] == ["right hand", "left hand"]
    for hand, arm in zip(errors.hands, alone, strict=True):
        assert hand.position == pytest.approx(arm.position, rel=1e-12)
        assert hand.orientation == pytest.approx(arm.orientation, rel=1e-9)
        assert arm.hands == ()
    assert errors.position == pytest.approx(np.mean([arm.position for arm in alone]))
    assert errors.orientation == pytest.approx(np.mean([arm.orientation for arm in alone]))
    assert errors.joint == pytest.approx(np.mean([arm.joint for arm in alone]))


def test_the_trunk_moves_both_hands() -> None:
    """By the distance of each hand from the axis of the joint, times the angle."""
    person = go.human_upper_body()
    observed = go.Motion(TIME[:2], np.zeros((2, 20)), person.joint_names)
    turned = np.zeros((2, 20))
    turned[:, 1] = 0.01  # about the vertical axis of the lumbar joint
    errors = go.synergies.motion_errors(
        person, observed, go.Motion(TIME[:2], turned, person.joint_names)
    )
    assert errors.hands[0].position == pytest.approx(1.75 * (0.110 - 0.015) * 0.01, rel=1e-4)
    assert errors.hands[0].orientation == pytest.approx(0.01)
    assert errors.hands[1].position == pytest.approx(errors.hands[0].position)


def test_errors_relative_to_the_pelvis_are_those_in_the_room(rng: np.random.Generator) -> None:
    person = go.human_upper_body()
    q, other = rng.uniform(person.lower, person.upper, (2, 3, 20))
    motions = [go.Motion(TIME[:3], each, person.joint_names) for each in (q, other)]
    errors = go.synergies.motion_errors(person, *motions)
    turn, place = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
    for hand, frame in zip(errors.hands, person.hands, strict=True):
        seen, found = (person.frame_pose(frame, each)[1] @ turn.T + place for each in (q, other))
        assert hand.position == pytest.approx(np.linalg.norm(found - seen, axis=1).mean())


def test_all_hands_are_tracked(both: go.Model) -> None:
    motion = swing(both)
    errors = go.synergies.motion_errors(both, motion, go.baselines.track_hand(both, motion))
    assert errors.joint > 0.02  # each arm has one redundant degree of freedom
    for hand in errors.hands:
        assert hand.position < 3e-3
        assert hand.orientation < 5e-3


def test_two_arms_are_tracked_as_each_alone(both: go.Model, arms: list[go.Model]) -> None:
    """Without common joints, the damped least squares of both separate into those of each."""
    motion = swing(both)
    together = go.baselines.track_hand(both, motion)
    for arm in arms:
        alone = go.baselines.track_hand(arm, motion).q
        assert together.select(arm.joint_names).q == pytest.approx(alone, abs=1e-7)


def test_minimum_jerk_moves_all_hands(both: go.Model, arms: list[go.Model]) -> None:
    motion, segments = swing(both).filtered(cutoff=8.0), [(0, 70), (70, 149)]
    together = go.baselines.minimum_jerk_hand(both, motion, segments)
    for arm in arms:
        alone = go.baselines.minimum_jerk_hand(arm, motion, segments).q
        assert together.select(arm.joint_names).q == pytest.approx(alone, abs=1e-7)


@pytest.mark.slow
def test_the_table_names_each_hand(analysis: go.synergies.Analysis) -> None:
    table = analysis.table()
    assert header_of(table) == ("method", "segments", "joints [rad]", *NAMED)
    hands = analysis.errors["riemannian"].hands
    expected = [value for hand in hands for value in (hand.position, hand.orientation)]
    assert list(rows_of_table(table)[0][3:]) == expected


@pytest.mark.slow
def test_the_figure_shows_each_hand(analysis: go.synergies.Analysis) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    figure = go.plot(analysis, curve=lambda axes: axes.set_xlabel("number of synergies"))
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    assert {"joints [rad]", "right hand [mm]", "left hand [mm]"} <= set(panels)
    for hand in analysis.errors["riemannian"].hands:
        drawn = panels[f"{hand.name} [mm]"].get_lines()[0].get_ydata()
        assert np.mean(drawn) == pytest.approx(1000.0 * hand.position)
        assert any(
            axes.get_title("left").startswith(f"path of the {hand.name}") for axes in figure.axes
        )
    assert figure.axes[-1].get_xlabel() == "number of synergies"
    assert len(go.plot(analysis).axes) == 6


@pytest.mark.slow
def test_a_single_hand_keeps_its_columns(arms: list[go.Model]) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    analysis = go.analyse(arms[0], swing(arms[0]))
    assert header_of(analysis.table())[3:] == (
        "hand [m]",
        "hand [rad]",
    )
    assert [axes.get_ylabel() for axes in go.plot(analysis).axes[1:3]] == [
        "joints [rad]",
        "hand [mm]",
    ]


@pytest.mark.slow
def test_a_geodesic_of_both_arms_is_one_of_each(both: go.Model, arms: list[go.Model]) -> None:
    """Kinetic energies add up: the log map of the product is that of each factor."""
    motion = swing(both)
    ends = motion.q[0], motion.q[40]
    together = go.log(go.KineticEnergy(both), *ends)
    for arm, part in zip(arms, (slice(0, 7), slice(7, 14)), strict=True):
        alone = go.log(go.KineticEnergy(arm), *(end[part] for end in ends))
        assert together[part] == pytest.approx(alone, abs=1e-6)


def test_cuts_that_minimize_the_error_of_the_hands_count_both(both: go.Model) -> None:
    motion = swing(both).filtered(cutoff=8.0)
    metric = go.Euclidean(14)
    found = go.synergies.optimal_segmentations(
        metric, motion, measure="position", model=both, spacing=0.3, max_duration=1.5
    )
    segments = found.segments(2, refined=False)
    predicted = go.synergies.reconstruct(metric, motion, segments).predicted
    error = found.error(2, refined=False)
    assert error == pytest.approx(
        go.synergies.motion_errors(both, motion, predicted).position, rel=0.02
    )


@pytest.mark.slow
def test_the_upper_body_is_analysed(shared: Path) -> None:
    person = go.human_upper_body(1.83, 70.0)
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml"
    analysis = go.analyse(person, motion_in(file))
    assert analysis.not_found == ()
    errors = analysis.errors
    straight = errors["euclidean_same_segments"]
    assert errors["riemannian"].position < 0.015
    assert errors["riemannian"].hands[0].position < 0.8 * straight.hands[0].position
