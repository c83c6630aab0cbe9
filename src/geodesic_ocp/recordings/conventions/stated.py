"""Records that users state: themselves, or as the keys of a JSON or TOML file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar

from geodesic_ocp.records import decoding, read_structured

Stated = TypeVar("Stated", bound=Any)


def as_stated(
    kind: type[Stated],
    given: Stated | str | Path | None,
    argument: str,
    what: str,
    known: Sequence[Stated] = (),
) -> Stated | None:
    """Return the record itself, or the one in a JSON or TOML file with its attributes as keys.

    Args:
        kind: dataclass; the file's name stands in for its attribute `name`.
        given: a value of this dataclass or a file.
        argument: name of the argument, for messages.
        what: the record is, for messages, such as "a convention".
        known: records that a file may name by "extends", whose attributes are then its defaults.

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a record nor a path.
    """
    if given is None or isinstance(given, kind):
        return given
    if not isinstance(given, (str, Path)):
        raise ValueError(f"{argument} must be a {kind.__name__} or a file, got {given!r}")
    file = Path(given)
    record = read_structured(file, "convention")
    with decoding(file):
        defaults = {"name": file.stem}
        if known and isinstance(record, dict) and "extends" in record:
            bases = {each.name: each for each in known}
            base = record.pop("extends")
            if base not in bases:
                raise ValueError(f"extends must be one of {', '.join(bases)}, got {base!r}")
            inherited = {each.name: getattr(bases[base], each.name) for each in fields(kind)}
            defaults = inherited | defaults
        return from_record(kind, what, record, defaults)


def from_record(
    kind: type[Stated],
    what: str,
    record: Any,
    defaults: dict[str, Any] | None = None,
    **parts: Callable[[list[Any]], Any],
) -> Stated:
    """Return the dataclass of this kind whose attributes are the keys of a record.

    Args:
        kind: dataclass.
        what: it is, for messages, such as "a convention".
        record: object of a JSON or TOML file.
        defaults: values of attributes that the record may leave out.
        parts: from the list that an attribute must be to its value, by attribute.

    Raises:
        ValueError: a key that is unknown or missing, a part that is no list, or what the dataclass
            refuses.
    """
    values: dict[str, Any] = dict(defaults or {})
    known = fields(kind)
    required = [
        each.name
        for each in known
        if each.default is each.default_factory is MISSING and each.name not in values
    ]
    keys = f"{what} has the keys {', '.join(each.name for each in known)}"
    if required:
        keys += f", of which {' and '.join(map(repr, required))} is required"
    if not isinstance(record, dict):
        raise ValueError(f"{keys}, got {str(record)[:80]}")
    if unknown := sorted(set(record) - {each.name for each in known}):
        raise ValueError(f"{keys}, not {unknown[0]!r}")
    if not set(required) <= set(record):
        raise ValueError(f"{keys}, got {str(record)[:80]}")
    values |= record
    for name, read in parts.items():
        if name in record:
            if not isinstance(record[name], list):
                raise ValueError(f"{name} must be a list, got {record[name]!r}")
            values[name] = read(record[name])
    stated: Stated = kind(**values)
    return stated
