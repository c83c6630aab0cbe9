"""Waypoints, motions and figures of solutions; callbacks; the NLP for other solvers."""

from __future__ import annotations

import json
import pickle
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import HalfPlane, Sphere
from known_problems import PlaneAroundDisc
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.callback import Iterate

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
TARGET = (0.1, 0.45, -0.05)  # [m]


@pytest.fixture(scope="module")
def uneven() -> go.Path:
    """A path along a circle of latitude, at a speed that is not constant."""
    grid = go.Grid(3, 8)
    angle = 0.2 + grid.nodes**2
    return go.Path(Sphere(), grid, np.column_stack([np.full(grid.size, 1.2), angle]))


def test_waypoints_are_equidistant(uneven: go.Path) -> None:
    points = uneven.resample(7)
    assert_allclose(points[:, 1], 0.2 + np.linspace(0.0, 1.0, 7), atol=1e-9)
    assert_allclose(
        uneven.at_length(uneven.length * np.array([0.0, 0.25, 1.0])), [0.0, 0.5, 1.0], atol=1e-8
    )
    for count in (1, 2.5):
        with pytest.raises(ValueError, match="count must be an integer above one"):
            uneven.resample(count)
    with pytest.raises(ValueError, match="lengths must be"):
        uneven.at_length([2.0 * uneven.length])


def test_resampling_a_path_that_rests_at_first() -> None:
    grid = go.Grid(4, 4)
    nodes = np.where(grid.nodes < 0.5, 0.0, grid.nodes - 0.5)[:, None] * [[1.0, 1.0]]
    path = go.Path(go.Euclidean(2), grid, nodes)
    assert_allclose(path.resample(3)[:, 0], [0.0, 0.25, 0.5], atol=1e-9)


def test_motion_from_rest_to_rest(arm: go.Model) -> None:
    solution = go.solve(go.Reach(arm, START, TARGET), tolerance=1e-6)
    motion = solution.to_motion(1.25, rate=400.0)
    assert motion.joint_names == arm.joint_names
    assert motion.duration == pytest.approx(1.25)
    assert motion.rate == pytest.approx(400.0)
    assert_allclose(motion.q[[0, -1]], [START, solution.path(1.0)], atol=1e-9)
    assert motion.velocity is not None
    assert_allclose(motion.velocity[[0, -1]], 0.0, atol=1e-9)
    slopes = np.gradient(motion.q, motion.time, axis=0)
    assert_allclose(motion.velocity[1:-1], slopes[1:-1], atol=2e-4)
    # The minimum-acceleration time law from rest to rest is a cubic with peak 1.5 times the mean.
    speeds = [
        solution.path.metric.norm(q, v) for q, v in zip(motion.q, motion.velocity, strict=True)
    ]
    assert max(speeds) == pytest.approx(1.5 * solution.path.length / 1.25, rel=1e-5)


def test_motion_with_a_time_law(arm: go.Model) -> None:
    solution = go.solve(go.Reach(arm, START, TARGET))
    law = go.trajectory.time_law(solution.path.length, 0.8, 0.3, 0.2)
    motion = solution.to_motion(law)
    assert motion.velocity is not None
    assert solution.path.metric.norm(motion.q[0], motion.velocity[0]) == pytest.approx(0.3)
    with pytest.raises(ValueError, match="the time law covers a length of"):
        solution.to_motion(go.trajectory.time_law(2.0 * solution.path.length, 0.8, 0.3, 0.2))
    with pytest.raises(ValueError, match="duration must be positive"):
        solution.to_motion(0.0)
    with pytest.raises(ValueError, match="rate must be positive"):
        solution.to_motion(1.0, rate=0.0)


def test_motion_along_a_path_of_zero_length_is_refused() -> None:
    still = go.solve(go.PointToPoint(go.Euclidean(2), (1.0, 1.0), (1.0, 1.0)))
    with pytest.raises(ValueError, match="zero length"):
        still.to_motion(1.0)


def test_coordinates_without_a_model_are_numbered() -> None:
    solution = go.solve(go.PointToPoint(HalfPlane(), (0.0, 1.0), (1.0, 2.0)))
    assert solution.to_motion(1.0, rate=20.0).joint_names == ("q[0]", "q[1]")


@pytest.mark.slow
def test_figures_show_coordinates_speed_path_and_obstacles(arm: go.Model) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    post = go.Capsule((0.45, 0.35, -0.4), (0.45, 0.35, 0.1), 0.04, name="post")
    table = go.HalfSpace((0.0, 0.0, -0.62), (0.0, 0.0, 1.0), "table")
    reach = go.Reach(arm, START, TARGET, obstacles=[post, table], through=[(0.3, 0.3, -0.2)])
    figure = go.plot(go.solve(reach, grid=go.Grid(6, 3), throw=False))
    joints, speed, hand, arm_along, close_up = figure.axes
    assert [line.get_label() for line in joints.get_lines()][:7] == list(arm.joint_names)
    assert joints.get_ylabel() == "coordinates q [rad]"
    assert speed.get_xlabel() == "path parameter s"
    assert hand.get_xlabel().startswith("hand ")
    labels = [text.get_text() for text in hand.get_legend().get_texts()]
    assert {"start", "via point", "end", "obstacles"} <= set(labels)
    texts = [text.get_text() for text in arm_along.texts]
    assert len([text for text in texts if text.startswith("s = ")]) == 6
    assert len([text for text in texts if "nearest" in text]) == 1
    assert close_up.get_title("left").startswith("nearest at s = ")
    flat = go.plot(go.solve(PlaneAroundDisc()))
    assert flat.axes[1].get_xlabel() == "q[0]"  # no panel on a constant speed


def test_saved_problem_is_restored(tmp_path: Path, arm: go.Model) -> None:
    solution = go.solve(PlaneAroundDisc(radius=0.4))
    file = solution.save(tmp_path / "disc.json")
    again = go.ocp.load_solution(file)
    assert isinstance(again.problem, PlaneAroundDisc)
    assert again.problem.radius == 0.4
    assert again.path.length == solution.path.length

    record = json.loads(file.read_text())
    for change, message in (
        ({"problem": "Missing"}, "a solution of Missing of the module .*, which is not imported"),
        ({"module": "os"}, "which is not imported"),
        ({"problem": "Any", "module": "typing"}, "which is not imported"),
        ({"fields": {"radius": 0.4, "colour": 1}}, "cannot be created from the fields in the file"),
    ):
        bad = tmp_path / "bad.json"
        bad.write_text(json.dumps(record | change))
        with pytest.raises(go.RecordingError, match=message):
            go.ocp.load_solution(bad)
    reach = go.solve(go.Reach(arm, START, TARGET)).save(tmp_path / "reach.json")
    with pytest.raises(go.RecordingError, match=r"use load_solution\('.*reach.json', problem\)"):
        go.ocp.load_solution(reach)


def test_solution_of_another_model_is_refused(tmp_path: Path, arm: go.Model) -> None:
    file = go.solve(go.Reach(arm, START, TARGET)).save(tmp_path / "reach.json")
    taller = go.Reach(go.human_arm("right", height=1.9), START, TARGET)
    with pytest.raises(go.RecordingError, match=r"its path has the energy .* in this problem's"):
        go.ocp.load_solution(file, taller)


def test_nlp_can_be_solved_by_another_solver() -> None:
    nlp = PlaneAroundDisc().nlp(go.Grid(8, 4))
    quiet = {"print_time": False, "error_on_fail": True, "ipopt": {"print_level": 0, "sb": "yes"}}
    # With CasADi's derivatives instead of the package's.
    solver = ca.nlpsol("other", "ipopt", nlp.expressions, quiet)
    path = nlp.path(solver(**nlp.values)["x"].full())
    expected = go.solve(PlaneAroundDisc(), grid=go.Grid(8, 4)).path
    assert path.energy == pytest.approx(expected.energy, rel=1e-6)
    assert PlaneAroundDisc().nlp().grid == PlaneAroundDisc().grid


def test_callback_receives_every_iterate() -> None:
    seen: list[Iterate] = []
    solution = go.solve(PlaneAroundDisc(), grid=go.Grid(16, 4), callback=seen.append)
    assert [iterate.number for iterate in seen] == list(range(solution.stats.iterations + 1))
    assert seen[-1].objective == pytest.approx(solution.stats.objective, rel=1e-8)
    assert seen[-1].violation <= 1e-7
    assert_allclose(seen[-1].path.nodes, solution.path.nodes, atol=1e-6)


def test_callback_stops_the_solver() -> None:
    with pytest.raises(go.NotConverged, match="the callback stopped Ipopt") as info:
        go.solve(PlaneAroundDisc(), callback=lambda iterate: iterate.number == 2)
    assert info.value.solution.stats.iterations == 2
    with pytest.raises(ZeroDivisionError):
        go.solve(PlaneAroundDisc(), callback=lambda iterate: 1 / 0)


@dataclass(frozen=True)
class Around(PlaneAroundDisc):
    """Fields of many types."""

    centre: Any = (0.0, 0.0)
    title: str = "nan"
    far: float = np.inf
    lamps: tuple[go.Ball, ...] = ()
    notes: Any = None


def test_fields_are_restored_with_their_types(tmp_path: Path) -> None:
    problem = Around(radius=np.float32(0.25), centre=np.array([0.5, -1.0]), title="inf")
    again = go.ocp.load_solution(go.solve(problem).save(tmp_path / "a.json")).problem
    assert isinstance(again, Around)
    assert again.radius == 0.25
    assert isinstance(again.centre, np.ndarray)
    assert np.array_equal(again.centre, problem.centre)
    assert (again.title, again.far) == ("inf", np.inf)
    lamps = Around(lamps=(go.Ball((0.0, 0.0, 0.0), 0.1),))
    file = go.solve(lamps).save(tmp_path / "b.json")
    assert go.ocp.load_solution(file).problem.lamps == lamps.lamps  # type: ignore[attr-defined]
    noted = Around(notes={"a": 1})
    file = go.solve(noted).save(tmp_path / "c.json")
    with pytest.raises(go.RecordingError, match="not hold the fields notes; use load_solution"):
        go.ocp.load_solution(file)
    assert go.ocp.load_solution(file, noted).stats.success


def test_files_of_another_problem_or_damaged_files_are_refused(tmp_path: Path) -> None:
    file = go.solve(PlaneAroundDisc(radius=0.5)).save(tmp_path / "disc.json")
    with pytest.raises(go.RecordingError, match=r"violates this problem's conditions by 0\.1"):
        go.ocp.load_solution(file, PlaneAroundDisc(radius=0.6))
    record = json.loads(file.read_text())
    for part, key, value, message in (
        ("nlp", "lam_g", [1.0], "nlp.lam_g must be 65 numbers"),
        ("nlp", "origin", [1.0], "nlp.origin must be 2 numbers"),
        ("nlp", "scale", 0, "nlp.length and nlp.scale positive"),
        ("stats", "success", "no", r"`bool`, got `str` - at `\$.stats.success`"),
        ("stats", "mesh_history", [1], r"at `\$.stats.mesh_history\[0\]`"),
        ("stats", "energy", "abc", r"at `\$.stats.energy`"),
        ("grid", "via_segments", [1.5], r"at `\$.grid.via_segments\[0\]`"),
        ("grid", "via_segments", [3], "the path has 1 via points, not 0"),
    ):
        bad = tmp_path / "bad.json"
        bad.write_text(json.dumps(record | {part: record[part] | {key: value}}))
        with pytest.raises(go.RecordingError, match=message):
            go.ocp.load_solution(bad, PlaneAroundDisc())
    bad.write_text(json.dumps(record | {"nodes": None}))
    with pytest.raises(go.RecordingError):
        go.ocp.load_solution(bad, PlaneAroundDisc())
    bad.write_text("[" * 100_000)
    with pytest.raises(go.RecordingError, match="is not JSON"):
        go.ocp.load_solution(bad, PlaneAroundDisc())


def test_callback_stops_refinement() -> None:
    grids: list[int] = []

    def second(iterate: Iterate) -> object:
        grids.append(iterate.number)
        return np.bool_(grids.count(0) == 2)

    stopped = go.solve(PlaneAroundDisc(), tolerance=1e-6, callback=second, throw=False)
    assert not stopped.stats.success
    assert grids.count(0) == 2
    assert grids[-1] == 0


def test_changed_array_needs_a_new_nlp() -> None:
    @dataclass(frozen=True, eq=False)
    class Shifted(PlaneAroundDisc):
        radius: float = 0.5
        centre: Any = None
        parameters = ("radius",)

        def constraints(self, q: ca.SX, v: ca.SX) -> list[object]:
            return [(self.radius, ca.norm_2(q - ca.DM(self.centre)), np.inf, "disc")]

    centre = np.array([0.0, 0.0])
    problem = Shifted(centre=centre)
    go.solve(problem)
    centre[1] = 0.2
    new = go.solve(Shifted(centre=centre.copy()))
    assert go.solve(problem).stats.objective == new.stats.objective


def test_unhashable_options_are_named_and_lists_accepted() -> None:
    with pytest.raises(ValueError, match="ipopt: options are numbers and strings"):
        go.solve(PlaneAroundDisc(), ipopt={"tol": [1e-8]})
    assert hash(go.Grid(4, 4, None, [2])) == hash(go.Grid(4, 4, None, (2,)))
    start = go.solve(PlaneAroundDisc())
    assert PlaneAroundDisc().nlp(go.Grid(8, 4), start).grid.segments == 8


@pytest.mark.slow
def test_live_plot_in_a_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    ipython = pytest.importorskip("IPython", reason="IPython is not installed here")
    display = pytest.importorskip("IPython.display")
    with pytest.raises(ValueError, match="works in a notebook only"):
        go.drawing.LivePlot(PlaneAroundDisc())
    shown: list[object] = []

    class Handle:
        def update(self, figure: object) -> None:
            shown.append(figure)

    def show(figure: object, display_id: bool) -> Handle:
        shown.append(figure)
        return Handle()

    monkeypatch.setattr(display, "display", show)
    monkeypatch.setattr(ipython, "get_ipython", lambda: SimpleNamespace(kernel=object()))
    problem = PlaneAroundDisc()
    with go.drawing.LivePlot(problem, interval=1e9) as live:
        solution = go.solve(problem, grid=go.Grid(16, 4), callback=live)
    assert len(shown) == 2  # the first iterate, and the last one on closing
    assert shown[0] is shown[1]
    title = shown[-1].get_suptitle()  # type: ignore[attr-defined]
    assert f"iteration {solution.stats.iterations}" in title


def test_constraint_not_differentiable_at_the_guess_is_named() -> None:
    @dataclass(frozen=True)
    class Straight(PlaneAroundDisc):
        metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))

        def guess(self, s: np.ndarray) -> None:
            return None

    with pytest.raises(go.NotConverged, match=r"not differentiable: 'disc' at s = 0\.50"):
        go.solve(Straight(), grid=go.Grid(2, 4))


class WithCost(go.Problem):
    """With a running cost, the optimal path is not straight."""

    metric = go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> list[object]:
        return [(q0, (0.0, 0.0)), (q1, (1.0, 0.0))]

    def cost(self, q: ca.SX, v: ca.SX) -> ca.SX:
        return 3.0 * (q[1] - 0.5) ** 2


class PrescribedArrival(WithCost):
    """With a prescribed velocity at the end."""

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> list[object]:
        return [*super().boundary(q0, q1), (v1, (0.0, 1.0), "arrival")]


@pytest.mark.slow
def test_certificates_mention_cost_and_active_constraints() -> None:
    with_cost = go.solve(WithCost()).certificate
    assert with_cost.has_running_cost
    assert str(with_cost) == (
        "locally minimizing energy and cost; not a geodesic, there is a running cost"
    )
    constrained = go.solve(PlaneAroundDisc()).certificate
    assert constrained.has_active_constraints
    assert str(constrained) == (
        "locally minimizing under its constraints; not a geodesic, constraints are active, "
        "2 switching points"
    )
    reach = go.solve(go.Reach(go.human_arm(), START, TARGET, limits=False)).certificate
    assert not reach.has_active_constraints
    assert "endpoint error" in str(reach)


def test_prescribed_end_velocity_cannot_be_refined() -> None:
    assert_allclose(go.solve(PrescribedArrival()).path(1.0, 1), [0.0, 1.0], atol=1e-7)
    with pytest.raises(ValueError, match=r"with a prescribed velocity at an end \(arrival\)"):
        go.solve(PrescribedArrival(), tolerance=1e-4)


def test_incomplete_classes_are_named() -> None:
    class NoMetric(WithCost):
        metric = None  # type: ignore[assignment]

    class NoConditions(WithCost):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> None:  # type: ignore[override]
            return None

    with pytest.raises(ValueError, match="NoMetric defines no metric"):
        go.solve(NoMetric())
    with pytest.raises(ValueError, match="boundary must give a list of conditions, got None"):
        go.solve(NoConditions())


def test_a_motion_keeps_the_speed_of_its_problem() -> None:
    line = go.PointToPoint(go.Euclidean(2), (0.0, 0.0), (0.9, 0.0), speed=1.0)
    solution = go.solve(line)
    with pytest.raises(ValueError, match=r"in 1 s q\[0\] would move at 1\.35 times .*in 1\.35 s"):
        solution.to_motion(1.0)
    assert np.abs(solution.to_motion(1.35).velocity).max() == pytest.approx(1.0, rel=1e-3)


def test_solutions_come_back_from_other_processes() -> None:
    """What a process pool does: the problem and the numbers are pickled, also of a failure."""
    solution = go.solve(PlaneAroundDisc())
    again = pickle.loads(pickle.dumps(solution))
    assert_allclose(again.path.nodes, solution.path.nodes, rtol=0.0, atol=0.0)
    assert again.stats == solution.stats
    assert str(again.certificate) == str(solution.certificate)
    for name, values in solution.multipliers.items():
        assert_allclose(again.multipliers[name], values, rtol=0.0, atol=0.0)
    with pytest.raises(go.NotConverged) as raised:
        go.solve(PlaneAroundDisc(), ipopt={"max_iter": 1})
    failure = pickle.loads(pickle.dumps(raised.value))
    assert str(failure) == str(raised.value)
    assert failure.solution.stats == raised.value.solution.stats  # type: ignore[attr-defined]
