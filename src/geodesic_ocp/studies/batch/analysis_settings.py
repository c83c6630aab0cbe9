"""AnalysisSettings: how recordings are filtered, cut and planned, as plain values."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import METRIC_NAMES, KineticEnergy, as_analysis_metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.markers.space_axes import Axis, as_axis
from geodesic_ocp.synergies.optimal_segmentations import segment_optimal
from geodesic_ocp.synergies.segment import as_threshold
from geodesic_ocp.synergies.segment_costs import Measure
from geodesic_ocp.trajectory.motion import Motion

Segments = Literal["online", "optimal"]
_UNITS = {
    "height": "m",
    "mass": "kg",
    "resample": "Hz",
    "cutoff": "Hz",
    "duration": "s",
    "rate": "Hz",
}


@dataclass(frozen=True, repr=False)
class AnalysisSettings:
    """How recordings are filtered, cut and planned: the options of `geodesic-ocp analyse`.

    Attributes:
        height, mass: of all persons [m], [kg]; by default those in the files.
        resample: interpolate at this rate first [Hz].
        cutoff: of the filter [Hz]; by default chosen for each recording.
        duration: of the window of a Savitzky-Golay filter [s], instead of a cut-off.
        unfiltered: take recordings as they are.
        metric: "joint-inertia", "kinetic", "euclidean", or a file that `save_metric` wrote.
        armature: joint inertia of every joint [kg m^2] for the metric "joint-inertia".
        segments: "online", see `segment`, or "optimal", see `segment_optimal`.
        threshold, rest, rest_duration, min_duration, hysteresis: of `segment`.
        count, penalty, error, measure, spacing, max_duration: of `segment_optimal`.
        convention, skeleton, unit, rate, up, marker_set: where the files' format does not give
            them, see `read_recording`; a convention by its name or its file, a marker set by its
            file.

    Raises:
        ValueError: a setting out of range, or settings that exclude each other.
    """

    height: float | None = None
    mass: float | None = None
    resample: float | None = None
    cutoff: float | None = None
    duration: float | None = None
    unfiltered: bool = False
    metric: str = "joint-inertia"
    armature: float | None = None
    segments: Segments = "online"
    threshold: float = 0.6
    rest: float = 0.02
    rest_duration: float = 0.1
    min_duration: float = 0.1
    hysteresis: float = 0.1
    count: int | None = None
    penalty: float | None = None
    error: float | None = None
    measure: Measure = "joint"
    spacing: float = 0.05
    max_duration: float = 2.0
    convention: str | None = None
    unit: str | float | None = None
    rate: float | None = None
    skeleton: str | None = None
    up: Axis | None = None
    marker_set: str | None = None

    def __post_init__(self) -> None:
        for name, unit in _UNITS.items():
            if (number := getattr(self, name)) is not None:
                as_positive(name, number, unit)
        if sum((self.cutoff is not None, self.duration is not None, self.unfiltered)) > 1:
            raise ValueError("give only one of cutoff, duration and unfiltered")
        as_threshold(self.threshold)
        if self.segments not in get_args(Segments):
            raise ValueError(f"segments must be 'online' or 'optimal', got {self.segments!r}")
        wanted = [name for name in ("count", "penalty", "error") if getattr(self, name) is not None]
        if len(wanted) != (self.segments == "optimal"):
            raise ValueError(
                "segments='optimal' needs one of count, penalty and error, and only it does; got "
                f"segments={self.segments!r} with {' and '.join(wanted) or 'none of them'}"
            )
        if self.metric not in METRIC_NAMES and not Path(self.metric).is_file():
            raise ValueError(
                f"metric must be {', '.join(METRIC_NAMES)} or a file, and there is no file "
                f"{self.metric!r}"
            )
        if self.armature is not None and self.metric != "joint-inertia":
            raise ValueError(
                f"armature is the joint inertia of the metric joint-inertia, not of {self.metric}"
            )
        for name in ("skeleton", "marker_set"):
            file = getattr(self, name)
            if file is not None and not Path(file).is_file():
                raise ValueError(f"{name}: there is no file {file!r}")
        named = self.convention is None or self.convention in ANGLE_CONVENTIONS
        if self.convention is not None and not named and not Path(self.convention).is_file():
            raise ValueError(
                f"convention: {self.convention!r} is neither a file nor one of the built-in "
                f"conventions, which are {', '.join(ANGLE_CONVENTIONS)}"
            )
        if self.up is not None:
            as_axis(self.up)

    def __repr__(self) -> str:
        others = [
            f"{each.name}={getattr(self, each.name)!r}"
            for each in fields(self)
            if getattr(self, each.name) != each.default
        ]
        return f"AnalysisSettings({', '.join(others)})"

    def record(self) -> dict[str, Any]:
        """The settings as they are stored; of files that they name the content, by a digest."""
        found = asdict(self)
        for name, file in self.files().items():
            found[name] = hashlib.sha256(file.read_bytes()).hexdigest()
        return found

    def files(self) -> dict[str, Path]:
        """The files that settings name, by setting."""
        found = {}
        if self.metric not in METRIC_NAMES:
            found["metric"] = Path(self.metric)
        for name in ("convention", "skeleton", "marker_set"):
            file = getattr(self, name)
            if file is not None and Path(file).is_file():
                found[name] = Path(file)
        return found

    def of_formats(self) -> dict[str, Any]:
        """The arguments of `read_recording` about what the format of a file leaves open."""
        names = ("convention", "unit", "rate", "skeleton", "up", "marker_set")
        return {name: getattr(self, name) for name in names}

    def digest(self) -> str:
        """Eight hexadecimal digits that are the same for the same settings."""
        text = json.dumps(self.record(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:8]

    def metric_of(self, model: Model) -> Metric:
        """The metric on a model, which has the armature of the settings.

        Raises:
            RecordingError: the metric's file is not one, or does not fit the model.
        """
        if self.metric == "joint-inertia" and self.armature is not None:
            return KineticEnergy(model)  # also with an armature of 0
        if self.metric in METRIC_NAMES:
            return as_analysis_metric(self.metric, model)
        from geodesic_ocp.fitting.metric_fit import load_metric  # with a solver: others save it

        return load_metric(self.metric, model)

    def segments_of(
        self, metric: Metric, motion: Motion, model: Model, progress: Progress | None = None
    ) -> list[tuple[int, int]] | None:
        """The optimal segments of a filtered motion; None for those of the online rule."""
        if self.segments == "online":
            return None
        return segment_optimal(
            metric,
            motion,
            count=self.count,
            penalty=self.penalty,
            error=self.error,
            measure=self.measure,
            model=model,
            spacing=self.spacing,
            max_duration=self.max_duration,
            progress=progress,
        )
