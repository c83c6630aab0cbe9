"""A path, to be looked at: an arm that moves along it, or the curve in its coordinates."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.path_figure import limits_reached
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.around.ellipsoids import mobility_ellipsoids
from geodesic_ocp.scenes.markings import PointCloud
from geodesic_ocp.scenes.motions.joint_plots import POSITIONS, joint_plots, short_name
from geodesic_ocp.scenes.motions.model_scene import model_scene
from geodesic_ocp.scenes.motions.of_motion import viewed_from
from geodesic_ocp.scenes.paths.planes import coordinate_scene, seen_from
from geodesic_ocp.scenes.playback import PARAMETER, Curve, Playback, Plot, Span
from geodesic_ocp.trajectory.path import Path

VIA_POINTS = "via points"
_SAMPLES = 101
_SAME = 1e-9  # in s: equal but for rounding
_AZIMUTH = 210.0  # [deg], from which a first coordinate x increases to the right
_IN_SPACE = 3  # coordinates of a curve that can be seen without a model


def path_playback(path: Path, model: Model | None = None, *, title: str = "") -> Playback:
    """A model that moves along a path or geodesic, over the path parameter s.

    With the path of the hand, via points, mobility ellipsoids of the path's metric, coordinates
    with the limits that they reach, and the speed. Without a model a path of up to three
    coordinates is a curve in their space, with unit balls of the metric.

    >>> import geodesic_ocp as go
    >>> path_playback(go.geodesic(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0]))
    Playback('Geodesic: length 5', 1 scenes, 0 to 1)

    Args:
        path: that is shown.
        model: that moves; None: that of the path's metric, if it has one.
        title: of the playback; by default what the path is, and its length.

    Raises:
        ValueError: the model has another number of joints, or none is given and there are more than
            three coordinates.
    """
    title = title or f"{type(path).__name__}: length {path.length:.4g}"
    shown = model_of(path, model)
    s = _samples(path)
    q = path(s)
    spans, plots = _between_via_points(path), (*_coordinates(path, shown, s, q), _speed(path, s, q))
    if shown is None:
        scene = coordinate_scene(path.metric, s, q)
        via = np.pad(path.nodes[path.grid.via_nodes], ((0, 0), (0, 3 - path.metric.dim)))
    else:
        scene = model_scene(shown, s, q, title=shown.name)
        scene = replace(scene, ellipsoids=mobility_ellipsoids(shown, q, path.metric))
        via = _hands_at_via_points(path, shown)
    if len(via):
        names = tuple(f"via point {number + 1}" for number in range(len(path.grid.via_nodes)))
        labels = names * (len(via) // len(names))
        scene = replace(scene, clouds=(PointCloud(VIA_POINTS, via[None], labels, VIA_POINTS),))
    points = np.concatenate([np.zeros((0, 3)), *(trail.points for trail in scene.trails)])
    usual = _AZIMUTH if shown is None else viewed_from(shown), None
    azimuth, elevation = seen_from(points) or usual
    return Playback(
        *(title, (scene,), spans, plots, PARAMETER), azimuth=azimuth, elevation=elevation
    )


def model_of(path: Path, model: Model | None = None) -> Model | None:
    """The given model, or that of the path's metric; None for a curve that can be seen without.

    Raises:
        ValueError: see `path_playback`.
    """
    metric = path.metric
    shown: Model | None = getattr(metric, "model", None) if model is None else model
    if shown is None and metric.dim > _IN_SPACE:
        raise ValueError(
            f"{type(metric).__name__} has no model, and a path of {metric.dim} coordinates cannot "
            "be seen without: give the model that moves along it"
        )
    if shown is not None and shown.dof != metric.dim:
        raise ValueError(
            f"model must have the path's {metric.dim} coordinates, {shown.name!r} has {shown.dof}"
        )
    names = metric.joint_names
    if shown is not None and names is not None and tuple(names) != shown.joint_names:
        raise ValueError(
            f"model must have the joints of the path's metric, {', '.join(names)}; those of "
            f"{shown.name!r} are {', '.join(shown.joint_names)}"
        )
    return shown


def _samples(path: Path) -> Array:
    """Evenly spaced s from 0 to 1, and the breakpoints, where the path may have corners."""
    s = np.union1d(np.linspace(0.0, 1.0, _SAMPLES), path.breakpoints)
    return np.asarray(s[np.append(np.diff(s) > _SAME, True)])


def _hands_at_via_points(path: Path, model: Model) -> Array:
    """Positions (m, 3) [m] of the hands at the via points, one hand after the other."""
    nodes = path.nodes[path.grid.via_nodes]
    if not len(nodes):
        return np.zeros((0, 3))
    return np.concatenate([np.asarray(model.frame_pose(hand, nodes)[1]) for hand in model.hands])


def _between_via_points(path: Path) -> dict[str, tuple[Span, ...]]:
    edges = [0.0, *map(float, path.grid.via_s), 1.0]
    if len(edges) == 2:
        return {}
    texts = [*(f"to via point {number}" for number in range(1, len(edges) - 1)), "to the end"]
    parts = zip(texts, pairwise(edges), strict=True)
    return {"path": tuple(Span(str(k + 1), *ends, text) for k, (text, ends) in enumerate(parts))}


def _coordinates(path: Path, model: Model | None, s: Array, q: Array) -> tuple[Plot, ...]:
    if model is None:
        names = path.metric.joint_names or [f"q[{index}]" for index in range(path.metric.dim)]
        curves = (Curve(name, s, column) for name, column in zip(names, q.T, strict=True))
        return (Plot("coordinates q", tuple(curves)),)
    reached = dict(
        zip(map(short_name, model.joint_names), limits_reached(path, model), strict=True)
    )
    return tuple(
        replace(
            plot,
            marks=tuple(x for curve in plot.curves for x in reached[curve.name]),
            marked="limits reached",
        )
        for plot in joint_plots(model, s, q, POSITIONS)
    )


def _speed(path: Path, s: Array, q: Array) -> Plot:
    unit = " [√kg m]" if isinstance(path.metric, KineticEnergy) else ""
    # Zero is in the plot: rounding errors of a constant speed would fill it otherwise.
    speed = Curve("speed", s, speeds_at(path.metric, q, path(s, 1)), "observed")
    return Plot(f"speed |q'|{unit}", (speed,), marks=(0.0,))
