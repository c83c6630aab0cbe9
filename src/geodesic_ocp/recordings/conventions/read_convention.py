"""as_convention: how to read a table, from a convention, its name or a file."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    AxisRotation,
    SegmentRelation,
)
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention
from geodesic_ocp.recordings.conventions.stated import from_record
from geodesic_ocp.records import decoding, read_structured


def as_convention(
    given: AngleConvention | OsimConvention | str | Path | None,
) -> AngleConvention | OsimConvention | None:
    """Return the convention itself, the built-in one of this name, or the one in a file.

    A file is a model (.osim), or one in JSON or TOML that has the attributes of an OsimConvention
    or of AngleConvention, SegmentRelation and AxisRotation as keys:

        {"model": "arm.osim", "bodies": {"thorax": "base"}, "neutral": {"pro_sup": 90}}

        {"name": "mine", "extends": "opensim_upper_limb", "relations": [
            {"segment": "right hand", "parent": "right forearm", "rotations": [
                {"axis": "-z", "column": "deviation"}, {"axis": "x", "column": "flexion"}]}]}

    A relative path of the model is one from the folder of the file. With "extends", the relations
    of a built-in convention precede those in the file, which replace those of the same segment.

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a convention, nor the name of one, nor a path.
    """
    if given is None or isinstance(given, (AngleConvention, OsimConvention)):
        return given
    known = ", ".join(ANGLE_CONVENTIONS)
    if not isinstance(given, (str, Path)):
        raise ValueError(
            f"convention must be an AngleConvention, one of {known}, or a file, got {given!r}"
        )
    if str(given) in ANGLE_CONVENTIONS:
        return ANGLE_CONVENTIONS[str(given)]
    file = Path(given)
    if file.suffix.lower() == ".osim":
        return OsimConvention(file)
    record = read_structured(file, "convention", f"; built-in conventions are {known}")
    with decoding(file):
        if not isinstance(record, dict) or "model" not in record:
            return _angle_convention(file.stem, record)
        found = from_record(OsimConvention, "the convention of a model", record)
        return replace(found, model=file.parent / found.model)


def _angle_convention(name: str, record: Any) -> AngleConvention:
    defaults: dict[str, Any] = {"relations": ()}
    if isinstance(record, dict) and "extends" in record:
        base = record["extends"]
        if not isinstance(base, str) or base not in ANGLE_CONVENTIONS:
            raise ValueError(f"extends must be one of {', '.join(ANGLE_CONVENTIONS)}, got {base!r}")
        known = ANGLE_CONVENTIONS[base]
        defaults = {each.name: getattr(known, each.name) for each in fields(known)}
        record = {key: value for key, value in record.items() if key != "extends"}

    def relations(entries: list[Any]) -> tuple[SegmentRelation, ...]:
        own = (
            from_record(SegmentRelation, "a relation", each, rotations=_turns, neutral=_turns)
            for each in entries
        )
        return tuple({each.segment: each for each in (*defaults["relations"], *own)}.values())

    defaults["name"] = name
    return from_record(AngleConvention, "a convention", record, defaults, relations=relations)


def _turns(entries: list[Any]) -> tuple[AxisRotation, ...]:
    return tuple(from_record(AxisRotation, "a rotation", each) for each in entries)
