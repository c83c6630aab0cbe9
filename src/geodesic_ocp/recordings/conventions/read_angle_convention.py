"""as_angle_convention: a convention from its name, its record or a file."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    AxisRotation,
    SegmentRelation,
)
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.records import read_json_or_toml


def as_angle_convention(given: AngleConvention | str | Path | None) -> AngleConvention | None:
    """Return the convention itself, the built-in one of this name, or the one in a JSON or TOML
    file.

    Files have the attributes of AngleConvention, SegmentRelation and AxisRotation as keys. With
    "extends", the relations of a built-in convention precede those in the file, which replace those
    of the same segment:

        {"name": "mine", "extends": "opensim_upper_limb", "relations": [
            {"segment": "right hand", "parent": "right forearm", "rotations": [
                {"axis": "-z", "column": "deviation"}, {"axis": "x", "column": "flexion"}]}]}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a convention, nor the name of one, nor a path.
    """
    if given is None or isinstance(given, AngleConvention):
        return given
    if isinstance(given, str) and given in ANGLE_CONVENTIONS:
        return ANGLE_CONVENTIONS[given]
    if not isinstance(given, (str, Path)):
        raise ValueError(
            f"convention must be an AngleConvention, one of {', '.join(ANGLE_CONVENTIONS)}, or a "
            f"file, got {given!r}"
        )
    file = Path(given)
    known = ", ".join(ANGLE_CONVENTIONS)
    record = read_json_or_toml(file, "convention", f"; built-in conventions are {known}")
    try:
        return _convention(file.stem, record)
    except (TypeError, ValueError) as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _convention(name: str, record: Any) -> AngleConvention:
    record = _checked("a convention", record, AngleConvention, ("extends",))
    relations = {}
    base = record.pop("extends", None)
    inherited: dict[str, Any] = {}
    if base is not None:
        if not isinstance(base, str) or base not in ANGLE_CONVENTIONS:
            raise ValueError(f"extends must be one of {', '.join(ANGLE_CONVENTIONS)}, got {base!r}")
        known = ANGLE_CONVENTIONS[base]
        relations = {relation.segment: relation for relation in known.relations}
        inherited = {each.name: getattr(known, each.name) for each in fields(AngleConvention)}
    for entry in _listed("relations", record.pop("relations", [])):
        relation = _relation(entry)
        relations[relation.segment] = relation
    return AngleConvention(
        **(inherited | {"name": name} | record | {"relations": tuple(relations.values())})
    )


def _relation(record: Any) -> SegmentRelation:
    record = _checked("a relation", record, SegmentRelation)
    if "segment" not in record:
        raise ValueError(f"a relation must have a segment, got {record!r}")
    for name in ("rotations", "neutral"):
        if name in record:
            turns = [
                _checked("a rotation", each, AxisRotation) for each in _listed(name, record[name])
            ]
            record[name] = tuple(AxisRotation(**turn) for turn in turns)
    return SegmentRelation(**record)


def _listed(name: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{name} must be a list, got {value!r}")
    return value


def _checked(what: str, record: Any, kind: type, others: tuple[str, ...] = ()) -> dict[str, Any]:
    known = [each.name for each in fields(kind)] + list(others)
    if not isinstance(record, dict) or not set(record) <= set(known):
        raise ValueError(f"{what} has the keys {', '.join(known)}, got {str(record)[:80]}")
    return dict(record)
