"""Paths in a plane, their coordinates, and unit balls of metrics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.analysis_figure import widest_columns
from geodesic_ocp.drawing.arm_shapes import draw_obstacle
from geodesic_ocp.drawing.arm_strip import draw_path_arms, moves_in_plane
from geodesic_ocp.drawing.styles import OBSERVED, PREDICTED, line_styles, new_figure
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.problem import Problem, drawn_obstacles
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_plane_path(axes: Axes, path: Array, via: Array, names: tuple[str, str]) -> None:
    """Draw a path (k, 2) with marks at its ends and at via points (m, 2)."""
    axes.plot(*path.T, **OBSERVED, label="path")
    hollow = {"color": "white", "markeredgecolor": OBSERVED["color"], "markersize": 6}
    axes.plot(*path[:1].T, "o", label="start", **hollow)
    if len(via):
        axes.plot(*via.T, "D", label="via point", color="#7a7a7a", markersize=6)
    axes.plot(*path[-1:].T, "s", label="end", color=PREDICTED["color"], markersize=6)
    axes.set(xlabel=names[0], ylabel=names[1])
    axes.set_aspect("equal", adjustable="datalim")


def draw_unit_balls(axes: Axes, centres: Array, matrices: Array, size: float) -> None:
    """Draw unit balls of metrics (k, 2, 2) around points (k, 2), the largest with this radius.

    They are narrow in directions in which motion is expensive.
    """
    if not len(centres):
        return
    turns = np.linspace(0.0, 2.0 * np.pi, 73)
    circle = np.array([np.cos(turns), np.sin(turns)])
    outlines = np.linalg.solve(np.linalg.cholesky(matrices).transpose(0, 2, 1), circle)
    scale = size / np.abs(outlines).max()
    for index, (centre, outline) in enumerate(zip(centres, outlines, strict=True)):
        label = "unit balls of the metric" if index == 0 else None
        axes.plot(*(centre[:, None] + scale * outline), color="#8fa3b8", linewidth=1.0, label=label)


# (axes, path, columns): draws additional items, such as obstacles; see `Problem.draw`.
DrawExtra: TypeAlias = "Callable[[Axes, Path, tuple[int, int]], None]"

_SAMPLES = 201
_HEIGHT = 5.2  # [inch], without arms
_ABOVE = 0.5  # [inch], of the title of the arms
# unit balls along the path, and their size relative to it
_BALLS = 7
_RADIUS = 0.06
_CONSTANT = 0.02  # of the largest speed, by which one that is constant differs at most
_REACHED = 1e-6  # of the range between two limits


def draw_path(
    path: Path,
    title: str = "",
    draw_extra: DrawExtra | None = None,
    figure: Figure | None = None,
    *,
    obstacles: Sequence[Obstacle] = (),
    links: Sequence[str] | None = None,
    arms: bool = True,
) -> Figure:
    """Draw a path: its coordinates over s, the hand's path or that in the plane, and the arm.

    The speed is drawn, too, where it is not constant.

    Args:
        title: title of the figure.
        draw_extra: draws additional items beside the path, such as obstacles.
        figure: to be cleared and drawn into; None: a new one.
        obstacles: drawn beside the arm.
        links: links of the arm that keep clear of obstacles; None: all that move.
        arms: whether the arm is drawn at some instants, if the metric is that of a model.
    """
    model: Model | None = getattr(path.metric, "model", None)
    in_space = model is not None and model.moves(model.hand) and path.metric.dim > 2
    beside = in_space or path.metric.dim == 2
    # What only slides looks the same everywhere.
    shown = model if arms and model is not None and "rad" in model.units else None
    flat = shown is not None and moves_in_plane(shown, path)
    close = shown is not None and not flat and bool(obstacles)
    width = (11.0 if beside else 7.0) + 4.5 * (flat or close)
    if figure is None:
        figure = new_figure(width, _HEIGHT)
    else:
        figure.clear()
    rows = (2.2, 1.0) if shown is None or flat else (1.0, 2.2, 1.0)
    grid = figure.add_gridspec(
        len(rows), (2 if beside else 1) + (flat or close), height_ratios=rows
    )
    s = np.linspace(0.0, 1.0, _SAMPLES)
    speeds = speeds_at(path.metric, path(s), path(s, 1))  # NaN where there is no metric
    if np.ptp(speeds) > _CONSTANT * speeds.max():
        axes = figure.add_subplot(grid[-2, 0])
        below = figure.add_subplot(grid[-1, 0], sharex=axes)
        below.plot(s, speeds, **OBSERVED)
        unit = "\n[kg$^{1/2}$ m]" if isinstance(path.metric, KineticEnergy) else ""
        below.set_ylabel(f"speed |q'|{unit}")
        axes.tick_params(labelbottom=False)
    else:
        below = axes = figure.add_subplot(grid[-2:, 0])
    _draw_coordinates(axes, path)
    below.set_xlabel("path parameter s")
    if beside:
        axes = figure.add_subplot(grid[-2:, 1])
        if in_space:
            _draw_hand(axes, path, draw_extra)
        else:
            _draw_plane(axes, path, draw_extra)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    if shown is not None:
        axes = figure.add_subplot(grid[:, -1] if flat else grid[0, :])
        zoom = figure.add_subplot(grid[-2:, -1]) if close else None
        draw_path_arms(axes, path, shown, obstacles, links, zoom)
        if not flat:  # as high as the arms are in the width of the figure
            above = float(np.divide(*(np.ptp(each) for each in (axes.get_ylim(), axes.get_xlim()))))
            height = 0.96 * width * above + _ABOVE
            grid.set_height_ratios((height, 2.2 / 3.2 * _HEIGHT, 1.0 / 3.2 * _HEIGHT))
            figure.set_size_inches(width, _HEIGHT + height)
    figure.suptitle(title)
    return figure


def _draw_coordinates(axes: Axes, path: Path) -> None:
    s = np.linspace(0.0, 1.0, _SAMPLES)
    model: Model | None = getattr(path.metric, "model", None)
    units = "" if model is None else f" [{' or '.join(dict.fromkeys(model.units))}]"
    names = path.metric.coordinate_names
    for name, column, style in zip(names, path(s).T, line_styles(len(names)), strict=True):
        axes.plot(s, column, label=name, **style)
    axes.set_xlim(0.0, 1.0)
    limits = limits_reached(path, model)
    for line, limit in zip(axes.get_lines(), limits, strict=True):
        for value in limit:
            axes.axhline(value, color=line.get_color(), linewidth=0.8, linestyle=":")
    for at_via in path.grid.via_s:
        axes.axvline(float(at_via), color="#7a7a7a", linewidth=1.0, linestyle=":")
    axes.set_ylabel(f"coordinates q{units}")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")


def limits_reached(path: Path, model: Model | None) -> list[list[float]]:
    """Return the joint limits of a model that each coordinate reaches, if it moves; without one,
    none.
    """
    if model is None:
        return [[] for _ in range(path.metric.dim)]
    near = _REACHED * np.minimum(model.upper - model.lower, 1.0)
    return [
        [
            float(limit)
            for limit in limits
            if np.any(np.abs(column - limit) <= close) and np.ptp(column) > 0.0
        ]
        for column, *limits, close in zip(path.nodes.T, model.lower, model.upper, near, strict=True)
    ]


def _draw_plane(axes: Axes, path: Path, draw_extra: DrawExtra | None) -> None:
    """Draw the path of two coordinates, with unit balls of its metric."""
    way = path(np.linspace(0.0, 1.0, _SAMPLES))
    names = path.metric.coordinate_names
    units = getattr(getattr(path.metric, "model", None), "units", ("", ""))
    labels = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    draw_plane_path(axes, way, path.nodes[path.grid.via_nodes], (labels[0], labels[1]))
    centres = path(np.linspace(0.0, 1.0, _BALLS))
    matrices = np.array([path.metric.matrix(centre) for centre in centres])
    there = np.array([np.all(np.linalg.eigvalsh(np.nan_to_num(m)) > 0.0) for m in matrices])
    draw_unit_balls(
        axes, centres[there], matrices[there], _RADIUS * float(np.ptp(way, axis=0).max())
    )
    if draw_extra is not None:
        draw_extra(axes, path, (0, 1))


def _draw_hand(axes: Axes, path: Path, draw_extra: DrawExtra | None) -> None:
    """Draw the path of the hand in the two axes of largest range."""
    model: Model = path.metric.model  # type: ignore[attr-defined]
    way: Array = model.hand_pose(path(np.linspace(0.0, 1.0, _SAMPLES)))[1]
    first, second = widest_columns(way, 2)
    columns = [first, second]
    stops = np.zeros((0, 3))
    if path.grid.via_segments:
        stops = model.hand_pose(path.nodes[path.grid.via_nodes])[1]
    labels = f"hand {'xyz'[first]} [m]", f"hand {'xyz'[second]} [m]"
    draw_plane_path(axes, way[:, columns], stops[:, columns], labels)
    if draw_extra is not None:
        draw_extra(axes, path, (first, second))


def draw_obstacles(problem: Problem, axes: Axes, path: Path, columns: tuple[int, int]) -> None:
    """Draw what a problem adds to the figure of a path: outlines of obstacles, and its own items.

    Args:
        problem: the problem, see `Problem.draw`.
        axes, path, columns: see `Problem.draw`.
    """
    # Axes of two joints are not those of space.
    in_joints = getattr(path.metric, "model", None) is not None and path.metric.dim <= 2
    obstacles = () if in_joints else drawn_obstacles(problem)
    several = len(obstacles) > 1
    for number, obstacle in enumerate(obstacles):
        label = "obstacles" if several else obstacle.name or "obstacle"
        draw_obstacle(axes, obstacle, columns, label if number == 0 else None)
    problem.draw(axes, path, columns)


def path_figure(path: Path) -> Figure:
    """Draw coordinates and speed over s, the path of the hand or in the plane, and the arm."""
    return draw_path(path, f"{type(path).__name__.lower()} of length {path.length:.4g}")


def solution_figure(solution: Solution) -> Figure:
    """Draw coordinates and speed over s, beside the path of the hand or in the plane, and the arm.

    The arm is drawn at some values of s, with the obstacles of the problem; where it comes nearest
    to one of them, the distance of its collision bodies is given.
    """
    problem = solution.problem
    title = (
        f"{type(problem).__name__}: energy {solution.stats.energy:.4g}, "
        f"length {solution.path.length:.4g}"
    )
    return draw_path(
        solution.path,
        title,
        partial(draw_obstacles, problem),
        obstacles=drawn_obstacles(problem),
        links=getattr(problem, "links", None),
    )
