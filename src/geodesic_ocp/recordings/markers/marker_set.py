"""Marker sets: where markers are fixed to a person's segments or a model's frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Literal

from geodesic_ocp.arrays import as_choice, as_not_negative, as_vector, settle
from geodesic_ocp.records import as_stated

Place = tuple[str, tuple[float, float, float]]


@dataclass(frozen=True, repr=False)
class MarkerSet:
    """Places of markers on segments.

    A segment is "thorax", "right shoulder" (the centre of the joint, of either shoulder for any
    arm), "right upper arm", "right elbow" (which flexes, but does not turn with the forearm),
    "right forearm", "right hand", the same of the left, "pelvis" and "abdomen" of
    `human_upper_body`, "trunk" (its pelvis, which is rigid with the thorax of a single arm), or any
    frame or joint of a model. The origin of a segment of a person is its proximal joint, that of
    the thorax lies midway between the shoulders; its axes are x to the person's right, y forward
    and z up with the arms hanging and the palms towards the body.

    >>> dial = ("left forearm", (-0.03, 0.0, -0.22))
    >>> watch = go.recordings.MarkerSet("watch", {"dial": dial}, unit="m")

    Attributes:
        name: name of the set.
        places: segment and offset (3,) by marker.
        unit: unit of the offsets: "height" for fractions of the person's height, or "m".
        uncertainty: how far a marker may be from its place, as a standard deviation [m], one for
            all or by marker (0 where it is not named); offsets of markers that are certain are not
            estimated.
        source: where names and places are from.

    Raises:
        ValueError: an offset that is not three numbers, another unit, or an uncertainty that is
            negative or of a marker that is not in the set.
    """

    name: str
    places: Mapping[str, Place]
    unit: Literal["height", "m"] = "height"
    uncertainty: float | Mapping[str, float] = 0.015
    source: str = ""

    def __post_init__(self) -> None:
        if self.unit not in ("height", "m"):
            raise ValueError(f"unit must be 'height' or 'm', got {self.unit!r}")
        places = {}
        for marker, place in self.places.items():
            if not isinstance(place, (tuple, list)) or len(place) != 2:
                raise ValueError(f"{marker}: a place is a segment and an offset, got {place!r}")
            x, y, z = as_vector(f"the offset of {marker}", place[1], 3).tolist()
            places[str(marker)] = (str(place[0]), (x, y, z))
        settle(self, places=places)
        given = self.uncertainty
        named = given if isinstance(given, Mapping) else dict.fromkeys(places, given)
        for marker, value in named.items():
            if marker not in places:
                raise ValueError(f"uncertainty: {marker!r} is not a marker of this set")
            as_not_negative(f"uncertainty of {marker}", value)

    def uncertainty_of(self, marker: str) -> float:
        """Return standard deviation [m] of a marker's distance from its place."""
        given = self.uncertainty
        return float(given.get(marker, 0.0) if isinstance(given, Mapping) else given)

    def matching(self, names: tuple[str, ...]) -> dict[str, str]:
        """Return markers of this set by the names of a recording that mean them.

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


def check_known(name: str) -> None:
    """Raise ValueError, which lists the names of the known sets, if this is neither one nor a
    file.
    """
    if not Path(name).is_file():
        as_choice("marker_set, which is no file,", name, marker_sets())


def as_marker_set(given: MarkerSet | str | PathLike[str] | None) -> MarkerSet | None:
    """Return the marker set itself, the one of this name, or the one in a JSON or TOML file with
    the attributes as its keys.

        {"name": "laboratory", "unit": "m", "uncertainty": {"dial": 0.02},
         "places": {"dial": ["left forearm", [-0.03, 0.0, -0.22]]}}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a marker set, a known name nor a path.
    """
    if isinstance(given, str):
        check_known(given)
        if given in marker_sets():
            return marker_sets()[given]
    file = Path(given) if isinstance(given, PathLike) else given
    return as_stated(MarkerSet, file, "marker_set", "a marker set")


_FOLDER = Path(__file__).resolve().parents[2] / "data" / "marker_sets"


@cache
def marker_sets() -> dict[str, MarkerSet]:
    """Return the sets among which `fit_markers` chooses, by name: those of the package's data."""
    found = [as_stated(MarkerSet, file, "", "a marker set") for file in sorted(_FOLDER.iterdir())]
    return {each.name: each for each in found if each is not None}
