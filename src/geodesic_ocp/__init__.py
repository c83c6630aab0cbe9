"""Geodesics of mechanical systems, and human motion seen as sequences of them.

Importing the package is quick: each name is imported from its module when it is first used.
"""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING

__all__ = [
    "NLP",
    "AdjustableKineticEnergy",
    "Alignment",
    "Analysis",
    "AnalysisSettings",
    "AngleConvention",
    "ArmPaths",
    "AxisRotation",
    "Ball",
    "BatchResult",
    "Capsule",
    "Certificate",
    "Clearance",
    "ClearanceReport",
    "ConfidenceInterval",
    "CrossValidation",
    "ErrorProfile",
    "Estimate",
    "Euclidean",
    "FrameMotion",
    "Geodesic",
    "GeodesicOcpError",
    "Grid",
    "HalfSpace",
    "HandErrors",
    "IntegrationFailed",
    "Iterate",
    "JacobiMetric",
    "JointLimits",
    "JointTrajectory",
    "KineticEnergy",
    "LinkPairs",
    "LivePlot",
    "LostMarker",
    "MarkerFit",
    "MarkerSet",
    "Markers",
    "MethodComparison",
    "Metric",
    "MetricComparison",
    "MetricFit",
    "Model",
    "Motion",
    "MotionErrors",
    "MotionFilter",
    "MotionMeasures",
    "NotConverged",
    "OptimalSegmentations",
    "OsimConvention",
    "PairedTest",
    "Parameter",
    "Path",
    "PlannedTrajectory",
    "PointToPoint",
    "Problem",
    "Reach",
    "Reachability",
    "Reconstruction",
    "Recording",
    "RecordingError",
    "RecordingOutcome",
    "RegionAvoiding",
    "Replay",
    "RetargetedArm",
    "Retargeting",
    "RetargetingSettings",
    "RobotArmature",
    "Scores",
    "SegmentOrientations",
    "SegmentRelation",
    "SkeletonConvention",
    "Solution",
    "Stats",
    "Study",
    "StudyMean",
    "StudyTest",
    "Subject",
    "Synergy",
    "SynergyGroup",
    "SynergyPaths",
    "SynergyStatistics",
    "Table",
    "TimeLaw",
    "ToPose",
    "TrajectoryCheck",
    "Viewer",
    "alignment",
    "analyse",
    "analyse_recordings",
    "bootstrap_fit",
    "certify",
    "check_trajectory",
    "clearance_constraint",
    "clearance_constraints",
    "collision_pairs",
    "combine",
    "compare_methods",
    "compare_metrics",
    "compare_with_tracking",
    "default_joint_inertia",
    "distal_inertia",
    "distance",
    "draw_obstacle",
    "enclosing_capsule",
    "error_profile",
    "evaluate",
    "exp",
    "fit_metric",
    "fit_motion",
    "frechet_mean",
    "geodesic",
    "geodesic_from_velocity",
    "geodesic_to_pose",
    "geodesics",
    "human_arm",
    "human_upper_body",
    "inverse_kinematics",
    "joint_angles",
    "joint_limits",
    "leave_one_out",
    "link_pairs",
    "load_metric",
    "load_model",
    "load_solution",
    "load_synergies",
    "log",
    "merge_synergies",
    "minimum_acceleration",
    "minimum_jerk",
    "minimum_jerk_hand",
    "motion_measures",
    "optimal_segmentations",
    "paired_test",
    "parallel_transport",
    "plan_trajectory",
    "propose_alignment",
    "reachability",
    "read_alignment",
    "read_markers",
    "read_motion",
    "read_recording",
    "read_recordings",
    "read_trajectory",
    "reconstruct",
    "replay",
    "report",
    "retarget",
    "retarget_arms",
    "riemann_curvature",
    "robot_armature",
    "save_metric",
    "save_motion",
    "save_synergies",
    "scalar_curvature",
    "score",
    "sectional_curvature",
    "segment",
    "segment_optimal",
    "segment_zero_velocity",
    "separate_fits",
    "show",
    "signed_distances",
    "solve",
    "study",
    "time_law",
    "track_hand",
    "track_within_limits",
    "trajectory_clearance",
    "with_rotor_inertia",
]

if TYPE_CHECKING:  # what type checkers and editors see; _HOMES gives the same names
    from geodesic_ocp.errors import (
        GeodesicOcpError,
        IntegrationFailed,
        NotConverged,
        RecordingError,
    )
    from geodesic_ocp.execution.arm_paths import ArmPaths
    from geodesic_ocp.execution.check_trajectory import TrajectoryCheck, check_trajectory
    from geodesic_ocp.execution.clearance import Clearance, clearance_constraint
    from geodesic_ocp.execution.limits import JointLimits, joint_limits
    from geodesic_ocp.execution.link_pairs import LinkPairs, link_pairs
    from geodesic_ocp.execution.motion_measures import (
        MotionMeasures,
        compare_with_tracking,
        motion_measures,
    )
    from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory, plan_trajectory
    from geodesic_ocp.execution.replay import Replay, replay
    from geodesic_ocp.execution.track_within_limits import track_within_limits
    from geodesic_ocp.execution.trajectory_clearance import ClearanceReport, trajectory_clearance
    from geodesic_ocp.figures.obstacles import draw_obstacle
    from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
    from geodesic_ocp.fitting.fit_metric import fit_metric
    from geodesic_ocp.fitting.metric_fit import (
        ConfidenceInterval,
        Estimate,
        MetricFit,
        load_metric,
        save_metric,
    )
    from geodesic_ocp.fitting.parameter import Parameter
    from geodesic_ocp.fitting.resampling import (
        CrossValidation,
        bootstrap_fit,
        leave_one_out,
        separate_fits,
    )
    from geodesic_ocp.logarithm.geodesic import (
        Geodesic,
        geodesic,
        geodesic_from_velocity,
        geodesics,
    )
    from geodesic_ocp.logarithm.geodesic_to_pose import ToPose, geodesic_to_pose
    from geodesic_ocp.logarithm.log import distance, frechet_mean, log
    from geodesic_ocp.manifold.connection import (
        parallel_transport,
        riemann_curvature,
        scalar_curvature,
        sectional_curvature,
    )
    from geodesic_ocp.manifold.exp import exp
    from geodesic_ocp.manifold.metric import Metric
    from geodesic_ocp.manifold.metrics import (
        AdjustableKineticEnergy,
        Euclidean,
        JacobiMetric,
        KineticEnergy,
        default_joint_inertia,
    )
    from geodesic_ocp.manifold.region_avoiding import RegionAvoiding
    from geodesic_ocp.model.combine import combine
    from geodesic_ocp.model.distances import collision_pairs, signed_distances
    from geodesic_ocp.model.formats.load_model import load_model
    from geodesic_ocp.model.human import human_arm, human_upper_body
    from geodesic_ocp.model.inertias import (
        RobotArmature,
        robot_armature,
        with_rotor_inertia,
    )
    from geodesic_ocp.model.link_geometry import enclosing_capsule
    from geodesic_ocp.model.model import Model
    from geodesic_ocp.model.primitives import Ball, Capsule, HalfSpace
    from geodesic_ocp.ocp.callback import Iterate, LivePlot
    from geodesic_ocp.ocp.certificate import Certificate, certify
    from geodesic_ocp.ocp.inverse_kinematics import inverse_kinematics
    from geodesic_ocp.ocp.load_solution import load_solution
    from geodesic_ocp.ocp.nlp import NLP
    from geodesic_ocp.ocp.problem import Problem
    from geodesic_ocp.ocp.problems import PointToPoint, Reach, clearance_constraints
    from geodesic_ocp.ocp.solution import Solution, Stats
    from geodesic_ocp.ocp.solve import solve
    from geodesic_ocp.recordings.conventions.angle_convention import (
        AngleConvention,
        AxisRotation,
        SegmentRelation,
    )
    from geodesic_ocp.recordings.conventions.joint_angles import joint_angles
    from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention
    from geodesic_ocp.recordings.conventions.segment_orientations import SegmentOrientations
    from geodesic_ocp.recordings.conventions.skeleton_convention import SkeletonConvention
    from geodesic_ocp.recordings.formats.csv_table import save_motion
    from geodesic_ocp.recordings.markers.fit_motion import fit_motion
    from geodesic_ocp.recordings.markers.marker_fit import LostMarker, MarkerFit
    from geodesic_ocp.recordings.markers.marker_set import MarkerSet
    from geodesic_ocp.recordings.markers.markers import Markers
    from geodesic_ocp.recordings.read_markers import read_markers
    from geodesic_ocp.recordings.read_recording import read_motion, read_recording
    from geodesic_ocp.recordings.read_recordings import read_recordings
    from geodesic_ocp.recordings.recording import Recording
    from geodesic_ocp.retargeting.alignment.alignment import (
        alignment,
        propose_alignment,
        read_alignment,
    )
    from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
    from geodesic_ocp.retargeting.arm_result import RetargetedArm
    from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
    from geodesic_ocp.retargeting.reachability import Reachability, reachability
    from geodesic_ocp.retargeting.result import Retargeting
    from geodesic_ocp.retargeting.retarget import retarget, retarget_arms
    from geodesic_ocp.retargeting.settings import RetargetingSettings
    from geodesic_ocp.retargeting.synergy_paths import SynergyPaths
    from geodesic_ocp.studies.analyse_recordings import BatchResult, analyse_recordings
    from geodesic_ocp.studies.analysis_settings import AnalysisSettings
    from geodesic_ocp.studies.compare_methods import MethodComparison, compare_methods
    from geodesic_ocp.studies.compare_metrics import MetricComparison, compare_metrics
    from geodesic_ocp.studies.paired_test import PairedTest, paired_test
    from geodesic_ocp.studies.result_files import RecordingOutcome
    from geodesic_ocp.studies.statistics import StudyMean, StudyTest, SynergyStatistics
    from geodesic_ocp.studies.study import Study, study
    from geodesic_ocp.synergies.analyse import Analysis, analyse
    from geodesic_ocp.synergies.baselines import (
        distal_inertia,
        minimum_acceleration,
        minimum_jerk,
        minimum_jerk_hand,
        track_hand,
    )
    from geodesic_ocp.synergies.optimal_segmentations import (
        OptimalSegmentations,
        optimal_segmentations,
        segment_optimal,
    )
    from geodesic_ocp.synergies.scores import HandErrors, MotionErrors, Scores, evaluate, score
    from geodesic_ocp.synergies.segment import segment, segment_zero_velocity
    from geodesic_ocp.synergies.synergy import (
        Reconstruction,
        Synergy,
        load_synergies,
        reconstruct,
        save_synergies,
    )
    from geodesic_ocp.table import Table
    from geodesic_ocp.trajectory.filters import MotionFilter
    from geodesic_ocp.trajectory.grid import Grid
    from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
    from geodesic_ocp.trajectory.motion import FrameMotion, Motion, Subject
    from geodesic_ocp.trajectory.path import Path
    from geodesic_ocp.trajectory.read_trajectory import read_trajectory
    from geodesic_ocp.trajectory.time_law import TimeLaw, time_law
    from geodesic_ocp.viewer.report import report
    from geodesic_ocp.viewer.viewer import Viewer, show

    __version__: str
else:
    # Public names by the module that defines them (PEP 562).
    _HOMES = {
        "viewer.viewer": "show Viewer",
        "model.inertias": "RobotArmature robot_armature with_rotor_inertia",
        "trajectory.read_trajectory": "read_trajectory",
        "trajectory.joint_trajectory": "JointTrajectory",
        "execution.track_within_limits": "track_within_limits",
        "execution.motion_measures": "MotionMeasures motion_measures compare_with_tracking",
        "execution.replay": "Replay replay",
        "execution.trajectory_clearance": "trajectory_clearance ClearanceReport",
        "execution.link_pairs": "LinkPairs link_pairs",
        "execution.clearance": "clearance_constraint Clearance",
        "execution.check_trajectory": "TrajectoryCheck check_trajectory",
        "execution.plan_trajectory": "PlannedTrajectory plan_trajectory",
        "execution.limits": "JointLimits joint_limits",
        "execution.arm_paths": "ArmPaths",
        "errors": "GeodesicOcpError IntegrationFailed NotConverged RecordingError",
        "figures.obstacles": "draw_obstacle",
        "manifold.metrics": (
            "AdjustableKineticEnergy Euclidean JacobiMetric KineticEnergy default_joint_inertia "
        ),
        "fitting.metric_fit": "Estimate ConfidenceInterval MetricFit load_metric save_metric",
        "fitting.parameter": "Parameter",
        "fitting.resampling": "separate_fits bootstrap_fit CrossValidation leave_one_out",
        "fitting.fit_metric": "fit_metric",
        "fitting.error_profile": "ErrorProfile error_profile",
        "logarithm.log": "frechet_mean distance log",
        "logarithm.geodesic": "Geodesic geodesic geodesic_from_velocity geodesics",
        "logarithm.geodesic_to_pose": "ToPose geodesic_to_pose",
        "manifold.connection": (
            "riemann_curvature scalar_curvature sectional_curvature parallel_transport "
        ),
        "manifold.exp": "exp",
        "manifold.metric": "Metric",
        "manifold.region_avoiding": "RegionAvoiding",
        "model.combine": "combine",
        "model.formats.load_model": "load_model",
        "model.link_geometry": "enclosing_capsule",
        "model.distances": "collision_pairs signed_distances",
        "model.human": "human_arm human_upper_body",
        "model.model": "Model",
        "ocp.inverse_kinematics": "inverse_kinematics",
        "ocp.nlp": "NLP",
        "ocp.problems": "clearance_constraints PointToPoint Reach",
        "ocp.problem": "Problem",
        "ocp.callback": "Iterate LivePlot",
        "ocp.certificate": "Certificate certify",
        "ocp.load_solution": "load_solution",
        "ocp.solution": "Solution Stats",
        "ocp.solve": "solve",
        "viewer.report": "report",
        "retargeting.alignment.alignment": "alignment propose_alignment read_alignment",
        "retargeting.alignment.arm_alignment": "Alignment",
        "retargeting.arm_result": "RetargetedArm",
        "retargeting.merge_synergies": "SynergyGroup merge_synergies",
        "retargeting.reachability": "Reachability reachability",
        "retargeting.result": "Retargeting",
        "retargeting.retarget": "retarget retarget_arms",
        "retargeting.settings": "RetargetingSettings",
        "retargeting.synergy_paths": "SynergyPaths",
        "synergies.analyse": "analyse Analysis",
        "synergies.scores": "HandErrors MotionErrors evaluate Scores score",
        "recordings.read_recording": "read_motion read_recording",
        "synergies.synergy": "Reconstruction reconstruct Synergy load_synergies save_synergies",
        "synergies.optimal_segmentations": (
            "OptimalSegmentations optimal_segmentations segment_optimal "
        ),
        "synergies.segment": "segment segment_zero_velocity",
        "synergies.baselines": (
            "track_hand minimum_acceleration minimum_jerk minimum_jerk_hand distal_inertia "
        ),
        "recordings.conventions.osim_convention": "OsimConvention",
        "recordings.recording": "Recording",
        "recordings.read_recordings": "read_recordings",
        "studies.compare_methods": "compare_methods MethodComparison",
        "studies.compare_metrics": "compare_metrics MetricComparison",
        "studies.paired_test": "PairedTest paired_test",
        "recordings.conventions.angle_convention": (
            "AngleConvention AxisRotation SegmentRelation "
        ),
        "recordings.conventions.segment_orientations": "SegmentOrientations",
        "recordings.conventions.joint_angles": "joint_angles",
        "recordings.conventions.skeleton_convention": "SkeletonConvention",
        "recordings.markers.markers": "Markers",
        "recordings.read_markers": "read_markers",
        "recordings.markers.marker_set": "MarkerSet",
        "recordings.markers.marker_fit": "MarkerFit LostMarker",
        "recordings.markers.fit_motion": "fit_motion",
        "trajectory.motion": "FrameMotion Motion Subject",
        "studies.analyse_recordings": "analyse_recordings BatchResult",
        "studies.analysis_settings": "AnalysisSettings",
        "studies.result_files": "RecordingOutcome",
        "studies.study": "study Study",
        "studies.statistics": "StudyMean StudyTest SynergyStatistics",
        "recordings.formats.csv_table": "save_motion",
        "table": "Table",
        "trajectory.grid": "Grid",
        "trajectory.filters": "MotionFilter",
        "trajectory.path": "Path",
        "trajectory.time_law": "TimeLaw time_law",
        "model.primitives": "Ball Capsule HalfSpace",
    }
    _MODULES = {name: module for module, names in _HOMES.items() for name in names.split()}

    def __getattr__(name):
        """Import a public name when it is first used."""
        if name == "__version__":
            value = _import_module("importlib.metadata").version(__name__)
        elif name in _MODULES:
            value = getattr(_import_module(f"{__name__}.{_MODULES[name]}"), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__():
        return [*__all__, "__version__"]
