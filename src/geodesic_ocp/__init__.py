"""Geodesics of mechanical systems, and human motion seen as sequences of them."""

from importlib.metadata import version as _version

from geodesic_ocp.analysis import Analysis, analyse
from geodesic_ocp.errors import (
    GeodesicOcpError,
    IntegrationFailed,
    NotConverged,
    RecordingError,
)
from geodesic_ocp.manifold.curvature import (
    riemann_curvature,
    scalar_curvature,
    sectional_curvature,
)
from geodesic_ocp.manifold.exponential import exp
from geodesic_ocp.manifold.jacobi import Jacobi
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.manifold.metric import Euclidean, Metric
from geodesic_ocp.manifold.region_avoiding import RegionAvoiding
from geodesic_ocp.manifold.transport import parallel_transport
from geodesic_ocp.model.alignment import Alignment, alignment
from geodesic_ocp.model.bodies import Ball, Capsule, HalfSpace, enclosing_capsule
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.distance import clearances, separate_pairs
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.library import load_model
from geodesic_ocp.model.model import Model
from geodesic_ocp.motion.archive import load_synergies, save_synergies
from geodesic_ocp.motion.baselines import track_hand
from geodesic_ocp.motion.evaluation import Errors, evaluate
from geodesic_ocp.motion.merging import SynergyGroup, merge_synergies
from geodesic_ocp.motion.readers import read_motion
from geodesic_ocp.motion.segmentation import segment, segment_zero_velocity
from geodesic_ocp.motion.synergies import Reconstruction, Synergy, reconstruct
from geodesic_ocp.ocp.archive import save_solution
from geodesic_ocp.ocp.callback import Iterate
from geodesic_ocp.ocp.certificate import Certificate, certify
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.live import LivePlot
from geodesic_ocp.ocp.loading import load_solution
from geodesic_ocp.ocp.logarithm import Geodesic, distance, geodesic, geodesics, log, shoot
from geodesic_ocp.ocp.mean import mean
from geodesic_ocp.ocp.nlp import NLP
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.picture import draw_obstacle
from geodesic_ocp.ocp.point_to_point import PointToPoint
from geodesic_ocp.ocp.posture import find_posture
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.reach import Reach
from geodesic_ocp.ocp.restricted import avoid
from geodesic_ocp.ocp.solution import Solution, Stats
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.ocp.timing import TimeLaw, time_law
from geodesic_ocp.ocp.to_pose import ToPose, geodesic_to_pose
from geodesic_ocp.report import report
from geodesic_ocp.retargeted import Retargeting
from geodesic_ocp.retargeted_arm import RetargetedArm
from geodesic_ocp.retargeting import retarget
from geodesic_ocp.sampled import Motion, Subject
from geodesic_ocp.table import Table

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
