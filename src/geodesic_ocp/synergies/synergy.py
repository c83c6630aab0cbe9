"""Geodesic synergies: what they consist of, how they reconstruct a motion, and their files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_positive
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.logarithm.geodesic import geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean
from geodesic_ocp.model.human import stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, decoding, read_record, write_record
from geodesic_ocp.synergies.segment import speeds
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw, states_at, time_law

FORMAT = "geodesic_ocp synergies"
VERSION = 1
# A segment that returns to its start has a path too short for the observed speeds at its ends:
# these are limited to this multiple of the mean speed along the path.
_MAX_SPEED_RATIO = 100.0
_SAME = 1e-6  # of lengths, relative: quadrature of the same path in the same metric
_RATE = 100.0  # [Hz]
_GAP = 1e-6  # [s] between synergies, of rounding
_LONGEST = 86400.0  # [s], of a motion; a damaged file may ask for any amount of memory


@dataclass(frozen=True, eq=False, repr=False)
class Synergy(ShortRepr):
    """A geodesic synergy: a segment of a motion, as a path with a time law.

    In the sense of Klein, Jaquier, Meixner, Asfour (IROS 2022): a segment of a recorded motion that
    follows a geodesic; not a muscle synergy of motor control. At time t it has covered the distance
    law(t - start_time) along its path.

    Attributes:
        start, stop: indices of its first and last sample in the recording.
        start_time: start time of its first sample [s].
        path: the geodesic between the observed configurations at its ends; of a robot, the path
            that brings the hand (end-effector) to its pose.
        law: distance along the path over time from the start.
    """

    start: int
    stop: int
    start_time: float
    path: Path
    law: TimeLaw

    _shown = ("start", "stop", "start_time", "duration", "length")

    @property
    def duration(self) -> float:
        """[s]"""
        return self.law.duration

    @property
    def length(self) -> float:
        """Length of the path in its metric."""
        return self.law.length

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Return configuration (k, n), or velocity for order 1, acceleration for 2, at times t (k,)
        [s].

        Raises:
            ValueError: t lies outside the synergy, or the order is above 2.
        """
        if order not in (0, 1, 2):
            raise ValueError(f"order must be 0, 1 or 2, got {order}")
        result = self.states(np.atleast_1d(np.asarray(t, dtype=float)), order)[order]
        return result[0] if np.ndim(t) == 0 else result

    def states(self, t: Array, order: int = 2) -> tuple[Array, ...]:
        """Return configurations, velocities and accelerations, (k, n) each, at times t (k,) [s].

        Derivatives above the given order are left out.
        """
        return states_at(self.path, self.law, t - self.start_time, order)


def motion_of_synergies(synergies: Sequence[Synergy], rate: float = _RATE) -> Motion:
    """Return the motion of successive synergies, as from `load_synergies`, with velocities.

    At a cut, where the velocity jumps, the sample is of the synergy that begins.

    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion)
    >>> predicted = go.synergies.motion_of_synergies(analysis.synergies)
    >>> len(predicted), predicted.time[[0, -1]].round(3).tolist()
    (700, [0.0, 6.992])

    Args:
        synergies: synergies, each of which begins where the one before it ends.
        rate: samples per second [Hz], rounded so that they are evenly spaced up to the end.

    Raises:
        ValueError: no synergies, a gap between two of them, or a rate that is not positive.
    """
    if not synergies:
        raise ValueError("there are no synergies")
    starts = np.array([each.start_time for each in synergies])
    ends = starts + [each.duration for each in synergies]
    if gaps := np.flatnonzero(np.abs(starts[1:] - ends[:-1]) > _GAP).tolist():
        raise ValueError(
            f"synergy {gaps[0] + 1} begins at {starts[gaps[0] + 1]:.6g} s, not where the one "
            f"before it ends, at {ends[gaps[0]]:.6g} s"
        )
    count = round(as_positive("rate", rate, "Hz") * (ends[-1] - starts[0]))
    time = np.linspace(starts[0], ends[-1], max(count, 1) + 1)
    of_each = np.searchsorted(starts, time + _GAP, side="right") - 1
    parts = [
        each.states(np.clip(time[of_each == k], starts[k], ends[k]), 1)
        for k, each in enumerate(synergies)
    ]
    q, velocity = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Motion(time, q, synergies[0].path.metric.coordinate_names, velocity)


def as_segments(motion: Motion, segments: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the (start, stop) sample indices as integers.

    Raises:
        ValueError: they are not pairs, do not cover the motion without gaps, or one does not end
            after it starts.
    """
    try:
        segments = [(int(start), int(stop)) for start, stop in segments]
    except (TypeError, ValueError):
        raise ValueError(f"segments must be pairs (start, stop), got {segments!r}") from None
    edges = [segments[0][0], *(stop for _, stop in segments)] if segments else []
    starts = [start for start, _ in segments]
    if not edges or edges[0] != 0 or edges[-1] != len(motion) - 1 or starts != edges[:-1]:
        raise ValueError(
            f"segments must cover samples 0 to {len(motion) - 1} without gaps, got {segments}"
        )
    if any(start >= stop for start, stop in segments):
        raise ValueError(f"every segment must end after it starts, got {segments}")
    return segments


class Reconstruction(NamedTuple):
    """A motion's synergies and the motion that they predict."""

    synergies: tuple[Synergy, ...]
    predicted: Motion

    def __repr__(self) -> str:
        duration = self.predicted.time[-1] - self.predicted.time[0]
        return f"Reconstruction({len(self.synergies)} synergies, {duration:.3f} s)"


class PlannedSegments(NamedTuple):
    """Synergies of those segments of a motion for which geodesics were found.

    Attributes:
        synergies: those that were found.
        q, velocity: predicted (k, n); NaN at the samples of segments without a geodesic.
        failures: why there is none, by the index of the segment.
    """

    synergies: tuple[Synergy, ...]
    q: Array
    velocity: Array
    failures: dict[int, Exception]


def plan_segments(
    metric: Metric,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
    *,
    progress: Callable[[int], object] | None = None,
    throw: bool = False,
) -> PlannedSegments:
    """Return what `reconstruct` returns, for those segments that have a geodesic.

    Args:
        metric, motion, segments, progress: see `reconstruct`.
        throw: raise the error of the first segment without a geodesic.

    Raises:
        ValueError: see `reconstruct`.
        NotConverged, IntegrationFailed, ValueError: with `throw`, there is no geodesic.
    """
    segments = as_segments(motion, segments)
    speed = speeds(metric, motion)
    synergies: list[Synergy] = []
    failures: dict[int, Exception] = {}
    for number, (start, stop) in enumerate(segments):
        try:
            # Continuous joints turn the way that was recorded, also the longer one.
            path = geodesic(metric, motion.q[start], motion.q[stop], wrap=False)
            law = law_of_segment(motion, speed, path.length, start, stop)
        except (GeodesicOcpError, ValueError) as failure:  # as where the metric is singular
            if throw:
                raise
            failures[number] = failure
        else:
            synergies.append(Synergy(start, stop, float(motion.time[start]), path, law))
        if progress is not None:
            progress(number + 1)
    q = np.full_like(motion.q, np.nan)
    velocity = np.full_like(motion.q, np.nan)
    for synergy in synergies:
        # A shared sample belongs to the synergy that starts there.
        samples = slice(synergy.start, synergy.stop + 1)
        q[samples], velocity[samples] = synergy.states(motion.time[samples], 1)
    return PlannedSegments(tuple(synergies), q, velocity, failures)


def reconstruct(
    metric: Metric,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
    *,
    progress: Callable[[int], object] | None = None,
) -> Reconstruction:
    """Plan every segment as a geodesic of the metric with a minimum-acceleration time law.

    The path connects the observed configurations at the segment's ends (`geodesic`). The time law
    takes the observed duration and end speeds |q'|_G (at most a hundred times the mean speed along
    the path) and never moves backwards. With `Euclidean` the paths are straight lines.

    >>> motion = go.trajectory.bundled_recording().motion
    >>> segments = [(0, 300), (300, len(motion) - 1)]
    >>> result = go.synergies.reconstruct(go.Euclidean(7), motion, segments)
    >>> [round(synergy.length, 2) for synergy in result.synergies]
    [0.44, 0.36]
    >>> result.predicted.q.shape
    (840, 7)

    Args:
        metric: metric of the motion's dimension.
        motion: observed, with velocities.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.
        progress: called with the number of synergies planned so far.

    Returns:
        Synergies, and the predicted motion at the recording's own times.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
        NotConverged: no geodesic was found for a segment.
    """
    planned = plan_segments(metric, motion, segments, progress=progress, throw=True)
    return reconstruction(planned, motion)


def reconstruction(planned: PlannedSegments, motion: Motion) -> Reconstruction:
    """Return the synergies of all segments, and the motion that they predict."""
    predicted = Motion(motion.time, planned.q, motion.joint_names, planned.velocity, motion.subject)
    return Reconstruction(planned.synergies, predicted)


def law_of_segment(motion: Motion, speed: Array, length: float, start: int, stop: int) -> TimeLaw:
    """Return the time law over a path of this length between two samples.

    Args:
        motion: observed.
        speed: its speeds |q'|_G at the samples (k,), which the law takes at both ends.
        length: length of the path, in the metric.
        start, stop: indices of the samples.
    """
    duration = float(motion.time[stop] - motion.time[start])
    max_speed = _MAX_SPEED_RATIO * length / duration
    end_speeds = (float(min(speed[index], max_speed)) for index in (start, stop))
    return time_law(length, duration, *end_speeds, monotone=True)


@dataclass(eq=False)
class _PathRecord:
    """The path of a synergy in a file."""

    segments: int
    degree: int
    nodes: Array
    ends: tuple[float, ...] | None = None

    def path(self, metric: Metric) -> Path:
        """Return the path itself, whose metric the file does not contain."""
        return Path(metric, Grid(self.segments, self.degree, self.ends), self.nodes)


@dataclass(eq=False)
class _SynergyRecord:
    """A synergy in a file."""

    start: int
    stop: int
    start_time: float
    path: _PathRecord
    law: TimeLaw


@dataclass
class _ModelRecord:
    name: str = ""
    height: float | None = None


@dataclass(eq=False)
class _FileRecord:
    joint_names: tuple[str, ...]
    synergies: tuple[_SynergyRecord, ...]
    model: _ModelRecord = field(default_factory=_ModelRecord)
    doubts: tuple[str, ...] = ()


def save_synergies(
    file: str | FilePath,
    synergies: Sequence[Synergy],
    joint_names: Sequence[str],
    model: Model | None = None,
    doubts: Sequence[str] = (),
) -> None:
    """Write segments, paths and time laws of synergies in SI units, at full precision.

    >>> import tempfile
    >>> from pathlib import Path
    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> reach = np.outer(3.0 * time**2 - 2.0 * time**3, np.full(7, 0.5))
    >>> analysis = go.analyse(arm, go.Motion(time, reach, arm.joint_names).filtered())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "synergies.json"
    ...     go.synergies.save_synergies(file, analysis.synergies, arm.joint_names)
    ...     loaded = go.synergies.load_synergies(file, analysis.metric)
    >>> len(loaded) == len(analysis.synergies)
    True

    Args:
        file: to write.
        synergies: synergies of one motion.
        joint_names: names of the coordinates.
        model: model whose name, and height if it is a person's, are written, by which `geodesic-ocp
            show` knows what to draw.
        doubts: why the motion may not be what was recorded, see `Motion.doubts`.
    """
    record = {
        "format": FORMAT,
        "version": VERSION,
        "units": {"q": "rad or m", "time": "s", "length": "of the metric: sqrt(kg) m"},
        "joint_names": list(joint_names),
        **({} if model is None else {"model": {"name": model.name, "height": stature(model)}}),
        **({"doubts": list(doubts)} if doubts else {}),
        "segments": [[synergy.start, synergy.stop] for synergy in synergies],
        "synergies": [_encode(synergy) for synergy in synergies],
    }
    write_record(file, record)


def _encode(synergy: Synergy) -> dict[str, Any]:
    path = {name: getattr(synergy.path.grid, name) for name in ("segments", "degree", "ends")}
    path["nodes"] = synergy.path.nodes
    values = {name: getattr(synergy, name) for name in Synergy._shown}
    return {**values, "path": path, "law": asdict(synergy.law)}


def load_synergies(file: str | FilePath, metric: Metric) -> tuple[Synergy, ...]:
    """Read synergies that `save_synergies` wrote.

    >>> import tempfile
    >>> recording = go.trajectory.bundled_recording()
    >>> analysis = go.analyse(recording.model, recording.motion)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = analysis.save(folder)
    ...     synergies = go.synergies.load_synergies(f"{folder}/synergies.json", analysis.metric)
    >>> len(synergies) == len(analysis.synergies)
    True

    Args:
        file: the JSON file.
        metric: metric of the paths, such as `Analysis.metric`; the file does not contain it.

    Raises:
        RecordingError: the file is missing, is not such a file, or does not fit the metric, in
            which its paths must have the lengths that were saved.
    """
    record = convert(read_record(file, FORMAT, VERSION, "synergies"), _FileRecord, file)
    names = metric.joint_names or record.joint_names
    synergies = []
    with decoding(file):
        if record.joint_names != names:
            raise ValueError(f"its joints {record.joint_names} are not the metric's, {names}")
        for each in record.synergies:
            curve = each.path.path(metric)
            if not np.isclose(curve.length, each.law.length, rtol=_SAME, atol=_SAME):
                raise ValueError(
                    f"the synergy of samples {each.start} to {each.stop} has the length "
                    f"{curve.length:.6g} in this metric, not {each.law.length:.6g}: it was saved "
                    "in another"
                )
            synergies.append(Synergy(each.start, each.stop, each.start_time, curve, each.law))
    return tuple(synergies)


@dataclass(frozen=True, eq=False, repr=False)
class SavedSynergies(ShortRepr):
    """Contents of a file of `save_synergies` that need no metric."""

    motion: Motion  # motion that the synergies predict, at 100 Hz, without velocities
    spans: tuple[tuple[float, float], ...]  # start and end of each synergy [s]
    model: str = ""  # name of the model; "" if the file does not say
    height: float | None = None  # height of the person [m]; None if the file does not say


def read_saved_synergies(file: str | PathLike[str]) -> SavedSynergies:
    """Return the motion that the synergies in a file predict.

    A geodesic has a constant speed in its metric, so the fraction of its length that a synergy has
    covered is the parameter of its path, and the metric is not needed. Paths of a robot under
    constraints have so nearly (to some mrad), as their grids are coarse.

    Args:
        file: file that `save_synergies` wrote.

    Raises:
        RecordingError: the file is missing, or is not such a file.
    """
    record = convert(read_record(file, FORMAT, VERSION, "synergies"), _FileRecord, file)
    names = record.joint_names
    synergies = record.synergies
    with decoding(file):
        if not synergies:
            raise ValueError("synergies must not be empty")
        spans = tuple((each.start_time, each.start_time + each.law.duration) for each in synergies)
        duration = spans[-1][1] - spans[0][0]
        if not (np.all(np.diff(spans, axis=0)[:, 0] >= 0.0) and 0.0 < duration <= _LONGEST):
            raise ValueError("synergies: each start_time must follow the one before, within a day")

        def followed(each: _SynergyRecord) -> Callable[[Array], Array]:
            path = each.path.path(Euclidean(len(names)))
            law = each.law
            length = law.length if law.length > 0.0 else np.inf  # where nothing moves
            return lambda t: path(np.clip(law(t - each.start_time) / length, 0.0, 1.0))

        motion = motion_in_spans(spans, [followed(each) for each in synergies], names)
    motion = replace(motion, doubts=record.doubts)
    return SavedSynergies(motion, spans, record.model.name, record.model.height)


def motion_in_spans(
    spans: Sequence[tuple[float, float]],
    parts: Sequence[Callable[[Array], Array]],
    names: Sequence[str],
) -> Motion:
    """Return the motion at 100 Hz of parts, each in its span of time [s]; it rests between them."""
    starts = [start for start, _ in spans]
    count = max(2, 1 + round((spans[-1][1] - starts[0]) * _RATE))
    time = np.linspace(starts[0], spans[-1][1], count)
    owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
    q = np.empty((count, len(names)))
    for number, (part, span) in enumerate(zip(parts, spans, strict=True)):
        q[owner == number] = part(time[owner == number].clip(*span))
    return Motion(time, q, tuple(names))
