"""Options that several commands share, as annotated types; most are fields of settings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from cyclopts import Parameter

from geodesic_ocp.execution.limits import QUANTITIES, JointLimits, joint_limits
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.recording_settings import RecordingSettings
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings

Flag = Annotated[bool, Parameter(negative="", show_default=False)]


@dataclass(frozen=True)
class GivenLimits:
    """Limits of a robot's joints in place of the file's, the published or the derived limits.

    Attributes:
        velocity: largest speed [rad/s or m/s] of all joints, or JOINT=LIMIT of one; repeatable.
        acceleration: largest acceleration [rad/s^2 or m/s^2], likewise.
        jerk: largest jerk [rad/s^3 or m/s^3], likewise.
        torque: largest torque [N m or N], likewise.
    """

    velocity: Sequence[str] | None = None
    acceleration: Sequence[str] | None = None
    jerk: Sequence[str] | None = None
    torque: Sequence[str] | None = None

    def of_robots(self, robots: Sequence[Model]) -> list[JointLimits]:
        """Return the limits of each robot: the given ones, else as `joint_limits` finds them.

        Raises:
            ValueError: an option is not a number, or names an unknown joint.
        """
        given = {name: _limit(name, getattr(self, name)) for name in QUANTITIES}
        return [joint_limits(robot, **given) for robot in robots]


def _limit(name: str, values: Sequence[str] | None) -> float | dict[str, float] | None:
    """Return one number for all joints, or numbers by joint."""
    by_joint: dict[str, float] = {}
    for value in values or ():
        joint, _, number = value.rpartition("=")
        try:
            limit = float(number)
        except ValueError:
            raise ValueError(f"--{name} {value}: must be LIMIT or JOINT=LIMIT") from None
        if not joint and len(values or ()) > 1:
            raise ValueError(f"--{name}: several limits must be JOINT=LIMIT each, got {value}")
        if not joint:
            return limit
        by_joint[joint] = limit
    return by_joint or None


@dataclass(frozen=True)
class ManyRecordings:
    """Options of the analysis of many recordings.

    Attributes:
        jobs: number of processes; default: one for each core.
        scheduler: address of a Dask cluster, such as tcp://host:8786, whose workers see the same
            files; needs the extra cluster.
        recursive: also take files in the folders within a folder, except results of analyses.
        subjects: CSV with the columns file and subject, and if known trial, height [m] and mass
            [kg].
        subject_from: pattern of the paths without their suffix, such as `{subject}/{trial}` or
            `{subject}_*_{trial}`; default: the subject in the file, or the name of its folder.
        time_limit: time after which a recording is left out [s]; not with --scheduler.
        study: also fit the joint inertia of every subject, and write the statistics over subjects
            (see `geodesic-ocp study`) to the folder study of the results.
        tables_only: only write the tables from the results so far, also while another run works.
    """

    jobs: int | None = None
    scheduler: str | None = None
    recursive: Flag = False
    subjects: Path | None = None
    subject_from: str | None = None
    time_limit: float | None = None
    study: Flag = False
    tables_only: Flag = False

    def given(self) -> dict[str, Any]:
        """Return the options that are not the defaults."""
        pairs = ((each, getattr(self, each.name)) for each in fields(self))
        return {each.name: value for each, value in pairs if value != each.default}


Sides: TypeAlias = Literal["right", "left", "both"]
RecordingOptions = Annotated[RecordingSettings, Parameter(name="*", group="Recording")]
AnalysisOptions = Annotated[AnalysisSettings, Parameter(name="*", group="Analysis")]
ManyOptions = Annotated[ManyRecordings, Parameter(name="*", group="Many recordings")]
LimitOptions = Annotated[GivenLimits, Parameter(name="*", group="Limits of the joints")]
# A fit has the filter's and some of the cuts' settings, and a penalty and a measure of its own.
_OF_FITS = re.compile(
    r"^(?!resample|filter|metric|armature|segments|rest_|count|penalty|error|measure|spacing|max_|effort)"
)
FitOptions = Annotated[
    AnalysisSettings, Parameter(name="*", group="Recording and cuts", parse=_OF_FITS)
]
# Settings that are no text: obstacles, and pairs of links.
_IN_PYTHON_ONLY = re.compile(r"^(?!obstacles|links|pairs)")
RetargetingOptions = Annotated[
    RetargetingSettings, Parameter(name="*", group="Retargeting", parse=_IN_PYTHON_ONLY)
]


def each_side(side: Sides) -> list[Side]:
    """Return the sides that an option names."""
    return ["right", "left"] if side == "both" else [side]
