"""Scenes of recordings: analyses, synergies, markers and fits to markers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import model_actor, rest_of_person
from geodesic_ocp.drawing.analysis_figure import errors_over_time, widest_columns, widest_of_thirds
from geodesic_ocp.drawing.look import Indices
from geodesic_ocp.drawing.model_scene import (
    POSITIONS,
    hand_frames,
    hand_speed_plots,
    hand_trails,
    joint_groups,
    joint_plots,
    model_scene,
    overlaid,
    short_name,
    shown_samples,
)
from geodesic_ocp.drawing.motion_scenes import motion_playback, of_joints, viewed_from
from geodesic_ocp.drawing.path_scenes import model_of
from geodesic_ocp.drawing.scene import (
    Curve,
    Cut,
    Playback,
    Plot,
    PointCloud,
    Scene,
    Span,
    numbered_spans,
)
from geodesic_ocp.drawing.styles import Role
from geodesic_ocp.drawing.surroundings import carried, mobility_ellipsoids
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.body import MarkedBody
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.synergy import SavedSynergies, Synergy, motion_in_spans
from geodesic_ocp.synergies.uncertainty import Uncertainty
from geodesic_ocp.trajectory.motion import FrameMotion, Motion

CUTS = "cuts"
_ERRORS = "predictions on the same segments"
_NAME = "riemannian"  # of the method by which the motion was cut
# Of the methods in the order of the table; more than six are never compared.
_ROLES: tuple[Role, ...] = get_args(Role)[1:]


def analysis_playback(
    analysis: Analysis, uncertainty: Uncertainty | None = None, *, title: str = ""
) -> Playback:
    """Return the observed arm, the arm that the synergies predict, and errors over time.

    Every other prediction of the analysis is a layer that can be switched on.

    Args:
        analysis: analysis of a motion.
        uncertainty: its uncertainty, by which cuts are marked as stable or doubtful.
        title: title of the playback; the model's name and the number of synergies by default.
    """
    model = analysis.model
    motion = analysis.motion
    shown, note = shown_samples(motion.time)
    labels = analysis.labels()
    others = [name for name in labels if name != _NAME and name not in analysis.not_found]
    observed = motion.q[shown]
    metric = f"synergies: {analysis.metric_name}".replace("^2", "²")
    scene = Scene(
        model.name,
        motion.time[shown],
        (model_actor(model, observed, name="observed", role="observed"), *rest_of_person(model)),
        hand_trails(model, observed, "observed", name="observed"),
        frames=hand_frames(model, observed),
        ellipsoids=mobility_ellipsoids(model, observed, analysis.metric),
        clouds=_cuts(analysis),
        note="; ".join(filter(None, (metric, note, motion.caveat))),
    )
    scene = overlaid(scene, model, analysis.predicted.q[shown], "predicted", "predicted")
    for name in others:
        q = analysis.predictions[name].q[shown]
        role = _role(analysis, name)
        scene = overlaid(scene, model, q, labels[name], role, layer=labels[name])
    spans = synergy_spans(analysis.synergies)
    return Playback(
        title or f"{model.name}, {len(analysis.synergies)} geodesic synergies",
        (scene,),
        {"synergies": spans if uncertainty is None else marked(spans, uncertainty.marks)},
        _plots(analysis, shown, others),
        azimuth=viewed_from(model),
        hidden=(*Playback.hidden, *(labels[name] for name in others)),
    )


def _role(analysis: Analysis, method: str) -> Role:
    return _ROLES[list(analysis.labels()).index(method)]


def _cuts(analysis: Analysis) -> tuple[PointCloud, ...]:
    """Return where the hands are at the cuts between synergies, and at both ends."""
    model = analysis.model
    samples = [analysis.segments[0][0], *(stop for _, stop in analysis.segments)]
    names = tuple(f"{time:.2f} s" for time in analysis.motion.time[samples])
    clouds = []
    for hand in model.hands:
        points = model.frame_pose(hand, analysis.motion.q[samples])[1]
        clouds.append(PointCloud(CUTS, points[None], names, CUTS, "observed"))
    return tuple(clouds)


def marked(spans: Sequence[Span], marks: Sequence[Cut]) -> tuple[Span, ...]:
    """Return the spans (c + 1,) with the marks of the cuts between them (c,)."""
    pairs = zip(spans[1:], marks, strict=True)
    return (spans[0], *(replace(s, text=f"{s.text}, {m} cut before it", cut=m) for s, m in pairs))


def synergy_spans(synergies: Sequence[Synergy]) -> tuple[Span, ...]:
    """Return spans of synergies, numbered from 1."""
    times = ((each.start_time, each.start_time + each.duration) for each in synergies)
    return numbered_spans("synergy", times)


def _plots(analysis: Analysis, shown: Indices, others: Sequence[str]) -> tuple[Plot, ...]:
    model = analysis.model
    motion = analysis.motion
    predicted = analysis.predicted
    time = motion.time[shown]
    roles = {name: _role(analysis, method) for method, name in analysis.on_same_segments().items()}
    compared = {
        name: analysis.predictions[method].q[shown]
        for method, name in analysis.on_same_segments().items()
    }
    joints, hands = errors_over_time(model, motion.q[shown], compared)

    def errors(label: str, values: Mapping[str, Array], scale: float = 1.0) -> Plot:
        curves = (Curve(each, time, scale * values[each], roles[each]) for each in values)
        return Plot(label, tuple(curves), _ERRORS)

    plots = [errors("mean joint error [rad]", joints)]
    plots += [errors(f"{label} error [mm]", each, 1000.0) for label, each in hands.items()]
    every: dict[str, tuple[Motion, Role]] = {
        "observed": (motion, "observed"),
        "predicted": (predicted, "predicted"),
    }
    labels = analysis.labels()
    layers = {labels[name]: (analysis.predictions[name], _role(analysis, name)) for name in others}
    every |= layers
    moving = []
    for column in _widest(model, motion.q):
        curves = tuple(
            Curve(name, time, each.q[shown, column], role) for name, (each, role) in every.items()
        )
        label = f"{short_name(model.joint_names[column])} [{model.units[column]}]"
        moving.append(Plot(label, curves))
    for plot in (*moving, *hand_speed_plots(model, every, shown)):
        switched = (replace(each, layer=each.name * (each.name in layers)) for each in plot.curves)
        plots.append(replace(plot, curves=tuple(switched)))
    return tuple(plots)


def _widest(model: Model, q: Array) -> list[int]:
    """Get the joint of largest range of shoulder, elbow and wrist, or of trunk and of each arm."""
    groups = joint_groups(model).values()
    if len(groups) == 1:
        return widest_of_thirds(q)
    return [group[widest_columns(q[:, group], 1)[0]] for group in groups]


_SAME = 1e-6  # [s] between a sample of the markers and that of the fit


def markers_playback(markers: Markers) -> Playback:
    """Return markers alone, as points.

    Args:
        markers: in a space with z up.
    """
    shown, note = shown_samples(markers.time)
    cloud = PointCloud("markers", markers.positions[shown], markers.names)
    title = markers.subject.name or "markers"
    scene = Scene(title, markers.time[shown], clouds=(cloud,), note=note)
    return Playback(scene.title, (scene,), {})


def marker_fit_playback(
    fit: MarkerFit, markers: Markers | None = None, *, title: str = ""
) -> Playback:
    """Return the person that was fitted to markers, with the markers where they are on the person;
    what was not fitted is faded.

    Args:
        fit: to markers.
        markers: markers that were recorded, in the same space, to be shown beside those of the
            person.
        title: title of the playback; the model's name by default.

    Raises:
        ValueError: the markers were not recorded at the times of the fit.
    """
    model = fit.model
    motion = fit.motion
    shown, note = shown_samples(motion.time)
    time = motion.time[shown]
    q = motion.q[shown]
    notes = (
        f"{len(fit.names)} markers, typically {1e3 * fit.typical_error:.0f} mm from their places",
        "the rest of the person was not fitted and is at rest" if rest_of_person(model) else "",
        note,
        motion.caveat,
    )
    noted = "; ".join(filter(None, notes))
    scene = model_scene(model, time, q, title=title, role="predicted", note=noted)
    fitted, *rest = scene.actors
    faded = (replace(each, translucent=True) for each in rest)
    scene = replace(scene, actors=(fitted, *faded))
    on_person = fitted_positions(fit)[shown]
    clouds = [PointCloud("markers on the person", on_person, fit.names, role="predicted")]
    azimuth = viewed_from(model)
    if fit.base is not None:
        scene = carried(scene, fit.base.rotations[shown], fit.base.positions[shown])
        azimuth += _heading(fit.base)
    if markers is not None:
        recorded = _at_times_of(fit, markers).positions[shown]
        clouds.append(PointCloud("recorded markers", recorded, markers.names, role="observed"))
    scene = replace(scene, clouds=tuple(clouds))
    known = np.ma.masked_invalid(1000.0 * fit.errors[shown])
    curves = (
        Curve("mean", time, np.asarray(known.mean(axis=1).filled(np.nan))),
        Curve("largest", time, np.asarray(known.max(axis=1).filled(np.nan))),
    )
    plots = (Plot("marker error [mm]", curves), *joint_plots(model, time, q, POSITIONS))
    return Playback(scene.title, (scene,), {}, plots, azimuth=azimuth)


def _at_times_of(fit: MarkerFit, markers: Markers) -> Markers:
    """Return the markers, if they were recorded at the times of the fit; ValueError otherwise."""
    time = fit.motion.time
    if len(markers) != len(time) or np.abs(markers.time - time).max() > _SAME:
        raise ValueError(
            f"the markers ({len(markers)} samples from {markers.time[0]:.3f} s) were not recorded "
            f"at the times of the fit ({len(time)} samples from {time[0]:.3f} s)"
        )
    return markers


def fitted_positions(fit: MarkerFit) -> Array:
    """Return the markers on the fitted person, (k, m, 3) [m], in the space of the markers.

    Their distances from the recorded markers are the errors of the fit.
    """
    model = fit.model
    q = fit.motion.q
    body = MarkedBody(model)
    found = []
    for name, segment in zip(fit.names, fit.segments, strict=True):
        place = body.attachment(segment)
        # A lone arm's proportions need not be those of the trunk, which has the person's height.
        taller = (fit.height or 1.0) / (body.height or 1.0) if place.joint < 0 else 1.0
        point = taller * place.origin + place.rotation @ fit.offsets[name]
        if place.joint > 0:
            rotations, origins = model.frame_pose(str(model.pin.names[place.joint]), q)
            found.append(rotations @ point + origins)
            continue
        if place.joint < 0:  # the thorax, of which the model's base is one shoulder
            across = fit.lengths["shoulder half width"]
            base = np.array([across if body.lone_side == "right" else -across, 0.0, 0.0])
            point = point + (place.across - 1.0) * base
        found.append(np.broadcast_to(point, (len(q), 3)))
    positions = np.stack(found, axis=1)
    if fit.base is None:
        return positions
    turned = np.einsum("kij,kmj->kmi", fit.base.rotations, positions)
    return np.asarray(turned + fit.base.positions[:, None])


def _heading(base: FrameMotion) -> float:
    """Return direction [deg] in which the y axis of a frame points on average: 0 is y, 90 is x."""
    x, y, _ = base.rotations[:, :, 1].mean(axis=0)
    return float(np.rad2deg(np.arctan2(x, y)))


_PREDICTED: Role = "predicted"


def synergies_playback(synergies: Sequence[Synergy], model: Model | None = None) -> Playback:
    """Return the motion that synergies predict, one after the other.

    Args:
        synergies: in the order of their times, at least one; between them the arm rests.
        model: model with their joints; None: that of their metric.

    Raises:
        ValueError: none is given, and the metric has none; or it has other joints.
    """
    whole = model_of(synergies[0].path.metric, model)
    if whole is None:
        raise ValueError("synergies are shown with their model: give it after them")
    spans = tuple((each.start_time, each.start_time + each.duration) for each in synergies)
    motion = motion_in_spans(spans, [*synergies], whole.joint_names)
    return saved_synergies_playback(SavedSynergies(motion, spans, whole.name), whole)


def saved_synergies_playback(
    saved: SavedSynergies, model: Model, observed: Motion | None = None, *, title: str = ""
) -> Playback:
    """Return the motion that synergies predict, as an overlay of the observed one if that is given.

    Args:
        saved: from a file.
        model: model with their joints.
        observed: the motion from which they are, with velocities.
        title: title of the playback; the model's name by default.

    Raises:
        ValueError: the synergies, or the motion, lack joints of the model.
    """
    spans = numbered_spans("synergy", saved.spans)
    predicted = replace(saved.motion, velocity=saved.motion(saved.motion.time, 1))
    if observed is None:
        note = "as the synergies predict"
        whole = motion_playback(predicted, model, title=title, note=note, role=_PREDICTED)
        return replace(whole, spans={"synergies": spans})
    chosen = of_joints(observed, model)
    whole = motion_playback(chosen, model, title=title)
    shown, _ = shown_samples(chosen.time)
    q = of_joints(predicted, model)(chosen.time[shown].clip(*predicted.time[[0, -1]]))
    scene = whole.scenes[0]
    own, *rest = scene.actors
    scene = replace(scene, actors=(replace(own, name="observed", role="observed"), *rest))
    scene = overlaid(scene, model, q, _PREDICTED, _PREDICTED)
    both: dict[str, tuple[Motion, Role]] = {
        "observed": (chosen, "observed"),
        _PREDICTED: (of_joints(predicted, model), _PREDICTED),
    }
    plots = tuple(plot for plot in whole.plots if not plot.label.startswith("hand speed"))
    return replace(
        whole,
        scenes=(scene,),
        spans={"synergies": spans},
        plots=(*plots, *hand_speed_plots(model, both)),
    )
