"""Marker sets whose places are known."""

from __future__ import annotations

import re
from collections.abc import Mapping

from geodesic_ocp.recordings.markers.sets.marker_set import MarkerSet, Place


def _mirrored(places: Mapping[str, Place]) -> dict[str, Place]:
    """The places of the left side from those of the right."""
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
#: The sets among which `fit_motion` chooses.
MARKER_SETS = (MMM_MARKERS, PLUG_IN_GAIT_MARKERS, JOINT_CENTRES)
