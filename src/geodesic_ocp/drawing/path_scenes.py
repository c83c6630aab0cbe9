"""Scenes of paths and solutions: arms, or curves in the space of their coordinates."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.model_scene import POSITIONS, joint_plots, model_scene, short_name
from geodesic_ocp.drawing.motion_scenes import motion_playback, viewed_from
from geodesic_ocp.drawing.path_figure import limits_reached
from geodesic_ocp.drawing.scene import (
    PARAMETER,
    Curve,
    Gap,
    Playback,
    Plot,
    PointCloud,
    Scene,
    Span,
    Trail,
)
from geodesic_ocp.drawing.surroundings import (
    COLLISION_BODIES,
    carried_obstacles,
    clearances,
    collision_bodies,
    inverse_tensors,
    longest_drawn,
    mobility_ellipsoids,
    obstacle_solids,
    scaled_ellipsoids,
)
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.distances import bodies_apart
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import HalfSpace
from geodesic_ocp.ocp.motion_solution import PhasedMotion
from geodesic_ocp.ocp.problem import Problem, drawn_obstacles, parse_conditions
from geodesic_ocp.ocp.problems import ConstrainedProblem
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.timed_motion import TimedMotion

UNIT_BALLS = "unit balls of the metric"
_SIZE = 0.08  # of the largest unit ball, relative to the path
_RINGS = 7
_SIDES = 60
_FLAT = 1e-9  # thickness of curves in a plane, relative to their extent
_ABOVE = 89.0  # [deg]: looking straight down, a camera could turn about itself


def coordinate_scene(metric: Metric, s: Array, q: Array) -> Scene:
    """Return a curve of up to three coordinates, with unit balls of the metric along it.

    Coordinates are lengths along x, y and z, whatever they mean: angles on a sphere stay angles.

    Args:
        metric: metric of the manifold, of dimension 1 to 3.
        s: path parameters of the samples (k,).
        q: coordinates (k, n).
    """
    points = _in_space(q)
    size = _SIZE * float(np.ptp(points, axis=0).max())
    images = np.zeros((len(q), 3, 3))
    images[:, : metric.dim, : metric.dim] = inverse_tensors(metric, q)
    squares, directions = np.linalg.eigh(images)
    lengths = np.sqrt(np.maximum(squares, 0.0))
    longest = longest_drawn(squares[:, -1])
    ball = scaled_ellipsoids([(UNIT_BALLS, points, images)], size)
    rings: list[Trail] = []
    if metric.dim == 2 and size > 0.0 and longest > 0.0:
        angles = np.linspace(0.0, 2.0 * np.pi, _SIDES + 1)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        axes = directions * (size * np.minimum(lengths / longest, 1.0))[:, None]
        for k in np.linspace(0, len(q) - 1, _RINGS).astype(int):
            if lengths[k].max() > 0.0:
                outline = points[k] + circle @ axes[k][:, 1:].T
                rings.append(Trail(UNIT_BALLS, outline, "neutral", layer=UNIT_BALLS))
    path = Trail("path", points, "observed", points, layer="path")
    names = metric.coordinate_names
    axes_note = ", ".join(f"{axis}: {name}" for axis, name in zip("xyz", names, strict=False))
    if longest > 0.0 and size > 0.0:
        axes_note += f"; {UNIT_BALLS} drawn {size / longest:.3g} times their size"
    ball = tuple(replace(track, layer=UNIT_BALLS) for track in ball)
    title = metric.label or type(metric).__name__
    return Scene(title, s, trails=(path, *rings), ellipsoids=ball, note=axes_note)


def seen_from(points: Array) -> tuple[float, float] | None:
    """Return azimuth and elevation [deg] that face the plane of points (k, 3), parallel to two
    axes.

    None if they lie in no such plane, or on a line.
    """
    if not len(points):
        return None
    ranges = np.ptp(points, axis=0)
    thin = ranges <= _FLAT * float(ranges.max())
    if thin.sum() != 1:
        return None
    return [(90.0, 0.0), (180.0, 0.0), (180.0, _ABOVE)][int(np.argmax(thin))]


def _in_space(q: Array) -> Array:
    """Return coordinates (k, n) as points (k, 3): zero in the axes that are not there."""
    return np.pad(q, ((0, 0), (0, 3 - q.shape[1])))


VIA_POINTS = "via points"
_SAMPLES = 101
_SAME = 1e-9  # in s: equal but for rounding
_AZIMUTH = 210.0  # [deg], from which a first coordinate x increases to the right
_IN_SPACE = 3  # coordinates of a curve that can be seen without a model


def path_playback(path: Path, model: Model | None = None, *, title: str = "") -> Playback:
    """Return a model that moves along a path or geodesic, over the path parameter s.

    With the path of the hand, via points, mobility ellipsoids of the path's metric, coordinates
    with the limits that they reach, and the speed. Without a model a path of up to three
    coordinates is a curve in their space, with unit balls of the metric.

    >>> path_playback(go.geodesic(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0]))
    Playback('Geodesic: length 5', 1 scenes, 0 to 1)

    Args:
        model: model that moves; None: that of the path's metric, if it has one.
        title: title of the playback; by default what the path is, and its length.

    Raises:
        ValueError: the model has another number of joints, or none is given and there are more than
            three coordinates.
    """
    title = title or f"{type(path).__name__}: length {path.length:.4g}"
    shown = model_of(path.metric, model)
    s = _samples(path)
    q = path(s)
    spans = _between_via_points(path)
    plots = (*_coordinates(path, shown, s, q), _speed(path, s, q))
    if shown is None:
        scene = coordinate_scene(path.metric, s, q)
        via = _in_space(path.nodes[path.grid.via_nodes])
    else:
        scene = model_scene(shown, s, q, title=shown.name)
        scene = replace(scene, ellipsoids=mobility_ellipsoids(shown, q, path.metric))
        nodes = path.nodes[path.grid.via_nodes]
        hands = shown.hands if len(nodes) else ()
        ways = [np.asarray(shown.frame_pose(hand, nodes)[1]) for hand in hands]
        via = np.concatenate([np.zeros((0, 3)), *ways])
    if len(via):
        names = tuple(f"via point {number + 1}" for number in range(len(path.grid.via_nodes)))
        labels = names * (len(via) // len(names))
        scene = replace(scene, clouds=(PointCloud(VIA_POINTS, via[None], labels, VIA_POINTS),))
    points = np.concatenate([np.zeros((0, 3)), *(trail.points for trail in scene.trails)])
    usual = _AZIMUTH if shown is None else viewed_from(shown), None
    azimuth, elevation = seen_from(points) or usual
    return Playback(title, (scene,), spans, plots, PARAMETER, azimuth=azimuth, elevation=elevation)


def model_of(metric: Metric, model: Model | None = None) -> Model | None:
    """Return the given model, or that of a path's metric; None for a curve that can be seen
    without.

    Raises:
        ValueError: see `path_playback`.
    """
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
    """Return evenly spaced s from 0 to 1, and the breakpoints, where the path may have corners."""
    s = np.union1d(np.linspace(0.0, 1.0, _SAMPLES), path.breakpoints)
    return np.asarray(s[np.append(np.diff(s) > _SAME, True)])


def _between_via_points(path: Path) -> dict[str, tuple[Span, ...]]:
    edges = [0.0, *map(float, path.grid.via_s), 1.0]
    if len(edges) == 2:
        return {}
    texts = [*(f"to via point {number}" for number in range(1, len(edges) - 1)), "to the end"]
    parts = zip(texts, pairwise(edges), strict=True)
    return {"path": tuple(Span(str(k + 1), *ends, text) for k, (text, ends) in enumerate(parts))}


def _coordinates(path: Path, model: Model | None, s: Array, q: Array) -> tuple[Plot, ...]:
    if model is None:
        return _coordinate_plots(path.metric, s, q)
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


def _coordinate_plots(metric: Metric, time: Array, q: Array) -> tuple[Plot, ...]:
    pairs = zip(metric.coordinate_names, q.T, strict=True)
    return (Plot("coordinates q", tuple(Curve(name, time, column) for name, column in pairs)),)


def _speed(path: Path, s: Array, q: Array) -> Plot:
    unit = " [√kg m]" if isinstance(path.metric, KineticEnergy) else ""
    # Zero is in the plot: rounding errors of a constant speed would fill it otherwise.
    speed = Curve("speed", s, speeds_at(path.metric, q, path(s, 1)), "observed")
    return Plot(f"speed |q'|{unit}", (speed,), marks=(0.0,))


def solution_playback(solution: Solution, model: Model | None = None) -> Playback:
    """Return the path of a solution, as `path_playback` shows it, among the obstacles of its
    problem.

    Where the model has collision bodies, those that keep clear of something can be switched on;
    clearances are those of the problem's constraints, in the scene and in a plot with the margin.
    Of a solve that failed the last iterate is shown, as the note of the scene says.

    Args:
        solution: solution with its problem, whose `obstacles` are shown.
        model: model that moves; None: that of the problem's metric, if it has one.

    Raises:
        ValueError: see `path_playback`.
    """
    problem = solution.problem
    stats = solution.stats
    kind = type(problem).__name__
    found = f"energy {stats.energy:.4g}, length {solution.path.length:.4g}"
    title = f"{kind}: {found if stats.success else 'not solved'}"
    playback = path_playback(solution.path, model, title=title)
    scene = playback.scenes[0]
    if not stats.success:
        note = f"last iterate of a solve that failed: {stats.status}"
        scene = replace(scene, note="; ".join(filter(None, (scene.note, note))))
    solids = obstacle_solids(drawn_obstacles(problem), *scene.bounds())
    scene = replace(scene, solids=solids)
    shown = model_of(solution.path.metric, model)
    plots = playback.plots
    if shown is not None:
        scene, margins = _with_bodies(scene, problem, shown, solution)
        if scene.gaps:
            curves = tuple(Curve(gap.name, scene.time, gap.distances) for gap in scene.gaps)
            plots = (*plots, Plot("clearance [m]", curves, marks=margins, marked="required"))
    hidden = (*(layer for layer in playback.hidden if layer != "clearances"), COLLISION_BODIES)
    return replace(playback, scenes=(scene,), plots=plots, hidden=hidden)


def _with_bodies(
    scene: Scene, problem: Problem, model: Model, solution: Solution
) -> tuple[Scene, tuple[float, ...]]:
    """Return the scene with what moves with the model and keeps clear of something, and the
    margins.
    """
    q = solution.path(scene.time)
    extra = carried_obstacles(model, q, drawn_obstacles(problem))
    constraints = parse_conditions(problem).along_q
    margins = {each.name: float(each.lower[0]) for each in constraints if each.lower.size == 1}
    pairs = problem.pairs if isinstance(problem, ConstrainedProblem) else ()
    gaps: tuple[Gap, ...] = ()
    if model.bodies and (drawn_obstacles(problem) or pairs):
        gaps = clearances(model, q, drawn_obstacles(problem), pairs=pairs, names=margins)
        extra += collision_bodies(model, q, _considered(problem, model, pairs, margins))
    kept = {margins[gap.name] for gap in gaps if gap.name in margins}
    return replace(scene, actors=scene.actors + extra, gaps=gaps), tuple(sorted(kept or {0.0}))


def _considered(
    problem: Problem,
    model: Model,
    pairs: Sequence[tuple[str, str]],
    names: Collection[str],
) -> set[str]:
    """Get links of the bodies that the constraints of these names keep apart; if none, of all."""
    found = {}
    for name, one, other in bodies_apart(model, drawn_obstacles(problem), None, pairs):
        found[name] = {body.link for body in (one, other) if not isinstance(body, HalfSpace)}
    wanted = [found[name] for name in found if name in names] or found.values()
    return {link for links in wanted for link in links if link is not None}


def timed_playback(motion: TimedMotion, model: Model | None = None) -> Playback:
    """Return a motion q(t): its model, or the curve of its coordinates, among the obstacles.

    Args:
        motion: a Riemannian spline or the solution of a `MotionProblem`.
        model: model that moves; None: that of the motion's metric, if it has one.

    Raises:
        ValueError: there is no model, and more than three coordinates.
    """
    metric = motion.metric
    sampled = motion.to_motion()
    shown = model_of(metric, model)
    title = type(getattr(motion, "problem", motion)).__name__
    if shown is not None:
        playback = motion_playback(sampled, shown, title=title)
    else:
        scene = coordinate_scene(metric, sampled.time, sampled.q)
        plots = _coordinate_plots(metric, sampled.time, sampled.q)
        playback = Playback(title, (scene,), {}, plots)
    scene = playback.scenes[0]
    obstacles = drawn_obstacles(motion.problem) if isinstance(motion, PhasedMotion) else ()
    scene = replace(scene, solids=obstacle_solids(obstacles, *scene.bounds()))
    return replace(playback, scenes=(scene,))
