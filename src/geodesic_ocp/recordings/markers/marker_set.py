"""Marker sets: where markers are fixed to a person's segments or a model's frames."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from geodesic_ocp.arrays import as_not_negative, as_vector
from geodesic_ocp.records import as_stated

Place = tuple[str, tuple[float, float, float]]


@dataclass(frozen=True, repr=False)
class MarkerSet:
    """Places of markers on segments.

    A segment is "thorax", "right upper arm", "right elbow" (which flexes, but does not turn with
    the forearm), "right forearm", "right hand", the same of the left, "pelvis" and "abdomen" of
    `human_upper_body`, or any frame or joint of a model. The origin of a segment of a person is its
    proximal joint, that of the thorax lies midway between the shoulders; its axes are x to the
    person's right, y forward and z up with the arms hanging and the palms towards the body.

    >>> dial = ("left forearm", (-0.03, 0.0, -0.22))
    >>> watch = go.recordings.MarkerSet("watch", {"dial": dial}, unit="m")

    Attributes:
        name: name of the set.
        places: segment and offset (3,) by marker.
        unit: unit of the offsets: "height" for fractions of the person's height, or "m".
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


def as_marker_set(given: MarkerSet | str | PathLike[str] | None) -> MarkerSet | None:
    """Return the marker set itself, or the one in a JSON or TOML file with the attributes as its
    keys.

        {"name": "laboratory", "unit": "m", "uncertainty": {"dial": 0.02},
         "places": {"dial": ["left forearm", [-0.03, 0.0, -0.22]]}}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a marker set nor a path.
    """
    file = Path(given) if isinstance(given, PathLike) else given
    return as_stated(MarkerSet, file, "marker_set", "a marker set")


def _mirrored(places: Mapping[str, Place]) -> dict[str, Place]:
    """Return the places of the left side from those of the right."""
    return {
        re.sub("^R", "L", marker.replace("right", "left")): (
            segment.replace("right", "left"),
            (-x, y, z),
        )
        for marker, (segment, (x, y, z)) in places.items()
    }


def _per_mille(places: Mapping[str, Place]) -> dict[str, Place]:
    return {
        marker: (segment, (1e-3 * x, 1e-3 * y, 1e-3 * z))
        for marker, (segment, (x, y, z)) in places.items()
    }


# The reference model of the Master Motor Map (its model file, sensors of type position), in
# thousandths of the body height, the fingers straight. Its left and right sides mirror each other,
# except for RBAK, which is a marker of another place than LBAK, and for RHPS, which in the file
# lies in the middle of the hand, 16 thousandths away from where LHPS lies on the left (the signs of
# the right hand's fingers are not mirrored): here it mirrors LHPS.
_THORAX: dict[str, Place] = {
    "C7": ("thorax", (0.0, -38.9454, 21.3116)),
    "CLAV": ("thorax", (-0.205368, 51.8562, -9.823)),
    "STRN": ("thorax", (-0.205368, 68.433, -115.98)),
    "T10": ("thorax", (0.0, -62.5189, -111.766)),
    "RBAK": ("thorax", (42.896, -67.987, -77.706)),
    "LBAK": ("thorax", (-46.7836, -51.365, 7.07746)),
    "RSHO": ("thorax", (94.7, -1.13565, 19.954)),
    "LSHO": ("thorax", (-94.7, -1.13565, 19.954)),
}
_ARM: dict[str, Place] = {
    "RAEL": ("right upper arm", (30.0, 0.0, -188.0)),
    "RUPA": ("right upper arm", (26.233, 2.6444, -61.47)),
    "RAOL": ("right elbow", (0.0, -30.0, 0.0)),
    "RFRA": ("right forearm", (15.4, 0.930038, -81.4575)),
    "RWPS": ("right forearm", (15.0, -17.5, -142.0)),
    "RWTS": ("right forearm", (15.0, 17.5, -142.0)),
    "RHTS": ("right hand", (9.3514, 12.663, -46.388)),
    "RHPS": ("right hand", (8.358, -21.035, -39.043)),
    "RIFD": ("right hand", (7.5, 13.554, -98.704)),
}
_PELVIS: dict[str, Place] = {
    "RASI": ("pelvis", (67.77, 43.9811, 34.9948)),
    "LASI": ("pelvis", (-67.7722, 43.9811, 34.9948)),
    "RPSI": ("pelvis", (37.085, -60.0, 34.9948)),
    "LPSI": ("pelvis", (-37.085, -60.0, 34.9948)),
    "L3": ("pelvis", (0.0, -50.0, 78.222)),
}
_CERTAINTY = 0.015  # [m]
# The shoulder girdle moves on the thorax, skin on the upper arm, and the index finger on the hand.
_UNCERTAIN = {"SHO": 0.02, "UPA": 0.025, "FRA": 0.025, "IFD": 0.03}

_MMM_PLACES = _per_mille({**_THORAX, **_PELVIS, **_ARM, **_mirrored(_ARM)})
#: The markers of the Master Motor Map on pelvis, thorax and arms.
MMM_MARKERS = MarkerSet(
    "Master Motor Map",
    _MMM_PLACES,
    uncertainty={name: _UNCERTAIN.get(name[1:], _CERTAINTY) for name in _MMM_PLACES},
)

# Markers at anatomical landmarks that the Master Motor Map's set has, too, by the names that they
# have in Plug-in Gait. The offsets are those of the corresponding landmarks and, as the set is
# placed by hand, uncertain; of RUPA and RFRM only the segment is known.
_LANDMARKS = {"ELB": "AEL", "WRA": "WTS", "WRB": "WPS", "FRM": "FRA"}
_PLUG_IN_ARM: dict[str, Place] = {
    "RUPA": _ARM["RUPA"],
    **{f"R{name}": _ARM[f"R{like}"] for name, like in _LANDMARKS.items()},
    # On the back of the hand, below the head of the third metacarpal.
    "RFIN": ("right hand", (9.0, 0.0, -45.0)),
}
_PLUG_IN_PLACES = _per_mille(
    {
        **{name: place for name, place in _THORAX.items() if name != "LBAK"},
        **{name: place for name, place in _PELVIS.items() if name != "L3"},
        **_PLUG_IN_ARM,
        **_mirrored(_PLUG_IN_ARM),
    }
)
_FREE = {"UPA": 0.06, "FRM": 0.06}
#: The markers of the trunk and arms in Plug-in Gait, at uncertain places.
PLUG_IN_GAIT_MARKERS = MarkerSet(
    "Plug-in Gait",
    _PLUG_IN_PLACES,
    uncertainty={name: _FREE.get(name[1:], 0.025) for name in _PLUG_IN_PLACES},
)

# The knuckles are the joints of the Master Motor Map's left hand, mirrored (see above).
_JOINTS: dict[str, Place] = {
    "right shoulder": ("right upper arm", (0.0, 0.0, 0.0)),
    "right elbow": ("right forearm", (0.0, 0.0, 0.0)),
    "right wrist": ("right hand", (0.0, 0.0, 0.0)),
    "right index knuckle": ("right hand", (0.0, 13.554, -48.3)),
    "right middle knuckle": ("right hand", (0.0, 0.0, -48.2)),
    "right little knuckle": ("right hand", (0.0, -21.68, -39.57)),
}
#: Centres of the joints of both arms, and of the joints between metacarpals and fingers.
JOINT_CENTRES = MarkerSet(
    "joint centres", _per_mille({**_JOINTS, **_mirrored(_JOINTS)}), uncertainty=0.0
)
#: The sets among which `fit_markers` chooses.
MARKER_SETS = (MMM_MARKERS, PLUG_IN_GAIT_MARKERS, JOINT_CENTRES)
