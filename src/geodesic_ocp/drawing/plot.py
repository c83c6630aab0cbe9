"""plot: a figure of any result, by its type."""

from __future__ import annotations

from functools import singledispatch
from inspect import signature
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from geodesic_ocp.drawing.analysis_figure import analysis_figure
from geodesic_ocp.drawing.comparison_figure import comparison_figure
from geodesic_ocp.drawing.over_time import (
    markers_figure,
    motion_figure,
    replay_figure,
    timed_figure,
    trajectory_figure,
)
from geodesic_ocp.drawing.path_figure import path_figure, solution_figure
from geodesic_ocp.drawing.profile_figure import profiles_figure
from geodesic_ocp.drawing.retargeting_figure import retargeting_figure
from geodesic_ocp.drawing.study_figures import study_figure
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.fitting.error_profile import ErrorProfile
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.studies.compare_metrics import MetricComparison
from geodesic_ocp.studies.study_result import StudyResult
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.synergy import Reconstruction, Synergy
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.recording import Recording
from geodesic_ocp.trajectory.timed_motion import TimedMotion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DOTS = 150.0  # [1/inch] of pictures, about those of a screen at twice the size


def plot(result: object, /, *, file: str | PathLike[str] | None = None, **options: Any) -> Figure:
    """Return a figure of a result: of a path, a motion, an analysis, a study, ...

    >>> path = go.geodesic(go.Euclidean(2), [0.0, 0.0], [1.0, 0.5])
    >>> go.plot(path).axes[0].get_xlabel()
    'path parameter s'

    Args:
        result: a `Path`, `Geodesic`, `Solution` or `ToPose`; a `Motion`, `Recording`,
            `JointTrajectory`, `PlannedTrajectory`, `MotionSolution`, `RiemannianSpline`, `Replay`,
            `Synergy`, `Reconstruction`, `Markers` or `MarkerFit`; an `Analysis`, `MetricComparison`
            or `ErrorProfile`; a `StudyResult` or `Retargeting`.
        file: is written as well; its suffix says what it is, such as .pdf, .png or .svg.
        options: of an analysis: `curve`, a `MetricComparison` (or a function of axes) that is drawn
            into a panel of its own, and `uncertainty`, an `Uncertainty` that tells stable cuts from
            doubtful ones.

    Returns:
        A figure of Matplotlib, which a notebook displays.

    Raises:
        TypeError: there is no figure of such a result, or it has no such option.
        OSError: the file cannot be written.
    """
    function = _figure.dispatch(type(result))
    known = list(signature(function).parameters)[1:]
    if unknown := sorted(set(options).difference(known)):
        allowed = f"; it has {', '.join(known)}" if known else ""
        kind = type(result).__name__
        raise TypeError(f"a figure of {kind} has no option {', '.join(unknown)}{allowed}")
    figure: Figure = function(result, **options)
    if file is not None:
        figure.savefig(FilePath(file), dpi=_DOTS)
    return figure


@singledispatch
def _figure(result: object) -> Figure:
    """Return the figure of one result."""
    name = type(result).__name__
    if isinstance(result, str | PathLike):
        hint = "read the file first, as by go.read_recording or go.ocp.load_solution"
    elif isinstance(result, Problem):
        hint = "solve the problem first, and plot its solution"
    else:
        kinds = ", ".join(each.__name__ for each in _figure.registry if each is not object)
        hint = f"there are figures of {kinds}"
    raise TypeError(f"there is no figure of {name}: {hint}")


_figure.register(Path, path_figure)
_figure.register(Solution, solution_figure)
_figure.register(Motion, motion_figure)
_figure.register(JointTrajectory, trajectory_figure)
_figure.register(TimedMotion, timed_figure)
_figure.register(Markers, markers_figure)
_figure.register(Replay, replay_figure)
_figure.register(Analysis, analysis_figure)
_figure.register(MetricComparison, comparison_figure)
_figure.register(StudyResult, study_figure)
_figure.register(Retargeting, retargeting_figure)


@_figure.register(ToPose)
def _(result: ToPose) -> Figure:
    if result.path is None:
        raise ValueError(f"there is no path to be drawn: {result.status}")
    return path_figure(result.path)


@_figure.register(ErrorProfile)
def _(result: ErrorProfile) -> Figure:
    return profiles_figure([result])


@_figure.register(Synergy)
def _(result: Synergy) -> Figure:
    return path_figure(result.path)


@_figure.register(Recording)
def _(result: Recording) -> Figure:
    return motion_figure(result.motion)


@_figure.register(MarkerFit)
def _(result: MarkerFit) -> Figure:
    return motion_figure(result.motion)


@_figure.register(Reconstruction)
def _(result: Reconstruction) -> Figure:
    return motion_figure(result.predicted)


@_figure.register(PlannedTrajectory)
def _(result: PlannedTrajectory) -> Figure:
    return trajectory_figure(result.sampled(100.0))
