"""The input of a fit: settings, markers and their places, and the person's height."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.recordings.markers.body import MarkedBody, is_segment, on_trunk
from geodesic_ocp.recordings.markers.marker_set import MarkerSet, marker_sets
from geodesic_ocp.recordings.markers.markers import (
    IN_M,
    IN_MM,
    Markers,
    evenly,
    frozen_samples,
)

Base = Literal["fixed", "free"]

# Spread of a body height about that of the model, if nothing else is known of it, relative.
_HEIGHT_SPREAD = 0.3
_TALLEST = 3.0  # [m]
# Heights of markers above the ground when the person stands upright, as fractions of body height:
# the reference model of the Master Motor Map (hip 0.530, from there to the vertex 0.470), its
# markers of head and feet. LANK and LHEE include the height of the ankle, 0.039.
_HEAD = {"RFHD": 0.970, "LFHD": 0.970, "RBHD": 0.955, "LBHD": 0.955}
_FEET = {"RANK": 0.02075, "LANK": 0.02075, "RHEE": 0.0135, "LHEE": 0.0135}
_UPRIGHT = 90.0  # percentile of the heights over time: people bend more often than they stretch


@dataclass(frozen=True)
class FitSettings:
    """See `fit_markers`, whose arguments these are."""

    base: Base = "free"
    lengths: bool = True
    offsets: bool = True
    limits: bool = True
    noise: float = 0.002
    acceleration: float = 100.0
    jerk: float = 1000.0
    outlier: float = 0.03


@dataclass(frozen=True, eq=False)
class ChosenMarkers:
    """Markers of a recording that a marker set places on a body."""

    set_name: str
    names: tuple[str, ...]  # in the recording (m,)
    observed: Array  # their positions (k, m, 3) [m], NaN where missing
    segments: tuple[str, ...]  # segments that they are fixed to
    places: Array  # on these segments, at the height of the body's model (m, 3) [m]
    uncertainty: Array  # uncertainty of the places (m,) [m]
    left_out: tuple[str, ...]  # names of the recording that are not used
    # share of the samples that `frozen_samples` names, by marker; missing in `observed`
    frozen: dict[str, float]


def choose_markers(
    body: MarkedBody,
    positions: Markers,
    marker_set: MarkerSet | None,
    *,
    height_factor: float,
    outlier: float,
) -> ChosenMarkers:
    """Return the markers that a set, or of the known sets the one with most of them on the arms,
    places on the body.

    Offsets in metres are divided by `height_factor`, by which the body is to be scaled. Positions
    that are held, see `frozen_samples`, are missing.

    Warns:
        RuntimeWarning: a set that is given has markers on something that is no segment.

    Raises:
        ValueError: no marker is seen at all; the set has no marker of the recording on this body;
            or it gives offsets as fractions of a height that the model does not have.
    """
    known = [*marker_sets().values(), _frames(body)]
    candidates = [marker_set] if marker_set is not None else known
    if body.height is None:
        if marker_set is not None and marker_set.unit == "height":
            raise ValueError(
                f"marker_set {marker_set.name!r} gives offsets as fractions of the body height, "
                f"which {body.model.name!r} does not have; give them in metres (unit='m')"
            )
        candidates = [each for each in candidates if each.unit == "m"]
    if np.isnan(positions.positions).all():
        raise ValueError("positions: no marker is seen in any sample")
    unseen = np.isnan(positions.positions[:, :, 0]).all(axis=0)
    names = tuple(np.array(positions.names)[~unseen].tolist())

    def on_body(used: MarkerSet) -> dict[str, str]:
        """Return markers of the set on this body by their names in the recording."""
        found = used.matching(names)
        return {name: each for name, each in found.items() if body.has(used.places[each][0])}

    def fitness(match: dict[str, str], used: MarkerSet) -> tuple[int, int, int]:
        """Return how many markers are on the arms, and in all, and how many are named literally."""
        on_arms = sum(not on_trunk(used.places[each][0]) for each in match.values())
        return on_arms, len(match), sum(name == each for name, each in match.items())

    matches = [(on_body(each), each) for each in candidates]
    match, used = max(matches, key=lambda pair: fitness(*pair))
    if not match:
        wanted = ", ".join(each.name for each in candidates)
        raise ValueError(
            f"none of the markers {', '.join(positions.names[:20])} is one of {wanted} on "
            f"{body.model.name!r}; say where they are with marker_set=MarkerSet(...), "
            "or in a file (--marker-set)"
        )
    if marker_set is not None:
        _warn_of_unknown_segments(body, marker_set, names)
    unit = float(body.height or 0.0) if used.unit == "height" else 1.0 / height_factor
    observed = positions.positions[:, [positions.names.index(name) for name in match]]
    segments = [used.places[marker][0] for marker in match.values()]
    carriers = [body.attachment(segment).joint for segment in segments]
    standing = frozen_samples(observed, carriers, outlier)
    observed = np.where(standing[:, :, None], np.nan, observed)
    shares = dict(zip(match, standing.mean(axis=0).tolist(), strict=True))
    kept = np.flatnonzero(~np.isnan(observed).all(axis=(0, 2)))
    markers = [list(match.values())[column] for column in kept]
    return ChosenMarkers(
        set_name=used.name,
        names=tuple(list(match)[column] for column in kept),
        observed=observed[:, kept],
        segments=tuple(segments[column] for column in kept),
        places=unit * np.array([used.places[marker][1] for marker in markers]),
        uncertainty=np.array([used.uncertainty_of(marker) for marker in markers]),
        left_out=tuple(name for name in positions.names if name not in match),
        frozen={name: share for name, share in shares.items() if share > 0.0},
    )


def _warn_of_unknown_segments(body: MarkedBody, used: MarkerSet, names: tuple[str, ...]) -> None:
    """Yield a RuntimeWarning if recorded markers are on what is neither a segment nor a frame."""
    places = {name: used.places[marker][0] for name, marker in used.matching(names).items()}
    found = [
        f"{name} on {segment!r}"
        for name, segment in places.items()
        if not (is_segment(segment) or body.has(segment))
    ]
    if found:
        warnings.warn(
            f"marker set {used.name!r} has {', '.join(found)}, which is neither a segment of a "
            f"person nor a frame of {body.model.name!r}: left out",
            RuntimeWarning,
            stacklevel=4,
        )


def _frames(body: MarkedBody) -> MarkerSet:
    """Return the frames of the model as points that may be recorded by their names."""
    frames = [str(frame.name) for frame in list(body.model.pin.frames)[1:]]
    places = {frame: (frame, (0.0, 0.0, 0.0)) for frame in frames}
    return MarkerSet("frames of the model", places, "m", 0.0)


def standing_height(positions: Markers) -> float | None:
    """Return body height [m] from the markers of head and feet, in a space with z up; None without
    them.

    The mean over the pairs of a marker of the head and one of the feet of their vertical distance,
    divided by what it is at a height of 1 m, when the person stands as upright as at any time.
    """
    plain = {name.rpartition(":")[2].upper(): index for index, name in enumerate(positions.names)}
    pairs = [
        (positions.positions[:, plain[head], 2] - positions.positions[:, plain[foot], 2])
        / (_HEAD[head] - _FEET[foot])
        for head in _HEAD
        for foot in _FEET
        if head in plain and foot in plain
    ]
    known = [pair for pair in pairs if np.isfinite(pair).any()]
    if not known:
        return None
    height = float(np.mean(np.nanpercentile(known, _UPRIGHT, axis=1)))
    return height if 0.4 < height < 2.6 else None


@dataclass(frozen=True)
class KnownHeight:
    """Knowledge of the person's height before the fit."""

    factor: float  # from the model's height to the person's
    spread: float  # standard deviation of the factor that is estimated; 0 if the factor is kept
    origin: str  # where it was taken from, in words
    estimated: bool = False  # whether it is taken from the markers


def known_height(
    body: MarkedBody, positions: Markers, height: float | None, settings: FitSettings
) -> KnownHeight:
    """Return the height that is given, of the recording's subject, of a standing person or of the
    model.

    Raises:
        ValueError: a height for a model that is not of a person, or not a height.
    """
    if body.height is None:
        if height is not None:
            raise ValueError(f"height is for models of people, not for {body.model.name!r}")
        return KnownHeight(1.0, 0.0, "")
    if height is not None:
        if as_positive("height", height, "m") > _TALLEST:
            in_cm = "; is it in cm?" if 50.0 < height < 100.0 * _TALLEST else ""
            raise ValueError(f"height must be at most {_TALLEST:g} m, got {height:g} m{in_cm}")
        return KnownHeight(height / body.height, 0.0, "as given")
    if positions.subject.height is not None:
        factor = positions.subject.height / body.height
        return KnownHeight(factor, 0.0, "of the recording's subject")
    if not settings.lengths:
        return KnownHeight(1.0, 0.0, "of the model")
    if settings.base == "free" and (standing := standing_height(positions)) is not None:
        origin = "from the markers of head and feet"
        return KnownHeight(standing / body.height, 0.0, origin, estimated=True)
    origin = "from lengths of segments, by the model's proportions"
    return KnownHeight(1.0, _HEIGHT_SPREAD, origin, estimated=True)


_RIGID = 0.03  # root mean square distance of the markers of a segment from a rigid body at most [m]
_FRAMES = 200  # that are considered
# Adults and children differ by a factor of up to two in height, and trunks of one height by less
# than another; units of length differ by ten or more.
_ANOTHER_UNIT = 4.0
_LEANING = 60.0  # angle of the trunk from the vertical, in the mean over time, that is asked about
# Root mean square distance of points from a line, up to which they count as in line [m]: keypoints
# of video have errors of this size.
_IN_LINE = 0.01


def _in_three(points: Array) -> NDArray[np.int64]:
    """Return indices of the frames in which three points or more are seen."""
    return np.flatnonzero(np.sum(~np.isnan(points[:, :, 0]), axis=1) >= 3)


def _aligned(places: Array, points: Array) -> tuple[Array, ...]:
    """Fit rigid motions to the points of frames (k, m, 3) from places on a body (m, 3).

    By least squares (Kabsch, Acta Crystallographica A 32, 1976).

    Returns:
        Rotations (k, 3, 3) and positions (k, 3) of the body; sizes (k, 3) of the covariance's
        singular values; mean square distances of the points from the body and from its mirror
        image (2, k).
    """
    seen = ~np.isnan(points[:, :, :1])
    count = seen.sum(axis=1)
    own = (seen * places).sum(axis=1) / count
    there = np.nansum(points, axis=1) / count
    left = seen * (places - own[:, None])
    right = np.nan_to_num(points - there[:, None])
    u, sizes, v = np.linalg.svd(np.swapaxes(left, 1, 2) @ right)
    sign = np.sign(np.linalg.det(u @ v))
    squares = (left**2 + right**2).sum(axis=(1, 2)) - 2.0 * (sizes[:, 0] + sizes[:, 1])
    off = [squares - 2.0 * turn * sizes[:, 2] for turn in (sign, -sign)]
    u[:, :, 2] *= sign[:, None]
    rotations = np.swapaxes(u @ v, 1, 2)
    positions = there - np.einsum("kij,kj->ki", rotations, own)
    return rotations, positions, sizes, np.maximum(off, 0.0) / count[:, 0]


def rigid_errors(places: Array, points: Array) -> tuple[float, float]:
    """Return root mean square distances [m] from a rigid body and from its mirror image.

    Medians over up to 200 frames with three points or more, infinite without any.

    Args:
        places: places of the points on the body (m, 3) [m].
        points: observed (k, m, 3) [m], NaN where missing.
    """
    rows = _in_three(points)
    if not rows.size:
        return np.inf, np.inf
    *_, squares = _aligned(places, points[rows[evenly(rows.size, _FRAMES)]])
    proper, mirrored = np.median(np.sqrt(squares), axis=1).tolist()
    return proper, mirrored


def without_stray(places: Array, points: Array) -> NDArray[np.int64]:
    """Return indices of the points but for one, if the others then are nearer to a rigid body.

    Args:
        places, points: see `rigid_errors`.
    """
    everything = np.arange(len(places))
    if len(places) <= 3 or rigid_errors(places, points)[0] <= _RIGID:
        return everything
    rest = [np.delete(everything, each) for each in everything]
    return min(rest, key=lambda kept: rigid_errors(places[kept], points[:, kept])[0])


def rigid_poses(places: Array, observed: Array, time: Array) -> tuple[Array, Array]:
    """Return rotations (k, 3, 3) and positions (k, 3) that place points on a rigid body's observed
    ones.

    By least squares in every frame with three points seen or more, in the others interpolated.

    Args:
        places: places of the points on the body (m, 3) [m].
        observed: (k, m, 3) [m], NaN where missing.
        time: (k,) [s].

    Raises:
        ValueError: no frame shows three points that are not in line.
    """
    rows = _in_three(observed)
    rotations, positions, sizes, _ = _aligned(places, observed[rows])
    usable = ~(sizes[:, 1] < 1e-4 * sizes[:, 0])
    rotations = rotations[usable]
    positions = positions[usable]
    known = time[rows[usable]]
    if not known.size:
        raise ValueError(
            "base='free' needs three markers of the thorax (of the model's base) in one frame at "
            "least, not in line, such as both shoulders and the neck or a hip; give positions in "
            "the base's axes and base='fixed' otherwise"
        )
    if known.size == 1:
        return np.repeat(rotations, time.size, 0), np.repeat(positions, time.size, 0)
    at = np.clip(time, known[0], known[-1])
    turns = scipy.spatial.transform.Rotation.from_matrix(rotations)
    turning = scipy.spatial.transform.Slerp(known, turns)
    moving = scipy.interpolate.make_interp_spline(known, positions, k=1)
    return turning(at).as_matrix(), moving(at)


def is_in_line(places: Array) -> bool:
    """Return whether points (m, 3) [m] say nothing of the rotation about some line."""
    _, sizes, _ = np.linalg.svd(places - places.mean(axis=0))
    return bool(sizes[1] < _IN_LINE * np.sqrt(len(places)))


def _check_scale(segment: str, places: Array, points: Array, height: float) -> None:
    """Check the distances between markers (k, m, 3) for another unit than that of places (m, 3).

    All must say so: single markers may be elsewhere.
    """
    first, second = np.triu_indices(len(places), 1)
    expected = np.linalg.norm(places[first] - places[second], axis=1)
    apart = np.linalg.norm(points[:, first] - points[:, second], axis=2)
    usable = (expected > _IN_LINE) & ~np.isnan(apart).all(axis=0)
    if not usable.any():
        return
    factors = np.nanmedian(apart[:, usable], axis=0) / expected[usable]
    for factor, unit in ((factors.min(), IN_MM), (1.0 / factors.max(), IN_M)):
        if factor > _ANOTHER_UNIT:
            raise ValueError(
                f"positions: the markers of the {segment} are {factors.min():.3g} to "
                f"{factors.max():.3g} times as far apart as on a person of {height:.3g} m{unit}"
            )


def check_trunk(body: MarkedBody, chosen: ChosenMarkers, *, ask_up: bool) -> None:
    """Check the markers of the thorax or, without three of them, the pelvis.

    Args:
        ask_up: whether a person who does not stand upright is asked about.

    Raises:
        ValueError: the trunk is more than 60 deg from the vertical, in the mean over time; or its
            markers are those of a mirrored person, or in another unit of length.
    """
    pelvis = {"pelvis", "trunk"}
    thorax = {"thorax", "right shoulder", "left shoulder"} | (pelvis if body.lone_side else set())
    segment = "thorax"
    columns = np.flatnonzero([each in thorax for each in chosen.segments])
    rows = _in_three(chosen.observed[:, columns])
    if not rows.size:
        segment = "pelvis"
        columns = np.flatnonzero([each in pelvis for each in chosen.segments])
        rows = _in_three(chosen.observed[:, columns])
    if not rows.size:
        return
    rows = rows[evenly(rows.size, _FRAMES)]
    points = chosen.observed[np.ix_(rows, columns)]
    segments = [chosen.segments[column] for column in columns]
    places = body.trunk_points(segments, chosen.places[columns])
    if is_in_line(places):
        return
    _check_scale(segment, places, points, body.height or 0.0)
    proper, mirrored = rigid_errors(places, points)
    if proper > _RIGID and mirrored < proper / 2:
        raise ValueError(
            f"positions: the markers of the {segment} are those of a mirrored person "
            f"({1e3 * proper:.0f} mm from a rigid {segment}, {1e3 * mirrored:.0f} mm from a "
            "mirrored one): right and left may be exchanged in the names, or the axes left-handed"
        )
    if not ask_up:
        return
    kept = without_stray(places, points)
    try:
        rotations, _ = rigid_poses(places[kept], points[:, kept], np.arange(float(len(points))))
    except ValueError:  # all in line
        return
    upwards = rotations[:, :, 2].mean(axis=0)
    length = float(np.linalg.norm(upwards))
    if length < 0.5:  # no direction is up on average
        return
    angle = float(np.rad2deg(np.arccos(np.clip(upwards[2] / length, -1.0, 1.0))))
    if angle > _LEANING:
        axis = int(np.argmax(np.abs(upwards)))
        name = ("-" if upwards[axis] < 0.0 else "") + "xyz"[axis]
        raise ValueError(
            f"positions: the {segment} is {angle:.0f} deg from the vertical z, on average: is "
            f"{name} up? Then pass up={name!r} (--up {name}); pass up='z' if z is up and the "
            "person lies. Or are right and left exchanged in the names?"
        )
