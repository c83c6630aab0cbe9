"""The file of one recording's result: its key, its name, and reading it."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import TEMPORARY, read_record
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.batch.sources.recording_source import RecordingSource

FORMAT, VERSION = "geodesic_ocp result of a recording", 1
RESULTS = "results"  # folder of the results, within that of the output
SYNERGIES = ".synergies.json"
_KEY = re.compile(r"-([0-9a-f]{32})\.json$")


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
    except RecordingError:
        return None
    return record if {"identity", "recordings", "synergies"} <= set(record) else None


def unfinished(folder: Path) -> Iterator[Path]:
    """Temporary files that processes which were killed left among the results."""
    yield from (folder / RESULTS).glob(f"{TEMPORARY}*")
