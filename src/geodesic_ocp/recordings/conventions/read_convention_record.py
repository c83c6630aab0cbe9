"""JSON and TOML files in which users define conventions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError


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
        return _from_toml(text) if file.suffix.lower() == ".toml" else json.loads(text)
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


def _from_toml(text: str) -> object:
    import tomllib

    return tomllib.loads(text)
