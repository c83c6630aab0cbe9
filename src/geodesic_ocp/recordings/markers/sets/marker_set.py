"""Where markers are fixed to the segments of a person or the frames of a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from geodesic_ocp.arrays import as_not_negative, as_vector
from geodesic_ocp.recordings.conventions.read_convention_record import from_record

Place = tuple[str, tuple[float, float, float]]


@dataclass(frozen=True, repr=False)
class MarkerSet:
    """Places of markers on segments.

    A segment is "thorax", "right upper arm", "right elbow" (which flexes, but does not turn with
    the forearm), "right forearm", "right hand", the same of the left, "pelvis" and "abdomen" of
    `human_upper_body`, or any frame or joint of a model. The origin of a segment of a person is its
    proximal joint, that of the thorax lies midway between the shoulders; its axes are x to the
    person's right, y forward and z up with the arms hanging and the palms towards the body.

    >>> import geodesic_ocp as go
    >>> watch = go.MarkerSet("watch", {"dial": ("left forearm", (-0.03, 0.0, -0.22))}, unit="m")

    Attributes:
        name: of the set.
        places: segment and offset (3,) by marker.
        unit: of the offsets: "height" for fractions of the person's height, or "m".
        uncertainty: how far a marker may be from its place, as a standard deviation [m], one for
            all or by marker (0 where it is not named); offsets of markers that are certain are not
            estimated.

    Raises:
        ValueError: an offset that is not three numbers, another unit, or an uncertainty that is
            negative or of a marker that is not in the set.
    """

    name: str
    places: Mapping[str, Place]
    unit: Literal["height", "m"] = "height"
    uncertainty: float | Mapping[str, float] = 0.015

    def __post_init__(self) -> None:
        if self.unit not in ("height", "m"):
            raise ValueError(f"unit must be 'height' or 'm', got {self.unit!r}")
        places = {}
        for marker, place in self.places.items():
            if not isinstance(place, (tuple, list)) or len(place) != 2:
                raise ValueError(f"{marker}: a place is a segment and an offset, got {place!r}")
            x, y, z = as_vector(f"the offset of {marker}", place[1], 3).tolist()
            places[str(marker)] = (str(place[0]), (x, y, z))
        object.__setattr__(self, "places", places)
        given = self.uncertainty
        named = given if isinstance(given, Mapping) else dict.fromkeys(places, given)
        for marker, value in named.items():
            if marker not in places:
                raise ValueError(f"uncertainty: {marker!r} is not a marker of this set")
            as_not_negative(f"uncertainty of {marker}", value)

    def uncertainty_of(self, marker: str) -> float:
        """Standard deviation [m] of a marker's distance from its place."""
        given = self.uncertainty
        return float(given.get(marker, 0.0) if isinstance(given, Mapping) else given)

    def matching(self, names: tuple[str, ...]) -> dict[str, str]:
        """Markers of this set by the names of a recording that mean them.

        Case, spaces, underscores and what precedes a colon (the subject in many c3d files) do not
        count.
        """
        known = {_plain(marker): marker for marker in self.places}
        found: dict[str, str] = {}
        for name in names:
            marker = known.get(_plain(name))
            if marker is not None and marker not in found.values():
                found[name] = marker
        return found

    def __repr__(self) -> str:
        segments = {segment for segment, _ in self.places.values()}
        return f"MarkerSet({self.name!r}, {len(self.places)} markers on {len(segments)} segments)"


def _plain(name: str) -> str:
    return "".join(each for each in name.rpartition(":")[2].lower() if each.isalnum())


def as_marker_set(given: MarkerSet | str | PathLike[str] | None) -> MarkerSet | None:
    """The marker set itself, or the one in a JSON or TOML file with the attributes as its keys.

        {"name": "laboratory", "unit": "m", "uncertainty": {"dial": 0.02},
         "places": {"dial": ["left forearm", [-0.03, 0.0, -0.22]]}}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a marker set nor a path.
    """
    if given is None or isinstance(given, MarkerSet):
        return given
    if not isinstance(given, (str, PathLike)):
        raise ValueError(f"marker_set must be a MarkerSet or a file, got {given!r}")
    return from_record(MarkerSet, Path(given), "places", "a marker set")
