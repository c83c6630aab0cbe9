"""The file of one recording's result: its key, its name, and reading it."""

import hashlib
import json
import os
import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import msgspec

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import TEMPORARY, convert, read_record
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.batch.sources.recording_source import RecordingSource
from geodesic_ocp.studies.tables.columns import (
    IDENTITY_COLUMNS,
    RECORDING_COLUMNS,
    SYNERGY_COLUMNS,
    TableColumn,
)

FORMAT, VERSION = "geodesic_ocp result of a recording", 1
RESULTS = "results"  # folder of the results, within that of the output
SYNERGIES = ".synergies.json"
# Of the rows of recordings, what the summary reads.
_NEEDED = (
    *("method_label", "segments", "height_m", "mass_kg"),
    *("joint_error_rad", "position_error_m", "orientation_error_rad"),
)
_KEY = re.compile(r"-([0-9a-f]{32})\.json$")


def _row_type(columns: Sequence[TableColumn], needed: Sequence[str]) -> Any:
    types: dict[str, Any] = {"text": str, "integer": int | None, "number": float | None}
    fields = [
        (each.name, types[each.kind], msgspec.NODEFAULT if each.name in needed else None)
        for each in columns
    ]
    return msgspec.defstruct("Row", fields, kw_only=True, forbid_unknown_fields=True)


# What the tables and the outcome are made of.
_Result: Any = msgspec.defstruct(
    "Result",
    [
        ("identity", _row_type(IDENTITY_COLUMNS, [each.name for each in IDENTITY_COLUMNS])),
        ("own_subject", str),
        ("probes", tuple[int, Annotated[list[float], msgspec.Meta(min_length=1)]]),
        ("recordings", list[_row_type(RECORDING_COLUMNS, _NEEDED)]),  # type: ignore[misc]
        ("synergies", list[_row_type(SYNERGY_COLUMNS, ())]),  # type: ignore[misc]
        ("warnings", list[str]),
    ],
)


def result_key(source: RecordingSource, settings: AnalysisSettings) -> str:
    """32 digits that change with the file's content, the side, the settings and the package.

    With an AMC file, also with the skeletons (.asf) beside it.

    Raises:
        OSError: the file cannot be read.
    """
    digest = hashlib.sha256()
    files = [source.path]
    if source.path.suffix.lower() == ".amc":
        files += sorted(each for each in source.path.parent.glob("*.[aA][sS][fF]"))
    for file in files:
        with file.open("rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    known = [source.side, source.height, source.mass, settings.digest(), version("geodesic_ocp")]
    digest.update(json.dumps(known).encode())
    return digest.hexdigest()[:32]


def result_name(source: RecordingSource, key: str) -> str:
    """Name of the file of a result."""
    stem = re.sub(r"[^\w.-]+", "_", source.path.stem)[:100]
    return f"{stem}-{source.side}-{key}.json"


def results_by_key(folder: Path) -> dict[str, Path]:
    """The files of results in the output folder, by key; none is opened."""
    found = {}
    for name in sorted(os.listdir(folder / RESULTS)) if (folder / RESULTS).is_dir() else ():
        if match := _KEY.search(name):
            found[match[1]] = folder / RESULTS / name
    return found


def read_result(path: Path) -> dict[str, Any] | None:
    """The record of a result; None if the file is missing, damaged or of another version."""
    try:
        record = read_record(path, FORMAT, VERSION, "a result")
        rows = convert(record, _Result, path).recordings
    except RecordingError:
        return None
    # The outcome states the errors of the first row.
    has_errors = rows and None not in (rows[0].joint_error_rad, rows[0].position_error_m)
    return record if has_errors else None


def unfinished(folder: Path) -> Iterator[Path]:
    """Temporary files that processes which were killed left among the results."""
    yield from (folder / RESULTS).glob(f"{TEMPORARY}*")
