"""Results of recordings as files: tasks, outcomes, keys, and the tables made from them."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from scipy.spatial import KDTree

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import TEMPORARY, read_record, write_file
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.sources import RecordingSource, alike, identity, may_be_one
from geodesic_ocp.studies.study_tables import (
    PARQUET_HINT,
    TABLES,
    Row,
    doubtful_recordings,
    has_parquet,
    new_rows,
    write_table,
)
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.uncertainty import Uncertainty
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.recording import PASSIVE

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

OutcomeKind = Literal["analysed", "found", "file", "solver", "process", "same", "missing", "error"]


class Drawing(Protocol):
    """Draws the figure of an analysis, such as `go.plot`; processes import it from its module."""

    def __call__(self, analysis: Analysis, /, *, uncertainty: Uncertainty | None) -> Figure:
        """Return the figure, in which cuts are stable or doubtful if the uncertainty is known."""


@dataclass(frozen=True, repr=False)
class RecordingTask:
    """A recording that is to be analysed."""

    source: RecordingSource
    settings: AnalysisSettings
    folder: Path  # folder of the output, absolute
    key: str  # key of the result, see `result_key`
    time_limit: float | None = None  # time limit of the process that analyses it [s], or None
    fit: bool = False  # whether the result has the profile of the joint inertia
    draw: Drawing | None = None  # draws its figure; None: it has none

    def __repr__(self) -> str:
        return f"RecordingTask({self.source.name!r}, {self.key[:8]})"


@dataclass(frozen=True, repr=False)
class RecordingOutcome:
    """Outcome of the analysis of a recording.

    Attributes:
        source: source of the recording.
        kind: "analysed" now, or "found" with a result from before; or why there is none: the
            "file" cannot be used, a "solver" failed, its "process" died, its motion is the "same"
            as another's, it is "missing" as nobody has analysed it yet, or another "error".
        text: the result, or the reason, in one sentence.
        key: key of the result; empty if there is none.
        warnings: warnings that the analysis gave.
        seconds: seconds that the analysis took.
    """

    source: RecordingSource
    kind: OutcomeKind
    text: str = ""
    key: str = ""
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def success(self) -> bool:
        """True if there is a result."""
        return self.kind in ("analysed", "found")

    def __str__(self) -> str:
        """Return the outcome as a line of text."""
        return f"{self.source.name}: {self.text}"

    def __repr__(self) -> str:
        return f"RecordingOutcome({self.source.name!r}, {self.kind}: {self.text})"


FORMAT = "geodesic_ocp result of a recording"
VERSION = 1
RESULTS = "results"  # folder of the results, within that of the output
SYNERGIES = ".synergies.json"
_KEY = re.compile(r"-([0-9a-f]{32})\.json$")


def result_key(source: RecordingSource, settings: AnalysisSettings) -> str:
    """Return 32 digits that change with file content, part, side, settings and package.

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
    known += [] if source.part is None else [source.part]
    digest.update(json.dumps(known).encode())
    return digest.hexdigest()[:32]


def result_name(source: RecordingSource, key: str) -> str:
    """Return name of the file of a result."""
    stem = re.sub(r"[^\w.-]+", "_", source.path.stem)[:100]
    part = "" if source.part is None else f"-part{source.part}"
    return f"{stem}{part}-{source.side}-{key}.json"


def results_by_key(folder: Path) -> dict[str, Path]:
    """Return the files of results in the output folder, by key; none is opened."""
    found = {}
    for name in sorted(os.listdir(folder / RESULTS)) if (folder / RESULTS).is_dir() else ():
        if match := _KEY.search(name):
            found[match[1]] = folder / RESULTS / name
    return found


def write_result(path: Path, record: dict[str, Any]) -> None:
    """Write the record of a result, with a checksum of it."""
    content = {"format": FORMAT, "version": VERSION, **record}
    text = json.dumps({**content, "checksum": _checksum(content)}, allow_nan=False)
    write_file(path, text, lasting=True)


def read_result(path: Path, fit: bool = False, figure: bool = False) -> dict[str, Any] | None:
    """Return the record of a result; None if the file is missing, damaged or of another version.

    Args:
        path: path of the file.
        fit: also None if the result has no profile of the joint inertia.
        figure: also None if it has no figure.
    """
    try:
        record = read_record(path, FORMAT, VERSION, "a result")
    except RecordingError:
        return None
    if (fit and "profiles" not in record) or (figure and not figure_file(path).is_file()):
        return None
    return record if record.pop("checksum", None) == _checksum(record) else None


def figure_file(path: Path) -> Path:
    """Return the path of the figure that belongs to the file of a result."""
    return path.with_suffix(".png")


def _checksum(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()


_FILE = ".lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder for this run alone, without what killed processes have left among the
    results.

    Raises:
        ValueError: another run works in this folder; names its process.
        OSError: the folder cannot be written to.
    """
    with open(folder / _FILE, "a+", encoding="utf-8") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as failure:
            if failure.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            stream.seek(0)
            who = stream.read().strip() or "unknown"
            raise ValueError(
                f"{folder}: another run works in this folder (process {who}); wait for it to end, "
                "or choose another folder"
            ) from None
        stream.truncate(0)
        stream.write(f"{os.getpid()}\n")
        stream.flush()
        _clean(folder)
        yield
        _clean(folder)


def _clean(folder: Path) -> None:
    for file in (folder / RESULTS).glob(f"{TEMPORARY}*"):
        file.unlink(missing_ok=True)


_SAME = 1e-6  # [rad]; formats print angles with at least this precision


def equal_motions(motions: Sequence[tuple[str, int, list[float]] | None]) -> dict[int, int]:
    """Return the index of the first of several equal motions, by the indices of the later ones.

    Motions are equal if they are of the same side, have as many samples, and differ by at most
    1e-6 rad in every probe.

    Args:
        motions: sides, numbers of samples, and probes; None is equal to none.
    """
    groups = defaultdict(list)
    for number, motion in enumerate(motions):
        if motion is not None:
            side, samples, probes = motion
            groups[side, samples, len(probes)].append((number, probes))
    first: dict[int, int] = {}
    for own in groups.values():
        numbers, probes_of_all = zip(*own, strict=True)
        for i, j in sorted(KDTree(probes_of_all).query_pairs(_SAME, p=np.inf)):
            if numbers[i] not in first:
                first.setdefault(numbers[j], numbers[i])
    return first


def notes_of(rows: Sequence[Row], others: int) -> Iterator[str]:
    """Yield subjects named after files, trials and people that may be there twice, assumed heights
    and masses, and results that are in no table.

    Args:
        rows: rows of the table of recordings.
        others: number of results in the folder that are of other recordings or settings.
    """
    recordings = list({row["recording"]: row for row in rows}.values())
    of_all = f"of {len(recordings)} recordings"
    files = sum(row.get("subject_from") == "file name" for row in recordings)
    if len(recordings) > 1 and files:
        yield (
            f"Subjects of {files} {of_all} are named after their files, as nothing else names "
            "them: recordings of one person would count as several subjects. State the subjects "
            "with a table (--subjects) or by the paths (--subject-from)."
        )
    by_name: dict[tuple[str, str], set[str]] = {}
    for row in recordings:
        name = str(row["file"]).rpartition(".")[0]
        by_name.setdefault((name, str(row["side"])), set()).add(str(row["file"]))
    twice = sorted({", ".join(sorted(each)) for each in by_name.values() if len(each) > 1})
    if twice:
        yield (
            f"The same trial may be there twice, as files of one name have several formats "
            f"({'; '.join(twice[:5])}): statistics would count it twice. Leave one out."
        )
    named = (str(row["subject"]) for row in recordings if row.get("subject_from") != "file name")
    for names in alike(named):
        yield f"{may_be_one(names)}: if so, state one name with --subjects."
    passive = [str(row["recording"]) for row in recordings if _is_passive(row)]
    if passive and len(passive) < len(recordings):
        yield (
            "Passive arms, in which no joint moves by more than 20 deg, are not in the means: "
            f"{'; '.join(passive)}."
        )
    yield from doubtful_recordings(recordings)
    for name, unit in (("height", "m"), ("mass", "kg")):
        assumed = [row for row in recordings if row.get(f"{name}_from") == "assumed"]
        if assumed:
            value = f"{assumed[0][f'{name}_{unit}']} {unit}"
            yield (
                f"Assumed, not in the recording: a body {name} of {value} in {len(assumed)} "
                f"{of_all}."
            )
    if others:
        many = "s in the folder are" if others > 1 else " in the folder is"
        yield (
            f"{others} other result{many} of other recordings, settings or versions, and in none "
            "of the tables."
        )


def _is_passive(row: Row) -> bool:
    reached = row.get("range_rad")
    return isinstance(reached, float) and reached < PASSIVE


Rows = dict[str, list[Row]]  # by the name of the table


def collect(
    folder: Path, outcomes: Sequence[RecordingOutcome]
) -> tuple[Rows, list[RecordingOutcome]]:
    """Return rows of all results, and outcomes in which one of several equal motions is kept."""
    paths = results_by_key(folder)
    records = [read_result(paths[each.key]) if each.key in paths else None for each in outcomes]
    pairs = zip(outcomes, records, strict=True)
    same = equal_motions([None if r is None else (o.source.side, *r["probes"]) for o, r in pairs])
    rows: Rows = {name: [] for name in TABLES}
    kept = []
    for number, (outcome, record) in enumerate(zip(outcomes, records, strict=True)):
        if outcome.success and record is None:
            text = "its result has disappeared from the folder"
            outcome = RecordingOutcome(outcome.source, "error", text)
        elif number in same:
            text = f"holds the same motion as {outcomes[same[number]].source.name}"
            outcome = RecordingOutcome(outcome.source, "same", text)
        elif record is not None:
            names = identity(outcome.source, record["own_subject"])
            for table in ("recordings", "synergies", "profiles"):
                rows[table] += [names | row for row in record.get(table, ())]
        if not outcome.success:
            rows["failures"].append(_failure_row(outcome))
        kept.append(outcome)
    return rows, kept


def other_results(folder: Path, outcomes: Iterable[RecordingOutcome]) -> int:
    """Return number of results in the folder that belong to none of these recordings."""
    return len(set(results_by_key(folder)) - {outcome.key for outcome in outcomes})


def write_tables(
    folder: Path,
    rows: Rows,
    outcomes: Sequence[RecordingOutcome],
    settings: AnalysisSettings,
    notes: Sequence[str],
) -> tuple[Path, ...]:
    """Write the tables, that of profiles if there are any, and summary.md; returns the paths."""
    subjects = {row["subject"] for row in rows["recordings"]}
    failures = [outcome for outcome in outcomes if not outcome.success]
    warned = [outcome for outcome in outcomes if outcome.success and outcome.warnings]
    count = len(outcomes) - len(failures)
    missing = sum(outcome.kind == "missing" for outcome in failures)
    waiting = f", {missing} of them as nobody has analysed them yet" if missing else ""
    lines = [
        "# Analysis of many recordings",
        "",
        f"{count} recordings of {len(subjects)} subjects, {len(rows['synergies'])} geodesic "
        f"synergies; {len(failures)} recordings are left out{waiting}.",
        "",
        f"Settings: `{settings!r}` (those not named are the defaults).",
    ]
    for note in notes:
        lines += ["", note]
    if not has_parquet():
        lines += ["", f"The tables are CSV alone. {PARQUET_HINT}."]
    if rows["recordings"]:
        means = mean_errors(new_rows(rows["recordings"], "recordings"))
        lines += ["", "## Mean errors over the recordings", "", markdown(means).rstrip()]
    for title, header, entries in (
        ("Left out", "kind reason", [(o.source.name, o.kind, o.text) for o in failures]),
        ("Warnings", "warning", [(o.source.name, "; ".join(o.warnings)) for o in warned]),
    ):
        if entries:
            cells = [[" ".join(text.split()).replace("|", "\\|") for text in e] for e in entries]
            table = markdown(new_table(("recording", *header.split()), cells))
            lines += ["", f"## {title}", "", table.rstrip()]
    if not rows["profiles"]:  # nor those of an earlier command
        for suffix in (".csv", ".parquet"):
            (folder / f"profiles{suffix}").unlink(missing_ok=True)
    tables = {name: own for name, own in rows.items() if own or name != "profiles"}
    files = [file for name, own in tables.items() for file in write_table(folder, name, own)]
    return (*files, write_file(folder / "summary.md", "\n".join(lines) + "\n"))


def mean_errors(rows: DataFrame) -> DataFrame:
    """Return means over recordings of the errors of each method, without passive arms unless all
    are.
    """
    passive = rows["range_rad"] < PASSIVE
    if not passive.all():
        rows = rows[~passive]
    headers = {
        "joint_error_rad": "joints [rad]",
        "position_error_m": "hand [m]",
        "orientation_error_rad": "hand [rad]",
    }
    groups = rows.rename(columns=headers).groupby("method_label", sort=False)[[*headers.values()]]
    found = groups.mean()
    found.insert(0, "recordings", groups.count()["joints [rad]"])
    return found.rename_axis("method")


def _failure_row(outcome: RecordingOutcome) -> Row:
    source = outcome.source
    known = {"subject": source.subject, "subject_from": source.subject_from * bool(source.subject)}
    return {**identity(source, ""), **known, "kind": outcome.kind, "reason": outcome.text}
