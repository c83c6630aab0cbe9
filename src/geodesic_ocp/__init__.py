"""Geodesics of mechanical systems, and human motion seen as sequences of them."""

from importlib.metadata import version as _version

from geodesic_ocp.errors import (
    GeodesicOcpError,
    IntegrationFailed,
    NotConverged,
    RecordingError,
)
from geodesic_ocp.figures.path_figure import draw_obstacle
from geodesic_ocp.geodesics.frechet_mean import mean
from geodesic_ocp.geodesics.geodesic_to_pose import ToPose, geodesic_to_pose
from geodesic_ocp.geodesics.log import Geodesic, distance, geodesic, geodesics, log, shoot
from geodesic_ocp.manifold.curvature import (
    riemann_curvature,
    scalar_curvature,
    sectional_curvature,
)
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.jacobi_metric import Jacobi
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.manifold.metric import Euclidean, Metric
from geodesic_ocp.manifold.parallel_transport import parallel_transport
from geodesic_ocp.manifold.region_avoiding import RegionAvoiding
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.geometry.signed_distances import clearances, separate_pairs
from geodesic_ocp.model.human_arm import human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Capsule, HalfSpace, enclosing_capsule
from geodesic_ocp.ocp.ik.inverse_kinematics import find_posture
from geodesic_ocp.ocp.nlp.nlp import NLP
from geodesic_ocp.ocp.problem.path_constraints import avoid
from geodesic_ocp.ocp.problem.point_to_point import PointToPoint
from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.problem.reach import Reach
from geodesic_ocp.ocp.solve.callback import Iterate
from geodesic_ocp.ocp.solve.certificate import Certificate, certify
from geodesic_ocp.ocp.solve.live_plot import LivePlot
from geodesic_ocp.ocp.solve.load_solution import load_solution
from geodesic_ocp.ocp.solve.save_solution import save_solution
from geodesic_ocp.ocp.solve.solution import Solution, Stats
from geodesic_ocp.ocp.solve.solve import solve
from geodesic_ocp.report.report import report
from geodesic_ocp.retargeting.alignment import Alignment, alignment
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.retargeting.retarget import retarget
from geodesic_ocp.synergies.analyse import Analysis, analyse
from geodesic_ocp.synergies.evaluate import Errors, evaluate
from geodesic_ocp.synergies.files import load_synergies, save_synergies
from geodesic_ocp.synergies.read_motion import read_motion
from geodesic_ocp.synergies.reconstruct import Reconstruction, Synergy, reconstruct
from geodesic_ocp.synergies.segment import segment, segment_zero_velocity
from geodesic_ocp.synergies.track_hand import track_hand
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import Motion, Subject
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw, time_law

__version__ = _version("geodesic_ocp")

__all__ = [
    "NLP",
    "Alignment",
    "Analysis",
    "Ball",
    "Capsule",
    "Certificate",
    "Errors",
    "Euclidean",
    "Geodesic",
    "GeodesicOcpError",
    "Grid",
    "HalfSpace",
    "IntegrationFailed",
    "Iterate",
    "Jacobi",
    "KineticEnergy",
    "LivePlot",
    "Metric",
    "Model",
    "Motion",
    "NotConverged",
    "Path",
    "PointToPoint",
    "Problem",
    "Reach",
    "Reconstruction",
    "RecordingError",
    "RegionAvoiding",
    "RetargetedArm",
    "Retargeting",
    "Solution",
    "Stats",
    "Subject",
    "Synergy",
    "SynergyGroup",
    "Table",
    "TimeLaw",
    "ToPose",
    "alignment",
    "analyse",
    "avoid",
    "certify",
    "clearances",
    "combine",
    "distance",
    "draw_obstacle",
    "enclosing_capsule",
    "evaluate",
    "exp",
    "find_posture",
    "geodesic",
    "geodesic_to_pose",
    "geodesics",
    "human_arm",
    "load_model",
    "load_solution",
    "load_synergies",
    "log",
    "mean",
    "merge_synergies",
    "parallel_transport",
    "read_motion",
    "reconstruct",
    "report",
    "retarget",
    "riemann_curvature",
    "save_solution",
    "save_synergies",
    "scalar_curvature",
    "sectional_curvature",
    "segment",
    "segment_zero_velocity",
    "separate_pairs",
    "shoot",
    "solve",
    "time_law",
    "track_hand",
]
