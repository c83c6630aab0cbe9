"""Obstacle problems: how many are solved from which guesses, and how good the solutions are."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np
import scipy.ndimage

import geodesic_ocp as go

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


def clear(problem: go.PointToPoint, q: np.ndarray) -> np.ndarray:
    """Least distance [m] at configurations (k, n)."""
    model, obstacles = problem.metric.model, problem.obstacles
    nearest = go.distances.nearest_points(model, q, obstacles)
    return np.min([each.distances for each in nearest.values()], axis=0)


def two_joints(count: int, seed: int = 1) -> Iterator[go.PointToPoint]:
    """A planar arm between random configurations among three balls."""
    model, rng = planar_arm((0.5, 0.5), 0.03), np.random.default_rng(seed)
    metric = go.KineticEnergy(model)
    while count:
        angle, far = rng.uniform(-np.pi, np.pi, 3), rng.uniform(0.25, 1.0, 3)
        places = zip(far * np.cos(angle), far * np.sin(angle), strict=True)
        balls = [go.Ball((x, y, 0.0), rng.uniform(0.05, 0.15)) for x, y in places]
        q0, q1 = rng.uniform(-3.0, 3.0, (2, 2))
        problem = go.PointToPoint(metric, q0, q1, limits=True, obstacles=balls)
        if np.all(clear(problem, np.array([q0, q1])) > 0.0):
            count -= 1
            yield problem


def is_feasible(problem: go.PointToPoint, size: int = 601) -> bool:
    """Whether a graph on a grid in joint space connects start and goal."""
    ticks = np.linspace(-3.0, 3.0, size)
    q = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=2).reshape(-1, 2)
    free = (clear(problem, q) > 0.0).reshape(size, size)
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
        if np.all(clear(problem, np.array([q0, q1])) > 0.0):
            count -= 1
            yield problem


def folding(number: int = 0) -> go.PointToPoint:
    """A planar arm with three joints that folds to pass between posts and a wall."""
    model = planar_arm((0.4, 0.4, 0.3), 0.03)
    wall = go.Capsule((0.75, -0.5, 0.0), (0.75, 0.5, 0.0), 0.02)
    posts = [go.Ball((0.0, 0.62, 0.0), 0.05), go.Ball((-0.55, 0.55, 0.0), 0.05)]
    obstacles = [wall, *posts, go.Capsule((0.75, 0.5, 0.0), (1.2, 0.5, 0.0), 0.02)]
    q0, q1 = (-1.2, 0.3, 0.3), (1.75, 0.4, 0.4)
    return go.PointToPoint(go.KineticEnergy(model), q0, q1, limits=True, obstacles=obstacles)


def solved(problem: go.Problem, **options) -> tuple[float, float, str]:
    """Energy, NaN if there is no solution, CPU seconds, and the guess."""
    begin = time.process_time()
    solution = go.solve(problem, throw=False, **options)
    seconds = time.process_time() - begin
    if not solution.stats.success:
        return np.nan, seconds, solution.stats.status
    q = solution.path(np.linspace(0.0, 1.0, 2001))
    assert clear(problem, q).min() > -2e-4
    return solution.path.energy, seconds, getattr(solution.stats, "guess", "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=["two", "seven", "fold"])
    parser.add_argument("--starts", nargs="+", type=int, default=[1])
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--best", help="npz of best energies known")
    o = parser.parse_args()
    if "two" in o.only:
        run("two joints", [p for p in two_joints(60) if is_feasible(p)], o)
        run("two joints, infeasible", [p for p in two_joints(60) if not is_feasible(p)], o)
    if "seven" in o.only:
        run("seven joints", list(seven_joints(30)), o)
    if "fold" in o.only:
        run("folding", [folding()], o)


def run(name, problems, o) -> None:
    for starts in o.starts:
        options = {} if starts == 1 else {"num_starts": starts}
        found = [solved(p, **options) for p in problems]
        energies = np.array([each[0] for each in found])
        seconds = np.array([each[1] for each in found])
        if o.verbose:
            for k, each in enumerate(found):
                print("  ", k, *each)
        print(
            f"{name}, num_starts {starts}: {np.isfinite(energies).sum()} of {len(found)}, "
            f"CPU s median {np.median(seconds):.2f} "
            f"max {seconds.max():.2f} sum {seconds.sum():.1f}",
            flush=True,
        )
        np.save(
            f"/tmp/n/guess/{name}-{starts}-{'new' if hasattr(go.Path, 'through') else 'old'}.npy",
            np.array([energies, seconds]),
        )


if __name__ == "__main__":
    main()
