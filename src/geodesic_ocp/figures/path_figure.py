"""The picture of a solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.figures.plot import (
    OBSERVED,
    draw_capsule,
    draw_coordinates,
    draw_ellipses,
    draw_half_plane,
    draw_way,
    widest_columns,
)
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule, HalfSpace, Obstacle, as_capsule
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from geodesic_ocp.ocp.problem.problem import Problem
    from geodesic_ocp.ocp.solve.solution import Solution

_PLACES = 201
_ELLIPSES, _SIZE = 7, 0.06  # how many on the path, and how large beside it
_TOUCHED = 1e-6  # of the room between two limits
_ROUNDING = 1e-9  # of the speed, relative


def draw(solution: Solution) -> Figure:
    """Coordinates and speed over s, beside the path in the plane or the hand's."""
    return draw_path(
        solution.problem,
        solution.path,
        f"{type(solution.problem).__name__}: energy {solution.stats.energy:.4g}, "
        f"length {solution.path.length:.4g}",
    )


def draw_path(problem: Problem, path: Path, title: str, figure: Figure | None = None) -> Figure:
    """A path of a problem, which need not solve it.

    Args:
        problem: what belongs to the picture besides (`Problem.draw`).
        path: to be drawn.
        title: of the figure.
        figure: to be drawn anew; None: a new one.
    """
    model = getattr(problem.metric, "model", None)
    in_space = model is not None and len({model.moves(model.hand)}) and path.metric.dim > 2
    beside = in_space or path.metric.dim == 2
    if figure is None:
        figure = Figure(figsize=(11.0 if beside else 7.0, 5.2), layout="constrained")
    else:
        figure.clear()
    grid = figure.add_gridspec(2, 2 if beside else 1, height_ratios=(2.2, 1.0))
    _draw_coordinates(figure.add_subplot(grid[0, 0]), path)
    _draw_speed(figure.add_subplot(grid[1, 0]), path)
    if beside:
        axes = figure.add_subplot(grid[:, 1])
        if in_space:
            _draw_hand(axes, problem, path)
        else:
            _draw_plane(axes, problem, path)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    figure.suptitle(title)
    return figure


def _names(path: Path) -> tuple[list[str], str]:
    """Names of the coordinates, and their unit or units."""
    names = path.metric.joint_names or [f"q[{index}]" for index in range(path.metric.dim)]
    model = getattr(path.metric, "model", None)
    units = "" if model is None else f" [{' or '.join(dict.fromkeys(model.units))}]"
    return list(names), units


def _draw_coordinates(axes: Axes, path: Path) -> None:
    s = np.linspace(0.0, 1.0, _PLACES)
    names, units = _names(path)
    draw_coordinates(axes, s, path(s), names)
    for line, limit in zip(axes.get_lines(), _limits_reached(path), strict=True):
        for value in limit:
            axes.axhline(value, color=line.get_color(), linewidth=0.8, linestyle=":")
    for share in path.grid.via_s:
        axes.axvline(float(share), color="#7a7a7a", linewidth=1.0, linestyle=":")
    axes.set_ylabel(f"coordinates q{units}")
    axes.tick_params(labelbottom=False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")


def _limits_reached(path: Path) -> list[list[float]]:
    """For each coordinate the joint limits that the path touches."""
    model: Model | None = getattr(path.metric, "model", None)
    if model is None:
        return [[] for _ in range(path.metric.dim)]
    near = _TOUCHED * np.minimum(model.upper - model.lower, 1.0)
    return [
        [
            float(limit)
            for limit in limits
            if np.any(np.abs(column - limit) <= close) and np.ptp(column) > 0.0
        ]
        for column, *limits, close in zip(path.nodes.T, model.lower, model.upper, near, strict=True)
    ]


def _draw_speed(axes: Axes, path: Path) -> None:
    s = np.linspace(0.0, 1.0, _PLACES)
    function = path.metric.speed.map(s.size)
    speeds = evaluate(function, path(s).T, path(s, 1).T).ravel()  # NaN where there is no metric
    axes.plot(s, speeds, **OBSERVED)
    # Noise would fill the panel.
    if speeds.max() > 0.0 and np.ptp(speeds) <= 0.02 * speeds.max():
        axes.set_ylim(0.9 * speeds.max(), 1.1 * speeds.max())
    axes.set_xlim(0.0, 1.0)
    axes.set_xlabel("path parameter s")
    unit = "\n[kg$^{1/2}$ m]" if isinstance(path.metric, KineticEnergy) else ""
    axes.set_ylabel(f"speed |q'|{unit}")


def _draw_plane(axes: Axes, problem: Problem, path: Path) -> None:
    """The path of two coordinates, with circles of its metric."""
    way = path(np.linspace(0.0, 1.0, _PLACES))
    names, _ = _names(path)
    units = getattr(getattr(path.metric, "model", None), "units", ("", ""))
    labels = [f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True)]
    draw_way(axes, way, path.nodes[path.grid.via_nodes], (labels[0], labels[1]))
    centres = path(np.linspace(0.0, 1.0, _ELLIPSES))
    matrices = np.array([path.metric.matrix(centre) for centre in centres])
    there = np.array([np.all(np.linalg.eigvalsh(np.nan_to_num(m)) > 0.0) for m in matrices])
    draw_ellipses(axes, centres[there], matrices[there], _SIZE * float(np.ptp(way, axis=0).max()))
    problem.draw(axes, path, (0, 1))


def _draw_hand(axes: Axes, problem: Problem, path: Path) -> None:
    """The hand's path in the two axes in which it goes furthest."""
    model: Any = problem.metric
    way: Array = model.model.hand_pose(path(np.linspace(0.0, 1.0, _PLACES)))[1]
    first, second = widest_columns(way, 2)
    columns = [first, second]
    stops = np.zeros((0, 2))
    if path.grid.via_segments:
        stops = model.model.hand_pose(path.nodes[path.grid.via_nodes])[1][:, columns]
    draw_way(
        axes, way[:, columns], stops, (f"hand {'xyz'[first]} [m]", f"hand {'xyz'[second]} [m]")
    )
    problem.draw(axes, path, (first, second))


def draw_obstacle(
    axes: Axes, obstacle: Obstacle, columns: tuple[int, int], label: str | None = None
) -> None:
    """The outline of an obstacle that stands still, seen along the third axis.

    A half-space whose plane is not seen edge-on is left out: it would fill the picture.
    """
    shown = list(columns)
    if isinstance(obstacle, HalfSpace):
        normal = np.array(obstacle.normal)[shown]
        if np.linalg.norm(normal) > 1.0 - _ROUNDING:
            draw_half_plane(axes, np.array(obstacle.point)[shown], normal, label)
    elif obstacle.link is None:
        body: Capsule = as_capsule(obstacle)
        start, end = (np.array(each)[shown] for each in (body.start, body.end))
        draw_capsule(axes, start, end, body.radius, label)
