"""JSON and TOML files in which users define conventions."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import parse_json

Stated = TypeVar("Stated", bound=Any)


def read_convention_record(file: Path, hint: str = "") -> Any:
    """The content of a JSON file, or of a TOML file (.toml), not yet checked.

    Args:
        file: to read.
        hint: follows the message when the file cannot be opened.

    Raises:
        RecordingError: the file is missing or malformed.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
        return _from_toml(text) if file.suffix.lower() == ".toml" else parse_json(text)
    except FileNotFoundError:
        raise RecordingError(f"{file}: cannot be read: there is no such file{hint}") from None
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror}{hint}") from None
    except ImportError:
        raise RecordingError(
            f"{file}: TOML needs Python 3.11 or later; write the convention as JSON"
        ) from None
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{file}: is not a convention in JSON or TOML: {failure}") from None


def from_record(kind: type[Stated], file: Path, required: str, what: str) -> Stated:
    """The dataclass of this kind whose attributes are the keys of a JSON or TOML file.

    Args:
        kind: has the attribute `name`, for which the name of the file stands in.
        file: to read.
        required: attribute that the file must have.
        what: the content is, for messages, such as "a convention".

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
    """
    record = read_convention_record(file)
    known = [each.name for each in fields(kind)]
    if not isinstance(record, dict) or required not in record or not set(record) <= set(known):
        raise RecordingError(
            f"{file}: {what} has the keys {', '.join(known)}, of which {required!r} is required"
        )
    try:
        stated: Stated = kind(**{"name": file.stem, **record})
    except (AttributeError, TypeError, ValueError) as failure:
        raise RecordingError(f"{file}: {failure}") from None
    return stated


def _from_toml(text: str) -> object:
    import tomllib

    return tomllib.loads(text)
