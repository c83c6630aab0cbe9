"""OsimConvention: a model, and which of its bodies are the segments of a person."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from geodesic_ocp.arrays import as_number
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS
from geodesic_ocp.records import parse_json

#: Names by which bodies are recognised, in small letters; those of arms follow after a side, as in
#: humerus_r or r_humerus. Without a side ("humerus") it is the one where the shoulder is. Bodies
#: named abdomen carry soft tissue in published models and are no segment of the trunk.
BODY_NAMES: dict[str, tuple[str, ...]] = {
    "pelvis": ("pelvis",),
    "thorax": ("thorax", "torso", "trunk"),
    "upper arm": ("humerus", "upperarm", "upper_arm"),
    "forearm": ("radius", "forearm", "lower_arm", "lowerarm"),
    "hand": ("hand",),
}


@dataclass(frozen=True)
class OsimConvention:
    """The OpenSim model with which a table of coordinates was computed.

    >>> from geodesic_ocp.recordings.opensim_models.osim_convention import OsimConvention
    >>> OsimConvention("arm.osim", {"thorax": "base"}, {"pro_sup": 90.0})
    OsimConvention('arm.osim', thorax: base)

    Attributes:
        model: file (.osim).
        bodies: by segment ("pelvis", "abdomen", "thorax", "right upper arm", ...), the name of the
            body; those without an entry are recognised by `BODY_NAMES`. The forearm's body is the
            one that turns with the palm, the radius.
        neutral: coordinates [deg] of the person who stands upright, arms hanging, palms towards the
            body; those without an entry are 0. Without any entry, the rotation of the forearm in
            that pose is the one in which the axis of wrist flexion points forward.

    Raises:
        ValueError: an unknown segment, or a name or angle of another type.
    """

    model: str | Path
    bodies: Mapping[str, str] = field(default_factory=dict)
    neutral: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.model, (str, Path)) or not str(self.model):
            raise ValueError(f"model must be a file (.osim), got {self.model!r}")
        for name in ("bodies", "neutral"):
            if not isinstance(getattr(self, name), Mapping):
                raise ValueError(f"{name} must be given by name, got {getattr(self, name)!r}")
        for segment, body in self.bodies.items():
            if segment not in SEGMENTS:
                raise ValueError(
                    f"bodies: there is no segment {segment!r}; there are {', '.join(SEGMENTS)}"
                )
            if not isinstance(body, str) or not body:
                raise ValueError(f"bodies: the body of the {segment} must be a name, got {body!r}")
        for coordinate, angle in self.neutral.items():
            as_number(f"neutral {coordinate}", angle)

    def __repr__(self) -> str:
        bodies = "".join(f", {segment}: {body}" for segment, body in self.bodies.items())
        return f"OsimConvention({str(self.model)!r}{bodies})"


def as_osim_convention(given: object) -> OsimConvention | None:
    """The convention itself, that of a file .osim, or that in a JSON file with the key "model".

        {"model": "arm.osim", "bodies": {"thorax": "base"}, "neutral": {"pro_sup": 90}}

    A relative path of the model is one from the folder of the JSON file. None if the argument is
    something else, such as an AngleConvention.

    Raises:
        RecordingError: a JSON file with the key "model" that has other keys or values.
    """
    if isinstance(given, OsimConvention):
        return given
    if not isinstance(given, (str, Path)):
        return None
    file = Path(given)
    if file.suffix.lower() == ".osim":
        return OsimConvention(file)
    record = _record(file) if file.suffix.lower() == ".json" else None
    if not isinstance(record, dict) or "model" not in record:
        return None
    known = [each.name for each in fields(OsimConvention)]
    unknown = [key for key in record if key not in known]
    if unknown:
        raise RecordingError(f"{file}: there is no key {unknown[0]!r}; keys are {', '.join(known)}")
    try:
        convention = OsimConvention(**record)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
    return OsimConvention(file.parent / convention.model, convention.bodies, convention.neutral)


def _record(file: Path) -> Any:
    try:
        return parse_json(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None  # reported where angle conventions are read
