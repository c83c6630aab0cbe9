"""Markers, and the person that was fitted to them, to be looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.body import MarkedBody
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.scenes.around.carried import carried
from geodesic_ocp.scenes.markings import PointCloud
from geodesic_ocp.scenes.motions.joint_plots import POSITIONS, joint_plots
from geodesic_ocp.scenes.motions.model_scene import model_scene, rest_of
from geodesic_ocp.scenes.motions.of_motion import viewed_from
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Curve, Playback, Plot
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.trajectory.motion import FrameMotion

_SAME = 1e-6  # [s] between a sample of the markers and that of the fit


def markers_playback(markers: Markers, *, title: str = "") -> Playback:
    """Markers alone, as points.

    Args:
        markers: in a space with z up.
        title: of the playback; the name of the subject by default.
    """
    shown, note = shown_samples(markers.time)
    cloud = PointCloud("markers", markers.positions[shown], markers.names)
    scene = Scene(
        title or markers.subject.name or "markers", markers.time[shown], clouds=(cloud,), note=note
    )
    return Playback(scene.title, (scene,), {})


def marker_fit_playback(
    fit: MarkerFit, markers: Markers | None = None, *, title: str = ""
) -> Playback:
    """The person that was fitted to markers, with the markers where they are on the person.

    Args:
        fit: to markers.
        markers: that were recorded, in the same space, to be shown beside those of the person.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: the markers were not recorded at the times of the fit.
    """
    model, motion = fit.model, fit.motion
    shown, note = shown_samples(motion.time)
    time, q = motion.time[shown], motion.q[shown]
    notes = (
        f"{len(fit.names)} markers, typically {1e3 * fit.typical_error:.0f} mm from their places",
        "the rest of the person was not fitted and is at rest" if rest_of(model) else "",
        *(f"doubtful: {doubt}" for doubt in fit.doubts),
        note,
    )
    noted = "; ".join(filter(None, notes))
    scene = model_scene(model, time, q, title=title, role="predicted", note=noted)
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
    """The markers, if they were recorded at the times of the fit; ValueError otherwise."""
    time = fit.motion.time
    if len(markers) != len(time) or np.abs(markers.time - time).max() > _SAME:
        raise ValueError(
            f"the markers ({len(markers)} samples from {markers.time[0]:.3f} s) were not recorded "
            f"at the times of the fit ({len(time)} samples from {time[0]:.3f} s)"
        )
    return markers


def fitted_positions(fit: MarkerFit) -> Array:
    """Where the markers are on the fitted person, (k, m, 3) [m], in the space of the markers.

    Their distances from the recorded markers are the errors of the fit.
    """
    model, q = fit.model, fit.motion.q
    body = MarkedBody(model)
    found = []
    for name, segment in zip(fit.names, fit.segments, strict=True):
        place = body.attachment(segment)
        point = place.origin + place.rotation @ fit.offsets[name]
        if place.joint > 0:
            rotations, origins = model.frame_pose(str(model.pin.names[place.joint]), q)
            found.append(rotations @ point + origins)
            continue
        if place.joint < 0:  # the thorax, of which the model's base is one shoulder
            across = fit.lengths["shoulder half width"]
            point = point - [across if body.lone_side == "right" else -across, 0.0, 0.0]
        found.append(np.broadcast_to(point, (len(q), 3)))
    positions = np.stack(found, axis=1)
    if fit.base is None:
        return positions
    turned = np.einsum("kij,kmj->kmi", fit.base.rotations, positions)
    return np.asarray(turned + fit.base.positions[:, None])


def _heading(base: FrameMotion) -> float:
    """Direction [deg] in which the y axis of a frame points on average: 0 is y, 90 is x."""
    x, y, _ = base.rotations[:, :, 1].mean(axis=0)
    return float(np.rad2deg(np.arctan2(x, y)))
