"""Values show themselves in a few lines, however many numbers they hold."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from known_models import planar_arm
from short_reprs import check_reprs

import geodesic_ocp as go

START = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
TARGET = (0.1, 0.45, 0.1)  # [m]
# These are checked in tests/retargeting/test_retarget.py, where there is one.
OF_A_RETARGETING = {go.Retargeting, go.RetargetedArm, go.SynergyGroup, go.SynergyPaths}
# And these in tests/execution/test_reprs.py.
OF_EXECUTION = {
    go.ArmPaths,
    go.Clearance,
    go.ClearanceReport,
    go.JointLimits,
    go.JointTrajectory,
    go.LinkPairs,
    go.MotionMeasures,
    go.PlannedTrajectory,
    go.Replay,
    go.TrajectoryCheck,
}
# These in tests/recordings/test_reprs.py and markers/test_fit_motion_recording.py.
OF_RECORDINGS = {
    go.AngleConvention,
    go.AxisRotation,
    go.FrameMotion,
    go.LostMarker,
    go.MarkerFit,
    go.Markers,
    go.MarkerSet,
    go.OsimConvention,
    go.SegmentOrientations,
    go.SegmentRelation,
    go.SkeletonConvention,
}
# These in tests/studies/test_reprs.py.
OF_STUDIES = {
    go.AnalysisSettings,
    go.BatchResult,
    go.RecordingOutcome,
    go.Study,
    go.StudyMean,
    go.StudyTest,
    go.SynergyStatistics,
}
ELSEWHERE = OF_A_RETARGETING | OF_EXECUTION | OF_RECORDINGS | OF_STUDIES
ABSTRACT = {go.Metric, go.Problem}
NEEDS_A_NOTEBOOK = {go.LivePlot}


@pytest.mark.slow
def test_repr_of_every_public_value_is_short(arm: go.Model, bundled_analysis: go.Analysis) -> None:
    obstacles = [
        go.Ball((0.2, 0.35, -0.15), 0.06, name="lamp"),
        go.Capsule((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), 0.1),
        go.HalfSpace((0.0, 0.0, -3.0), (0.0, 0.0, 1.0), "floor"),
    ]
    metric, both = go.KineticEnergy(arm), go.combine(go.human_arm("left"), arm)
    reach = go.Reach(arm, START, TARGET, obstacles=obstacles)
    iterates: list[go.Iterate] = []
    solution = go.solve(
        reach, grid=go.Grid(4, 4), throw=False, callback=iterates.append, ipopt={"max_iter": 2}
    )
    with pytest.raises(go.NotConverged) as failure:
        go.solve(go.PointToPoint(metric, START, np.add(START, 0.1)), ipopt={"max_iter": 0})
    plane, rods = go.Euclidean(2), planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1))
    time = np.linspace(0.0, 1.0, 50)
    turn = go.Motion(time, np.outer(time, np.ones(7)), arm.joint_names)
    swing = go.Motion(time, np.outer(time - time**3, np.arange(7) / 7), arm.joint_names)
    metric_fit = go.fit_metric(go.Recording(arm, swing.filtered()), segments=[[(0, 49)]])
    values = [
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
        go.geodesic_to_pose(rods, (0.2, 0.9), rods.hand_pose((0.3, 0.8))[1]),
        go.Path(go.KineticEnergy(both), go.Grid(1, 20), np.zeros((21, 14))),
        go.JacobiMetric(arm, 100.0),
        go.RegionAvoiding(go.KineticEnergy(both), margin=tuple(np.linspace(0.1, 0.4, 14))),
        go.Grid(64, 4, tuple(np.linspace(0.0, 1.0, 65))),
        go.Motion(np.linspace(0.0, 1.0, 500), np.zeros((500, 14)), both.joint_names),
        go.Subject(1.8, 80.0, "somebody"),
        go.time_law(1.0, 1.0, 0.0, 0.0, max_speed=1.2),
        bundled_analysis,
        bundled_analysis.table(),
        go.alignment(arm),
        go.robot_armature(arm),
        go.reachability(arm, go.alignment(arm), None, np.full((3, 3), 0.1)),
        go.RetargetingSettings(obstacles=obstacles, pairs=[("right upper arm", "right hand")]),
        go.GeodesicOcpError("an error"),
        go.IntegrationFailed("an error"),
        go.RecordingError("an error"),
        go.evaluate(both, *2 * [go.Motion([0.0, 1.0], np.zeros((2, 14)), both.joint_names)]),
        go.evaluate(arm, *2 * [go.Motion([0.0, 1.0], np.zeros((2, 7)), arm.joint_names)]),
        go.score(arm, *2 * [go.Motion([0.0, 1.0], np.eye(2, 7), arm.joint_names)]),
        go.paired_test([1.0, 2.0, 3.0], [2.0, 2.5, 3.5]),
        go.compare_methods([go.Recording(arm, turn.filtered())], {"lines": go.Euclidean(7)}),
        go.optimal_segmentations(go.Euclidean(7), turn.filtered()),
        go.compare_metrics(arm, turn, {"lines": go.Euclidean(7)}, thresholds=[]),
        go.Parameter("armature", 0.05, joints=("?S?_joint",)),
        go.AdjustableKineticEnergy(arm, joint_inertia=0.03, payload=0.5),
        metric_fit,
        go.error_profile(metric_fit, values=[0.02, 0.03]),
        go.ConfidenceInterval("armature", 0.02, 0.04, 0.95, "recording", 7),
        go.CrossValidation("recording", ("armature",), ()),
        go.Recording(arm, go.Motion([0.0, 1.0], np.eye(2, 7), arm.joint_names, np.eye(2, 7))),
        go.reconstruct(
            plane, go.Motion([0.0, 0.1, 0.2], np.eye(3, 2), ("x", "y")).filtered(3, 1), [(0, 2)]
        ),
    ]
    covered = check_reprs(values)
    public = {getattr(go, name) for name in go.__all__}
    classes = {each for each in public if inspect.isclass(each)}
    assert classes - covered - ELSEWHERE - ABSTRACT - NEEDS_A_NOTEBOOK == set()
