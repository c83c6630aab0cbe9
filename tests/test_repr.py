"""Values show themselves in a few lines, however many numbers they hold."""

from __future__ import annotations

import inspect

import casadi as ca
import numpy as np
import pytest
from known_models import planar_arm
from public_names import public_names
from short_reprs import OF_EXECUTION, OF_RECORDINGS, OF_STUDIES, check_reprs

import geodesic_ocp as go
from geodesic_ocp.fitting.cost_fit import CostFit
from geodesic_ocp.fitting.resampling import CrossValidation
from geodesic_ocp.ocp.callback import Iterate
from geodesic_ocp.recordings.markers.fit_uncertainty import FitNoise
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.studies.equal_numbers import EqualNumbers
from geodesic_ocp.trajectory.outliers import Outlier

START = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
TARGET = (0.1, 0.45, 0.1)  # [m]
# These are checked in tests/retargeting/test_retarget.py, where there is one.
OF_A_RETARGETING = {
    go.retargeting.Retargeting,
    go.retargeting.RetargetedArm,
    SynergyGroup,
}
# And these in test_reprs.py of execution, test_fit_markers_recording.py and test_fit_cost.py.
ALONE = {
    go.execution.Replay,
    CostFit,
    go.recordings.MarkerFit,
    go.recordings.MarkerSet,
}
ELSEWHERE = OF_A_RETARGETING | OF_EXECUTION | OF_RECORDINGS | OF_STUDIES | ALONE
ABSTRACT = {go.Metric, go.MotionProblem, go.Problem, go.ocp.MotionPhases}
NEEDS_A_NOTEBOOK = {go.drawing.LivePlot}


class ToRest(go.MotionProblem):
    """From any velocity to rest."""

    metric, duration = go.Euclidean(1), 1.0

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> list[tuple[ca.SX, float]]:
        return [(q0, 0.0), (q1, 1.0), (v1, 0.0)]


@pytest.mark.slow
def test_repr_of_every_public_value_is_short(
    arm: go.Model, bundled_analysis: go.synergies.Analysis
) -> None:
    obstacles = [
        go.Ball((0.2, 0.35, -0.15), 0.06, name="lamp"),
        go.Capsule((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), 0.1),
        go.Box((3.0, 0.0, 0.0), (0.1, 0.2, 0.3), name="shelf"),
        go.HalfSpace((0.0, 0.0, -3.0), (0.0, 0.0, 1.0), "floor"),
    ]
    metric, both = go.KineticEnergy(arm), go.model.combine(go.human_arm("left"), arm)
    reach = go.Reach(arm, START, TARGET, obstacles=obstacles)
    iterates: list[Iterate] = []
    solution = go.solve(
        reach, grid=go.Grid(4, 4), throw=False, callback=iterates.append, ipopt={"max_iter": 2}
    )
    with pytest.raises(go.NotConverged) as failure:
        go.solve(go.PointToPoint(metric, START, np.add(START, 0.1)), ipopt={"max_iter": 0})
    plane, rods = go.Euclidean(2), planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1))
    time = np.linspace(0.0, 1.0, 50)
    turn = go.Motion(time, np.outer(time, np.ones(7)), arm.joint_names)
    swing = go.Motion(time, np.outer(time - time**3, np.arange(7) / 7), arm.joint_names)
    metric_fit = go.fitting.fit_metric(
        go.trajectory.Recording(arm, swing.filtered()), segments=[[(0, 49)]]
    )
    live = go.retargeting.LiveRetargeting(arm, arm, START)
    values = [
        live,
        live.command,
        solution,
        solution.certificate,
        go.show(arm, open_browser=False),
        solution.violations,
        iterates[0],
        failure.value,
        failure.value.solution,
        reach.nlp(go.Grid(4, 4)),
        reach.definition(),
        go.PointToPoint(go.KineticEnergy(both), np.full(14, 1 / 3), np.ones(14), speed=np.pi),
        go.geodesic(plane, (0.0, 0.0), (1.0, 2.0)),
        go.cubic(plane, (0.0, 0.0), (1.0, 0.0), (1.0, 2.0), None, 0.5),
        go.cubic(plane, (0.0, 0.0), (1.0, 0.0), (1.0, 2.0), None, 0.5).certificate,
        go.solve(ToRest()),
        go.logarithm.geodesic_to_pose(rods, (0.2, 0.9), rods.hand_pose((0.3, 0.8))[1]),
        go.Path(go.KineticEnergy(both), go.Grid(1, 20), np.zeros((21, 14))),
        go.manifold.JacobiMetric(arm, 100.0),
        go.manifold.RegionAvoiding(go.KineticEnergy(both), margin=tuple(np.linspace(0.1, 0.4, 14))),
        go.Grid(64, 4, tuple(np.linspace(0.0, 1.0, 65))),
        go.Motion(np.linspace(0.0, 1.0, 500), np.zeros((500, 14)), both.joint_names),
        go.trajectory.Subject(1.8, 80.0, "somebody"),
        go.trajectory.time_law(0.1, 1.0, 1.0, 0.5, monotone=True),
        bundled_analysis,
        bundled_analysis.table(),
        go.retargeting.align(arm),
        go.retargeting.BasePlacement(
            go.retargeting.align(arm), np.zeros(3), 0.1, False, 1.0, 5, 5, 4, 1.0, 2.0
        ),
        go.model.robot_armature(arm),
        go.retargeting.reachability(arm, go.retargeting.align(arm), None, np.full((3, 3), 0.1)),
        go.retargeting.RetargetingSettings(
            obstacles=obstacles, pairs=[("right upper arm", "right hand")]
        ),
        go.GeodesicOcpError("an error"),
        go.IntegrationFailed("an error"),
        go.RecordingError("an error"),
        go.synergies.motion_errors(
            both, *2 * [go.Motion([0.0, 1.0], np.zeros((2, 14)), both.joint_names)]
        ),
        go.synergies.motion_errors(
            arm, *2 * [go.Motion([0.0, 1.0], np.zeros((2, 7)), arm.joint_names)]
        ),
        go.synergies.score(arm, *2 * [go.Motion([0.0, 1.0], np.eye(2, 7), arm.joint_names)]),
        go.studies.paired_test([1.0, 2.0, 3.0], [2.0, 2.5, 3.5]),
        go.studies.compare_methods(
            [go.trajectory.Recording(arm, turn.filtered())], {"lines": go.Euclidean(7)}
        ),
        go.synergies.optimal_segmentations(go.Euclidean(7), turn.filtered()),
        go.synergies.spline_knots(go.Euclidean(7), turn.filtered()),
        EqualNumbers(("wave",), ("lines",), np.ones(1), np.ones((1, 1, 1)), "rad"),
        go.studies.compare_metrics(arm, turn, {"lines": go.Euclidean(7)}, rules={}),
        go.fitting.Parameter("armature", 0.05, joints=("?S?_joint",)),
        go.manifold.AdjustableKineticEnergy(arm, joint_inertia=0.03, payload=0.5),
        metric_fit,
        go.fitting.error_profile(metric_fit, values=[0.02, 0.03]),
        go.fitting.ConfidenceInterval("armature", 0.02, 0.04, 0.95, "recording", 7),
        CrossValidation("recording", ("armature",), ()),
        go.trajectory.Recording(
            arm, go.Motion([0.0, 1.0], np.eye(2, 7), arm.joint_names, np.eye(2, 7))
        ),
        FitNoise(np.zeros((9, 7, 40))),
        go.trajectory.Column("elbow flexion", -1, "deg", 90.0),
        go.fitting.Heterogeneity("armature", 2, 9.0, 0.1, 0.9, ("a", 0.01), ("b", 0.04)),
        Outlier("spike", "RSx_joint", 0.2, 0.2, 1.0),
        go.synergies.Uncertainty(
            2, np.ones(3), np.ones(1), np.full(99, 2), *np.ones((3, 1)), np.ones((99, 3))
        ),
        go.synergies.reconstruct(
            plane, go.Motion([0.0, 0.1, 0.2], np.eye(3, 2), ("x", "y")).filtered(3, 1), [(0, 2)]
        ),
    ]
    covered = check_reprs(values)
    classes = {each for each in public_names().values() if inspect.isclass(each)}
    assert classes - covered - ELSEWHERE - ABSTRACT - NEEDS_A_NOTEBOOK == set()
