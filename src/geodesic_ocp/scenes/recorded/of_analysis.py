"""The analysis of a motion, to be looked at: the observed arm and the predicted one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.overview import widest_columns, widest_of_thirds
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.scenes.actor import Actor, Role, model_actor
from geodesic_ocp.scenes.around.ellipsoids import mobility_ellipsoids
from geodesic_ocp.scenes.markings import PointCloud
from geodesic_ocp.scenes.motions.joint_plots import hand_speed_plots, joint_groups, short_name
from geodesic_ocp.scenes.motions.model_scene import (
    hand_frames,
    hand_trails,
    rest_of,
)
from geodesic_ocp.scenes.motions.of_motion import viewed_from
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Curve, Playback, Plot, Span
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.motion import Motion

CUTS = "cuts"
_ERRORS = "predictions on the same segments"
_NAME = "riemannian"  # of the method by which the motion was cut
# Of the methods in the order of the table; more than six are never compared.
_ROLES: tuple[Role, ...] = get_args(Role)[1:]


def analysis_playback(analysis: Analysis, *, title: str = "") -> Playback:
    """The observed arm, the arm that the synergies predict, and errors over time.

    Every other prediction of the analysis is a layer that can be switched on.

    Args:
        analysis: of a motion.
        title: of the playback; the model's name and the number of synergies by default.
    """
    model, motion = analysis.model, analysis.motion
    shown, note = shown_samples(motion.time)
    labels = analysis.labels()
    others = [name for name in labels if name != _NAME and name not in analysis.not_found]
    predictions = {name: analysis.predictions[name].q[shown] for name in (_NAME, *others)}
    observed, predicted = motion.q[shown], predictions[_NAME]
    actors = [
        model_actor(model, observed, name="observed", role="observed"),
        *rest_of(model),
        _overlay(model, predicted, "predicted", "predicted", "predicted"),
    ]
    trails = [
        *hand_trails(model, observed, "observed", name="observed"),
        *hand_trails(model, predicted, "predicted", name="predicted"),
    ]
    for name in others:
        label, role = labels[name], _role(analysis, name)
        actors.append(_overlay(model, predictions[name], label, role, label))
        trails += [
            replace(trail, name=label)  # as its layer
            for trail in hand_trails(model, predictions[name], role, layer=label)
        ]
    metric = f"synergies: {analysis.metric_name}".replace("^2", "²")
    scene = Scene(
        model.name,
        motion.time[shown],
        tuple(actors),
        tuple(trails),
        frames=hand_frames(model, observed),
        ellipsoids=mobility_ellipsoids(model, observed, analysis.metric),
        clouds=_cuts(analysis),
        note="; ".join(filter(None, (metric, note))),
    )
    return Playback(
        title or f"{model.name}, {len(analysis.synergies)} geodesic synergies",
        (scene,),
        {"synergies": synergy_spans(analysis.synergies)},
        _plots(analysis, shown),
        azimuth=viewed_from(model),
        hidden=(*Playback.hidden, *(labels[name] for name in others)),
    )


def _overlay(model: Model, q: Array, name: str, role: Role, layer: str) -> Actor:
    return model_actor(model, q, name=name, role=role, translucent=True, layer=layer)


def _role(analysis: Analysis, method: str) -> Role:
    return _ROLES[list(analysis.labels()).index(method)]


def _cuts(analysis: Analysis) -> tuple[PointCloud, ...]:
    """Where the hands are at the cuts between synergies, and at both ends."""
    model = analysis.model
    samples = [analysis.segments[0][0], *(stop for _, stop in analysis.segments)]
    names = tuple(f"{time:.2f} s" for time in analysis.motion.time[samples])
    clouds = []
    for hand in model.hands:
        points = model.frame_pose(hand, analysis.motion.q[samples])[1]
        clouds.append(PointCloud(CUTS, points[None], names, CUTS, "observed"))
    return tuple(clouds)


def synergy_spans(synergies: Sequence[Synergy]) -> tuple[Span, ...]:
    """Spans of synergies, numbered from 1."""
    spans = []
    for number, synergy in enumerate(synergies, 1):
        start, stop = synergy.start_time, synergy.start_time + synergy.duration
        text = f"synergy {number} ({synergy.duration:.2f} s)"
        spans.append(Span(str(number), start, stop, text))
    return tuple(spans)


def _plots(analysis: Analysis, shown: Indices) -> tuple[Plot, ...]:
    model, motion, predicted = analysis.model, analysis.motion, analysis.predicted
    time = motion.time[shown]
    joints: list[Curve] = []
    hands: dict[str, list[Curve]] = {label: [] for label in hand_labels(model.hands)}
    for method, name in analysis.on_same_segments().items():
        role = _role(analysis, method)
        q = analysis.predictions[method].q[shown]
        error = np.mean(np.abs(q - motion.q[shown]), axis=1)
        joints.append(Curve(name, time, error, role))
        for label, hand in zip(hands, model.hands, strict=True):
            ways = [model.frame_pose(hand, each)[1] for each in (q, motion.q[shown])]
            distance = 1000.0 * np.linalg.norm(ways[0] - ways[1], axis=1)
            hands[label].append(Curve(name, time, distance, role))
    plots = [Plot("mean joint error [rad]", tuple(joints), _ERRORS)]
    for label, errors in hands.items():
        plots.append(Plot(f"{label} error [mm]", tuple(errors), _ERRORS))
    both: dict[str, tuple[Motion, Role]] = {
        "observed": (motion, "observed"),
        "predicted": (predicted, "predicted"),
    }
    for column in _widest(model, motion.q):
        curves = tuple(
            Curve(name, time, each.q[shown, column], role) for name, (each, role) in both.items()
        )
        label = f"{short_name(model.joint_names[column])} [{model.units[column]}]"
        plots.append(Plot(label, curves))
    return (*plots, *hand_speed_plots(model, both, shown))


def _widest(model: Model, q: Array) -> list[int]:
    """The joint of largest range of shoulder, elbow and wrist, or of trunk and of each arm."""
    groups = joint_groups(model).values()
    if len(groups) == 1:
        return widest_of_thirds(q)
    return [group[widest_columns(q[:, group], 1)[0]] for group in groups]
