"""Results are shown by their type, alone or several side by side."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.drawing.playback_of import beside, playback_of
from geodesic_ocp.drawing.scene import (
    PARAMETER,
    SECONDS,
    Curve,
    Playback,
    Plot,
    PointCloud,
    Scene,
    Span,
)
from geodesic_ocp.trajectory.motion import Subject


def still(title: str, *times: float, label: str = SECONDS, **others: Any) -> Playback:
    """A playback without anything in it."""
    time = np.array(times or (0.0, 1.0))
    plot = Plot("speed [m/s]", (Curve("hand", time, np.zeros(len(time))),))
    spans = {"synergies": (Span("1", float(time[0]), float(time[-1])),)}
    return Playback(title, (Scene(title, time),), spans, (plot,), label, **others)


def moved(names: tuple[str, ...], height: float | None = 1.8) -> go.Motion:
    time = np.arange(5) / 10.0
    q = 0.1 * np.sin(time[:, None] + np.arange(len(names)))
    return go.Motion(time, q, names, subject=Subject(height))


@pytest.mark.slow
def test_one_result_is_shown_alone(arm: go.Model) -> None:
    motion = moved(arm.joint_names)
    for items in ((motion, arm), ((motion, arm),), ([(motion, arm)],), ([motion, arm],)):
        playback = playback_of(*items)
        assert [scene.title for scene in playback.scenes] == ["human right arm"]
        assert len(playback.scenes[0].time) == 5
    whole = playback_of(motion, arm, title="reach")
    assert whole.title == "reach"


@pytest.mark.slow
def test_several_results_are_side_by_side(arm: go.Model, arm_metric: go.KineticEnergy) -> None:
    motion = moved(arm.joint_names)
    q = np.full(7, 0.2)
    path = go.geodesic(arm_metric, np.zeros(7), q)
    playback = playback_of(motion, arm, path, arm, go.human_arm("left"), q, [(motion, arm)])
    assert len(playback.scenes) == 4  # the second model is that of the path
    times = [len(scene.time) for scene in playback.scenes]
    assert times[0] == times[3] == 5
    assert times[2] == 1
    titles = [scene.title for scene in playback.scenes]
    assert len(set(titles)) == 4


@pytest.mark.slow
def test_synergies_are_shown_with_the_model_of_their_metric(
    arm: go.Model, arm_metric: go.KineticEnergy
) -> None:
    """Those of a file, say, all in one pane, or a part of them; or with a model that is given."""
    q = 0.2 * np.sin(np.arange(9)[:, None] + np.arange(7))
    velocity = np.full_like(q, 0.1)
    motion = go.Motion(0.5 + np.arange(9) / 10.0, q, arm.joint_names, velocity)
    cuts = [(0, 3), (3, 5), (5, 8)]
    synergies, predicted = go.synergies.reconstruct(arm_metric, motion, cuts)
    straight, _ = go.synergies.reconstruct(go.Euclidean(7), motion, cuts)
    for items in ((synergies,), (list(synergies),), (synergies, arm), ((straight, arm),)):
        playback = playback_of(*items)
        (scene,) = playback.scenes
        assert scene.title == arm.name
        (trail,) = scene.trails
        assert trail.role == "predicted"
        ends = arm.hand_pose(predicted.q[[0, -1]])[1]
        np.testing.assert_allclose(trail.points[[0, -1]], ends, atol=1e-9)
        spans = playback.spans["synergies"]
        assert [span.name for span in spans] == ["1", "2", "3"]
        np.testing.assert_allclose([span.stop for span in spans], motion.time[[3, 5, 8]])
    assert playback_of(synergies[1]).range == pytest.approx((0.8, 1.0))
    assert len(playback_of({"before": synergies, "after": [synergies[0]]}).scenes) == 2
    with pytest.raises(ValueError, match="give the model"):
        playback_of(straight)


@pytest.mark.slow
def test_a_dictionary_gives_titles(arm: go.Model) -> None:
    motion = moved(arm.joint_names)
    playback = playback_of({"first": (motion, arm), "second": arm, "more": [arm, arm]})
    titles = [scene.title for scene in playback.scenes]
    assert titles == ["first", "second", "more (1)", "more (2)"]
    assert playback.plots[0].title == "first"
    (scene,) = playback_of({"only": arm}).scenes
    assert scene.title == "only"


@pytest.mark.slow
def test_analyses_solutions_and_paths_are_known(
    bundled_analysis: go.synergies.Analysis, arm_metric: go.KineticEnergy
) -> None:
    reach = go.solve(go.PointToPoint(arm_metric, np.zeros(7), np.full(7, 0.2)))
    for item in (bundled_analysis, reach, reach.path, bundled_analysis.synergies[0].path):
        playback = playback_of(item)
        assert playback.scenes[0].actors
        assert playback_of(playback).scenes == playback.scenes
    together = playback_of(bundled_analysis, reach)
    assert together.time_label == SECONDS
    assert together.range[1] == pytest.approx(bundled_analysis.motion.time[-1])


def test_a_reconstruction_has_its_synergies(arm: go.Model) -> None:
    motion = moved(arm.joint_names).filtered(3, 1)
    result = go.synergies.reconstruct(go.Euclidean(7), motion, [(0, 2), (2, 4)])
    for playback in (playback_of(result, arm), playback_of((result, arm))):
        assert len(playback.spans["synergies"]) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "name", "hands"),
    [
        (go.human_arm("left"), "human left arm", 1),
        (go.human_upper_body(), "human upper body", 2),
        (
            go.model.combine(go.human_arm("right"), go.human_arm("left")),
            "human right arm and human left arm",
            2,
        ),
    ],
)
def test_the_body_of_a_person_is_known_from_the_joints(
    body: go.Model, name: str, hands: int
) -> None:
    playback = playback_of(moved((*body.joint_names, "neck")))
    (scene,) = playback.scenes
    assert f"assumed: {name} of 1.80 m" in scene.note
    assert len(scene.trails) == hands
    unknown = playback_of(moved(body.joint_names, None)).scenes[0].note
    assert f"assumed: {name} of 1.75 m, the height is not known" in unknown


@pytest.mark.slow
def test_both_arms_have_the_width_of_the_shoulders_between_them() -> None:
    body = go.model.combine(go.human_arm("right"), go.human_arm("left"))
    person = go.human_upper_body(1.8)
    scene = playback_of(moved(body.joint_names)).scenes[0]
    places = [scene.actors[0].positions[f"{side} upper arm"][0] for side in ("right", "left")]
    expected = [
        person.frame_pose(f"{side} upper arm", np.zeros(20))[1] for side in ("right", "left")
    ]
    np.testing.assert_allclose(places[0] - places[1], expected[0] - expected[1], atol=1e-9)


def test_what_cannot_be_shown_says_what_can(arm: go.Model) -> None:
    motion = moved(("a", "b"))
    with pytest.raises(ValueError, match=r"give its model after it; its joints are a, b"):
        playback_of(motion)
    with pytest.raises(TypeError, match=r"int cannot be shown; what can be shown is .*Motion, "):
        playback_of(arm, 5)
    with pytest.raises(TypeError, match="ndarray cannot be shown"):
        playback_of(np.zeros(7))
    with pytest.raises(TypeError, match="Motion may be followed by its Model, got int"):
        playback_of((motion, 5))
    with pytest.raises(TypeError, match="Euclidean cannot be shown"):
        playback_of((go.Euclidean(2), arm))
    with pytest.raises(TypeError, match="Playback may be followed by nothing, got Model"):
        playback_of((still("a"), arm))
    for nothing in ((), ([],), ({},)):
        with pytest.raises(ValueError, match="give at least one result"):
            playback_of(*nothing)
    trajectory = go.trajectory.JointTrajectory(*[np.zeros(1)], *[np.zeros((1, 1))] * 3, ("a",))
    with pytest.raises(ValueError, match="give it after the trajectory, whose joints are a"):
        playback_of(trajectory)


def test_a_class_of_the_same_name_elsewhere_is_not_a_result() -> None:
    class Motion:
        pass

    with pytest.raises(TypeError, match="Motion cannot be shown"):
        playback_of(Motion())


def test_equal_titles_are_numbered() -> None:
    playback = beside([still("arm"), still("robot"), still("arm")])
    assert [scene.title for scene in playback.scenes] == ["arm (1)", "robot", "arm (2)"]
    assert list(playback.spans) == ["arm (1)", "robot", "arm (2)"]
    assert [plot.title for plot in playback.plots] == ["arm (1)", "robot", "arm (2)"]
    assert playback.title == "arm and robot"


def test_times_stay_and_path_parameters_take_the_longest_time() -> None:
    playback = beside(
        [still("path", 0.0, 0.5, 1.0, label=PARAMETER), still("a", 1.0, 2.0), still("b", 1.0, 4.0)]
    )
    assert playback.time_label == SECONDS
    path, first, second = playback.scenes
    np.testing.assert_allclose(path.time, [1.0, 2.5, 4.0])
    np.testing.assert_array_equal(first.time, [1.0, 2.0])
    np.testing.assert_array_equal(second.time, [1.0, 4.0])
    assert path.note == "path parameter 0 to 1 in 3 s"
    assert first.note == ""
    np.testing.assert_allclose(playback.plots[0].curves[0].time, [1.0, 2.5, 4.0])
    (span,) = playback.spans["path"]
    assert (span.start, span.stop) == (1.0, 4.0)


def test_paths_alone_keep_their_parameter() -> None:
    paths = [still("a", 0.0, 1.0, label=PARAMETER), still("b", 0.0, 1.0, label=PARAMETER)]
    assert beside(paths).time_label == PARAMETER
    picture = still("model", 0.0)
    mixed = beside([picture, paths[0]])
    assert mixed.time_label == PARAMETER
    np.testing.assert_array_equal(mixed.scenes[1].time, [0.0, 1.0])


def test_a_layer_is_hidden_where_all_that_have_it_hide_it() -> None:
    def with_cuts(*hidden: str) -> Playback:
        playback = still("a", hidden=hidden)
        cloud = PointCloud("cuts", np.zeros((1, 1, 3)), ("0 s",), "cuts")
        return replace(playback, scenes=(replace(playback.scenes[0], clouds=(cloud,)),))

    assert beside([with_cuts("cuts", "frames"), still("b", hidden=())]).hidden == ("cuts", "frames")
    assert beside([with_cuts("cuts"), with_cuts()]).hidden == ()


def test_the_camera_is_between_those_of_the_parts() -> None:
    assert beside([still("a", azimuth=50.0), still("b", azimuth=-50.0)]).azimuth == 0.0
    over_the_back = beside([still("a", azimuth=210.0), still("b", azimuth=-50.0)]).azimuth
    assert over_the_back % 360.0 == pytest.approx(260.0)
    with pytest.raises(ValueError, match="at least one playback"):
        beside([])


@pytest.mark.slow
def test_a_result_takes_no_model_of_another_body(arm: go.Model) -> None:
    start, goal = np.zeros(7), np.full(7, 0.2)
    path = go.geodesic(go.KineticEnergy(arm), np.clip(start, arm.lower, arm.upper), goal)
    other = go.human_arm("left")
    assert len(playback_of(path, other).scenes) == 2  # each of them is shown
    with pytest.raises(ValueError, match="joints of the path's metric"):
        playback_of((path, other))
    assert len(playback_of(path, go.human_arm("right", height=1.9)).scenes) == 1


def test_degrees_are_asked_about(arm: go.Model) -> None:
    time, q = np.linspace(0.0, 1.0, 30), np.linspace(np.zeros(7), np.full(7, 0.5), 30)
    with pytest.raises(ValueError, match="are these degrees"):
        playback_of(go.Motion(time, np.degrees(q), arm.joint_names), arm)
    with pytest.raises(ValueError, match="are these degrees"):
        playback_of(arm, np.degrees(q[-1]))


def test_a_configuration_may_be_a_list(arm: go.Model) -> None:
    assert len(playback_of(arm, [0.1] * 7).scenes[0].time) == 1
    assert len(playback_of(arm, [[0.1] * 7, [0.2] * 7]).scenes[0].time) == 4


@pytest.mark.parametrize(
    ("item", "hint"),
    [("climb.csv", "geodesic-ocp show climb.csv"), ([0.1] * 7, "after its model"), (3, "Motion")],
)
def test_what_cannot_be_shown_is_said_with_what_to_do(item: object, hint: str) -> None:
    with pytest.raises(TypeError, match=hint):
        playback_of(item)


def test_a_problem_is_solved_first(arm: go.Model) -> None:
    with pytest.raises(TypeError, match="solve the problem first"):
        playback_of(go.Reach(arm, [0.1] * 7, (0.1, 0.4, 0.1)))
