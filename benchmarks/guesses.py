"""Obstacle problems: how many are solved from which guesses, and how good the solutions are."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.ndimage

import geodesic_ocp as go

TOLERANCE = 2e-4  # [m], of distances between the nodes of a path
URDF = """<robot name="planar"><link name="base"/>{}</robot>"""
LINK = """
<link name="link{0}"><inertial><origin xyz="{1} 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="joint{0}" type="revolute"><parent link="{2}"/><child link="link{0}"/>
<origin xyz="{3} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>
</joint>"""


def planar_arm(lengths: tuple[float, ...], radius: float) -> go.Model:
    """Links [m] in the plane, as capsules."""
    parts, parent, offset = [], "base", 0.0
    for k, length in enumerate(lengths):
        parts.append(LINK.format(k, length / 2.0, parent, offset))
        parent, offset = f"link{k}", length
    model = go.load_model(URDF.format("".join(parts)), hand=parent)
    bodies = [
        go.Capsule((0.0, 0.0, 0.0), (length, 0.0, 0.0), radius, link=f"link{k}")
        for k, length in enumerate(lengths)
    ]
    return model.with_bodies(*bodies)


def clearances(problem: go.PointToPoint, q: np.ndarray) -> np.ndarray:
    """Least distance [m] at configurations (k, n)."""
    model, obstacles = problem.metric.model, problem.obstacles
    nearest = go.distances.nearest_points(model, q, obstacles)
    return np.min([each.distances for each in nearest.values()], axis=0)


def two_joints(count: int, seed: int = 1) -> Iterator[go.PointToPoint]:
    """A planar arm between random configurations among four balls."""
    model, rng = planar_arm((0.5, 0.5), 0.03), np.random.default_rng(seed)
    metric = go.KineticEnergy(model)
    while count:
        angle, far = rng.uniform(-np.pi, np.pi, 4), rng.uniform(0.25, 1.0, 4)
        places = zip(far * np.cos(angle), far * np.sin(angle), strict=True)
        balls = [go.Ball((x, y, 0.0), rng.uniform(0.08, 0.18)) for x, y in places]
        q0, q1 = rng.uniform(-3.0, 3.0, (2, 2))
        problem = go.PointToPoint(metric, q0, q1, limits=True, obstacles=balls)
        if np.all(clearances(problem, np.array([q0, q1])) > 0.0):
            count -= 1
            yield problem


def is_feasible(problem: go.PointToPoint, size: int = 401) -> bool:
    """Whether a graph on a grid in joint space connects start and goal."""
    ticks = np.linspace(-3.0, 3.0, size)
    q = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=2).reshape(-1, 2)
    free = (clearances(problem, q) > 0.0).reshape(size, size)
    labels, _ = scipy.ndimage.label(free)
    start, goal = (
        labels[tuple(np.abs(ticks[:, None] - np.array(each)).argmin(axis=0))]
        for each in (problem.q0, problem.q1)
    )
    return bool(start == goal != 0)


def seven_joints(count: int, seed: int = 2) -> Iterator[go.PointToPoint]:
    """A person's arm between random configurations, a ball halfway on the hand's way."""
    arm, rng = go.human_arm(), np.random.default_rng(seed)
    metric = go.KineticEnergy(arm)
    while count:
        q0, q1 = rng.uniform(arm.lower, arm.upper, (2, 7))
        ball = go.Ball(tuple(arm.hand_pose((q0 + q1) / 2.0)[1]), 0.08)
        problem = go.PointToPoint(metric, q0, q1, limits=True, obstacles=[ball])
        if np.all(clearances(problem, np.array([q0, q1])) > 0.0):
            count -= 1
            yield problem


def folding() -> go.PointToPoint:
    """A planar arm with three joints that folds to pass between posts and a wall."""
    model = planar_arm((0.4, 0.4, 0.3), 0.03)
    wall = go.Capsule((0.75, -0.5, 0.0), (0.75, 0.5, 0.0), 0.02)
    posts = [go.Ball((0.0, 0.62, 0.0), 0.05), go.Ball((-0.55, 0.55, 0.0), 0.05)]
    obstacles = [wall, *posts, go.Capsule((0.75, 0.5, 0.0), (1.2, 0.5, 0.0), 0.02)]
    q0, q1 = (-1.2, 0.3, 0.3), (1.75, 0.4, 0.4)
    return go.PointToPoint(go.KineticEnergy(model), q0, q1, limits=True, obstacles=obstacles)


def solved(problem: go.PointToPoint, **options: Any) -> tuple[float, float]:
    """Length, infinite if there is no solution, and CPU seconds."""
    begin = time.process_time()
    solution = go.solve(problem, throw=False, **options)
    seconds = time.process_time() - begin
    if not solution.stats.success:
        return np.inf, seconds
    least = clearances(problem, solution.path(np.linspace(0.0, 1.0, 2001))).min()
    assert least > -TOLERANCE, f"in collision, {least:.1e} m"
    return solution.path.length, seconds


def best_of_seven(problem: go.PointToPoint) -> float:
    """Shortest length from the straight line bent to seven random configurations."""
    rng, model = np.random.default_rng(0), problem.metric.model
    middles = rng.uniform(model.lower, model.upper, (7, model.dof))
    guesses = [np.array([problem.q0, middle, problem.q1]) for middle in middles]
    paths = [go.Path(problem.metric, go.Grid(1, 2), nodes) for nodes in guesses]
    return min(solved(problem, guess=path)[0] for path in paths)


def report(
    name: str, problems: list[go.PointToPoint], starts: list[int], is_feasible: bool = True
) -> None:
    """Print how many problems are solved, how many lengths exceed the shortest, and times."""
    found = np.array(
        [[solved(p, **({"num_starts": k} if k > 1 else {})) for k in starts] for p in problems]
    )
    others = np.array([best_of_seven(p) if is_feasible else np.inf for p in problems])
    best = np.minimum(found[:, :, 0].min(axis=1), others)
    for k, (lengths, seconds) in zip(starts, found.transpose(1, 2, 0), strict=True):
        is_solved = np.isfinite(lengths)
        ratio = lengths[is_solved] / best[is_solved]
        longest = f"by {ratio.max() - 1.0:.0%} at most" if np.any(is_solved) else ""
        print(
            f"{name}, num_starts={k}: {is_solved.sum()} of {len(problems)} solved, "
            f"{(ratio > 1.001).sum()} longer than the shortest known {longest}; CPU time "
            f"median {np.median(seconds):.2f} s, longest {seconds.max():.2f} s, all "
            f"{seconds.sum():.1f} s",
            flush=True,
        )
    if is_feasible:
        count = np.isfinite(others).sum()
        print(f"{name}, seven random guesses: {count} of {len(problems)} solved", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="problems with two joints")
    parser.add_argument("--starts", type=int, nargs="+", default=[1, 8])
    options = parser.parse_args()
    planar: dict[bool, list[go.PointToPoint]] = {True: [], False: []}
    for problem in two_joints(options.count):
        planar[is_feasible(problem)].append(problem)
    report("two joints", planar[True], options.starts)
    report("two joints, infeasible", planar[False], [1], is_feasible=False)
    report("seven joints, one ball", list(seven_joints(options.count // 2)), options.starts)
    report("posts and walls", [folding()], options.starts)


if __name__ == "__main__":
    main()
