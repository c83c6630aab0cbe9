"""AnalysisSettings: how recordings are filtered, cut and planned, as plain values."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

from geodesic_ocp.arrays import ShortRepr, as_choice
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import METRIC_NAMES, KineticEnergy, as_analysis_metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress
from geodesic_ocp.recordings.recording_settings import RecordingSettings
from geodesic_ocp.synergies.optimal_segmentations import segment_optimal
from geodesic_ocp.synergies.segment import as_threshold, segment
from geodesic_ocp.synergies.segment_costs import Measure
from geodesic_ocp.synergies.segment_developed import segment_developed
from geodesic_ocp.synergies.uncertainty import Cutting

Segments = Literal["developed", "online", "optimal"]
_WANTED = ("count", "penalty", "error")
# Settings that apply to some kinds of segments only.
_OF_KIND: dict[Segments, tuple[str, ...]] = {
    "developed": ("deviation", "rest_speed", "rest_duration", "min_duration", "max_duration"),
    "online": ("threshold", "rest_speed", "rest_duration", "min_duration", "hysteresis"),
    "optimal": (*_WANTED, "measure", "spacing", "max_duration"),
}


@dataclass(frozen=True, repr=False)
class AnalysisSettings(ShortRepr, RecordingSettings):
    """Settings of the filter, the metric and the segments of an analysis.

    These settings are the options of `geodesic-ocp analyse`, the arguments of
    `analyse_recordings`, and part of every saved result.

    Attributes:
        resample: rate of an interpolation before everything else [Hz], for samples that are not
            evenly spaced.
        cutoff: cut-off frequency of the filter [Hz]; default: chosen from the noise floor.
        savitzky_golay: window of a Savitzky-Golay filter of order 2 [s], in place of a cut-off; in
            the paper 0.21.
        filter: filter the recording; otherwise the motion is taken as it is.
        metric: joint-inertia, kinetic (the kinetic energy without joint inertia), euclidean, or a
            file that `fit` wrote (.json).
        armature: joint inertia of every joint [kg m^2]; default: 0.03 m r^2, with the mass m and
            the reach r of the arm.
        segments: developed: cut where geodesics explain the whole motion best; online: cut where
            the motion leaves its geodesic, as in the paper; optimal: cut where the error becomes
            least.
        threshold: angle between motion and geodesic at which a new online segment begins [rad].
        rest_speed: fraction of the largest speed below which the arm rests.
        rest_duration: duration of the shortest rest that is a segment of its own [s].
        min_duration: duration of the shortest segment that is not a rest [s]; 0 allows any.
        hysteresis: angle beyond the threshold that a change of direction must reach to begin a new
            online segment [rad].
        deviation: what a further developed segment must save: a root mean square deviation of this
            size over one second [rad s^0.5].
        count: number of optimal segments.
        penalty: mean error that a further optimal segment must save [rad or m].
        error: largest mean error of as few optimal segments as possible [rad or m].
        measure: error that optimal segments make least, of the joints [rad] or of the hand
            [m or rad].
        spacing: time between possible cuts of optimal segments [s], which then move to the best
            sample nearby.
        max_duration: duration of the longest developed or optimal segment [s].
        uncertainty: also state how far number, cuts and errors of the synergies vary under the
            recording's own noise, which takes some seconds for a recording.
        effort: also predict motions of least torque, torque change and work, which takes seconds
            for a recording; of many recordings in a study alone.

    Raises:
        ValueError: a setting out of range, or settings that exclude each other.
    """

    resample: float | None = None
    cutoff: float | None = None
    savitzky_golay: float | None = None
    filter: bool = True
    metric: str = "joint-inertia"
    armature: float | None = None
    segments: Segments = "developed"
    threshold: float = 0.6
    rest_speed: float = 0.02
    rest_duration: float = 0.1
    min_duration: float = 0.1
    hysteresis: float = 0.1
    deviation: float = 0.04
    count: int | None = None
    penalty: float | None = None
    error: float | None = None
    measure: Measure = "joint"
    spacing: float = 0.05
    max_duration: float = 2.0
    uncertainty: bool = False
    effort: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_positive(resample="Hz", cutoff="Hz", savitzky_golay="s")
        if sum((self.cutoff is not None, self.savitzky_golay is not None, not self.filter)) > 1:
            raise ValueError("give only one of cutoff, savitzky-golay and no-filter")
        as_threshold(self.threshold)
        as_choice("segments", self.segments, get_args(Segments))
        self._check_segments()
        if self.metric not in METRIC_NAMES and not Path(self.metric).is_file():
            raise ValueError(
                f"metric must be {', '.join(METRIC_NAMES)} or a file, and there is no file "
                f"{self.metric!r}"
            )
        if self.armature is not None and self.metric != "joint-inertia":
            raise ValueError(
                f"armature is the joint inertia of the metric joint-inertia, not of {self.metric}"
            )

    def _check_segments(self) -> None:
        """Refuse settings that have no effect on these segments."""
        defaults = {each.name: each.default for each in fields(self)}
        every = dict.fromkeys(name for names in _OF_KIND.values() for name in names)
        foreign = [name for name in every if name not in _OF_KIND[self.segments]]
        if given := [name for name in foreign if getattr(self, name) != defaults[name]]:
            kinds = [kind for kind, names in _OF_KIND.items() if set(given) <= {*names}]
            only = " or ".join(f"segments={kind!r}" for kind in kinds) or "other segments"
            raise ValueError(f"{' and '.join(given)}: for {only} only")
        wanted = [name for name in _WANTED if getattr(self, name) is not None]
        if self.segments == "optimal" and len(wanted) != 1:
            raise ValueError(
                "segments='optimal' needs one of count, penalty and error, got "
                f"{' and '.join(wanted) or 'none of them'}"
            )

    def record(self) -> dict[str, Any]:
        """Get the settings as they are stored; of files that they name the content, by a digest."""
        found = asdict(self)
        for name, file in self.files().items():
            found[name] = hashlib.sha256(file.read_bytes()).hexdigest()
        return found

    def files(self) -> dict[str, Path]:
        """Return the files that settings name, by setting."""
        names = ["convention", "skeleton", "marker_set", "columns"]
        if self.metric not in METRIC_NAMES:
            names.append("metric")
        given = {name: Path(file) for name in names if (file := getattr(self, name)) is not None}
        return {name: file for name, file in given.items() if file.is_file()}

    def digest(self) -> str:
        """Return eight hexadecimal digits that are the same for the same settings."""
        text = json.dumps(self.record(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:8]

    def metric_of(self, model: Model) -> Metric:
        """Return the metric on a model, which has the armature of the settings.

        Raises:
            RecordingError: the metric's file is not one, or does not fit the model.
        """
        if self.metric == "joint-inertia" and self.armature is not None:
            return KineticEnergy(model)  # also with an armature of 0
        if self.metric in METRIC_NAMES:
            return as_analysis_metric(self.metric, model)
        from geodesic_ocp.fitting.metric_fit import load_metric  # with a solver: others save it

        return load_metric(self.metric, model)

    def cutting(self, model: Model, progress: Progress | None = None) -> Cutting:
        """Return how a filtered motion is cut."""
        chosen: dict[str, Any] = {name: getattr(self, name) for name in _OF_KIND[self.segments]}
        if self.segments == "optimal":
            return partial(segment_optimal, model=model, progress=progress, **chosen)
        rest = chosen.pop("rest_speed")
        if self.segments == "online":
            return partial(segment, rest=rest, **chosen)
        return partial(segment_developed, rest=rest, **chosen)
