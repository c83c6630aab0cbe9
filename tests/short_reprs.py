"""The check that `repr` of a value, and of every value of this package inside it, is short."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from repr_size import CHARACTERS, LINES

import geodesic_ocp as go
from geodesic_ocp.execution.link_pairs import LinkPairs
from geodesic_ocp.execution.trajectory_clearance import ClearanceReport
from geodesic_ocp.recordings.markers.marker_fit import LostMarker
from geodesic_ocp.trajectory.motion import FrameMotion

# Public values that are checked in test_reprs.py of their folders, and not in tests/test_repr.py.
OF_EXECUTION = {
    go.execution.ArmPaths,
    go.execution.Clearance,
    ClearanceReport,
    go.execution.JointLimits,
    go.trajectory.JointTrajectory,
    LinkPairs,
    go.execution.MotionMeasures,
    go.execution.PlannedTrajectory,
    go.execution.TrajectoryCheck,
}
OF_RECORDINGS = {
    go.recordings.AngleConvention,
    go.recordings.AxisRotation,
    FrameMotion,
    LostMarker,
    go.recordings.Markers,
    go.recordings.OsimConvention,
    go.recordings.SegmentOrientations,
    go.recordings.SegmentRelation,
    go.recordings.SkeletonConvention,
}
OF_STUDIES = {
    go.studies.AnalysisSettings,
    go.studies.BatchResult,
    go.studies.RecordingOutcome,
    go.studies.StudyResult,
}


def check_reprs(values: Iterable[Any]) -> set[type]:
    """Classes of the values, their fields and elements; the repr of each is short."""
    seen: dict[int, Any] = {}
    remaining, too_long = list(values), {}
    while remaining:
        value = remaining.pop()
        if id(value) in seen:
            continue
        seen[id(value)] = value
        if isinstance(value, (list, tuple)):
            remaining += value
        elif isinstance(value, Mapping):
            remaining += value.values()
        elif type(value).__module__.startswith(go.__name__):
            shown = "" if type(value).__name__.startswith("_") else repr(value)
            if len(shown) > CHARACTERS or len(shown.splitlines()) > LINES:
                too_long[type(value).__name__] = shown[:CHARACTERS]
            if is_dataclass(value):
                remaining += [getattr(value, each.name) for each in fields(value)]
    assert not too_long, "\n".join(f"{name}: {shown}" for name, shown in too_long.items())
    return {type(value) for value in seen.values()}
