"""A solution, to be looked at: its path, with obstacles, collision bodies and clearances."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from geodesic_ocp.model.distances import bodies_apart
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import HalfSpace
from geodesic_ocp.ocp.problem import Problem, drawn_obstacles, parse_conditions
from geodesic_ocp.ocp.problems import ConstrainedProblem
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.scenes.around.clearances import clearances
from geodesic_ocp.scenes.around.obstacles import (
    COLLISION_BODIES,
    carried_obstacles,
    collision_bodies,
    obstacle_solids,
)
from geodesic_ocp.scenes.markings import Gap
from geodesic_ocp.scenes.paths.of_path import model_of, path_playback
from geodesic_ocp.scenes.playback import Curve, Playback, Plot
from geodesic_ocp.scenes.scene import Scene


def solution_playback(
    solution: Solution, model: Model | None = None, *, title: str = ""
) -> Playback:
    """The path of a solution, as `path_playback` shows it, among the obstacles of its problem.

    Where the model has collision bodies, those that keep clear of something can be switched on;
    clearances are those of the problem's constraints, in the scene and in a plot with the margin.
    Of a solve that failed the last iterate is shown, as the note of the scene says.

    Args:
        solution: with its problem, whose `obstacles` are shown.
        model: that moves; None: that of the problem's metric, if it has one.
        title: of the playback; by default the problem's class, energy and length.

    Raises:
        ValueError: see `path_playback`.
    """
    problem, stats = solution.problem, solution.stats
    kind = type(problem).__name__
    found = f"energy {stats.energy:.4g}, length {solution.path.length:.4g}"
    title = title or f"{kind}: {found if stats.success else 'not solved'}"
    playback = path_playback(solution.path, model, title=title)
    scene = playback.scenes[0]
    if not stats.success:
        note = f"last iterate of a solve that failed: {stats.status}"
        scene = replace(scene, note="; ".join(filter(None, (scene.note, note))))
    solids = obstacle_solids(drawn_obstacles(problem), *scene.bounds())
    scene = replace(scene, solids=solids)
    shown, plots = model_of(solution.path, model), playback.plots
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
    """The scene with what moves with the model and keeps clear of something, and the margins."""
    q = solution.path(scene.time)
    extra = [carried_obstacles(model, q, drawn_obstacles(problem))]
    constraints = parse_conditions(problem).along_q
    margins = {each.name: float(each.lower[0]) for each in constraints if each.lower.size == 1}
    pairs = problem.pairs if isinstance(problem, ConstrainedProblem) else ()
    gaps: tuple[Gap, ...] = ()
    if model.bodies and (drawn_obstacles(problem) or pairs):
        gaps = clearances(model, q, drawn_obstacles(problem), pairs=pairs, names=margins)
        extra.append(collision_bodies(model, q, _considered(problem, model, pairs, margins)))
    kept = {margins[gap.name] for gap in gaps if gap.name in margins}
    actors = (*scene.actors, *(actor for actor in extra if actor is not None))
    return replace(scene, actors=actors, gaps=gaps), tuple(sorted(kept or {0.0}))


def _considered(
    problem: Problem,
    model: Model,
    pairs: Sequence[tuple[str, str]],
    names: Collection[str],
) -> set[str]:
    """Links of the bodies that the constraints of these names keep apart; if none, of all."""
    found = {}
    for name, one, other in bodies_apart(model, drawn_obstacles(problem), None, pairs):
        found[name] = {body.link for body in (one, other) if not isinstance(body, HalfSpace)}
    wanted = [found[name] for name in found if name in names] or found.values()
    return {link for links in wanted for link in links if link is not None}
