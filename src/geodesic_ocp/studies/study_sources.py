"""Further columns for the recordings, such as conditions, from a table of their files."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.manifold.metrics import KINETIC_ENERGY, STRAIGHT_LINES
from geodesic_ocp.studies.statistics import MEASURES, StudyMean, StudyTest, subject_of
from geodesic_ocp.studies.tables import (
    TABLES,
    Row,
    named_file,
    path_ends,
    read_rows,
    read_text_table,
    recording_rows,
    synergy_rows,
)
from geodesic_ocp.synergies.analyse import Analysis


def with_metadata(rows: Sequence[Row], table: str | PathLike[str]) -> tuple[Row, ...]:
    """The rows with all columns of the table that they do not have.

    The table has a column file, with the end of each file's path, with or without its suffix, as
    the table of subjects of `analyse_recordings`.

    Raises:
        RecordingError: the table cannot be read, has no column file, names a file twice, or does
            not name one of the recordings.
    """
    path = Path(table)
    names, lines = read_text_table(path)
    if "file" not in names:
        raise RecordingError(f"{path}: line 1: there is no column file")
    entries: dict[str, Row] = {}
    for where, values in lines:
        entry: Row = dict(zip(names, values, strict=True))
        key = named_file(values[names.index("file")])
        if key in entries:
            raise RecordingError(f"{path}: {where}: {entry['file']} is there already")
        entries[key] = entry
    return tuple(_entry(str(row.get("file") or ""), entries, path) | row for row in rows)


def _entry(file: str, entries: dict[str, Row], path: Path) -> Row:
    ends = list(path_ends(file))
    for end in ends:
        if (entry := entries.get(end)) is not None:
            return entry
    for whole in [end for end in ends if end.count("/") == ends[0].count("/")]:
        # The table may give more of the path than the recordings do.
        longer = [key for key in entries if key.endswith(f"/{whole}")]
        if len(longer) == 1:
            return entries[longer[0]]
        if longer:
            break
    raise RecordingError(f"{path}: does not name the recording's file {file!r}")


_SUFFIXES = (".csv", ".parquet")


@dataclass(frozen=True, repr=False)
class StudyTables:
    """The rows of the three tables; see `geodesic_ocp.studies.tables`.

    Attributes:
        recordings: one for each recording and method.
        synergies: one for each synergy; None if there is no such table.
        failures: one for each recording without a result.
    """

    recordings: tuple[Row, ...]
    synergies: tuple[Row, ...] | None = None
    failures: tuple[Row, ...] = ()

    def __repr__(self) -> str:
        synergies = "no table of" if self.synergies is None else len(self.synergies)
        return (
            f"StudyTables({len(self.recordings)} rows of recordings and methods, {synergies} "
            f"synergies, {len(self.failures)} failures)"
        )


def read_study_tables(
    source: str | PathLike[str] | Iterable[str | PathLike[str]],
) -> StudyTables:
    """Read the tables of an output folder, or from the files whose paths are given.

    In a folder recordings, synergies and failures are read from .csv files, or from .parquet
    files where only these are there. Given files are told apart by the beginning of their names.

    Raises:
        RecordingError: there is no table of recordings, a table cannot be read, or tables disagree
            about the synergies of a recording, as when one was cut off.
    """
    if isinstance(source, str | PathLike):
        path = Path(source)
        files = _in_folder(path) if not path.is_file() else _by_name([path])
    else:
        files = _by_name([Path(each) for each in source])
    rows = {table: tuple(read_rows(file, table)) for table, file in files.items()}
    if not rows["recordings"]:
        raise RecordingError(f"{files['recordings']}: has no recordings")
    if "synergies" in rows:
        _check_synergies(rows["recordings"], rows["synergies"], files["synergies"])
    return StudyTables(rows["recordings"], rows.get("synergies"), rows.get("failures", ()))


def _in_folder(folder: Path) -> dict[str, Path]:
    if not folder.is_dir():
        raise RecordingError(f"{folder}: there is no such folder or table")
    found: dict[str, Path] = {}
    for table in TABLES:
        files = [folder / f"{table}{suffix}" for suffix in _SUFFIXES]
        if there := [file for file in files if file.is_file()]:
            found[table] = there[0]
    if "recordings" not in found:
        raise RecordingError(
            f"{folder}: has no recordings.csv or recordings.parquet; it must be the folder of a "
            "finished `geodesic-ocp analyse DIR --out FOLDER`"
        )
    return found


def _by_name(files: list[Path]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for file in files:
        table = next((t for t in TABLES if file.name.startswith(t)), None)
        if table is None and len(files) == 1:
            table = "recordings"
        if table is None or table in found:
            raise ValueError(
                f"source: the name of {file.name} must begin with one of {', '.join(TABLES)}, "
                "each once"
            )
        found[table] = file
    if "recordings" not in found:
        raise ValueError("source must have the table of recordings, got none")
    return found


def _check_synergies(recordings: Iterable[Row], synergies: Iterable[Row], file: Path) -> None:
    """RecordingError if a recording has another number of synergies than segments."""
    counts = Counter(str(row["recording"]) for row in synergies)
    known = {str(row["recording"]) for row in recordings}
    if unknown := sorted(set(counts) - known):
        raise RecordingError(f"{file}: {unknown[0]} is not in the table of recordings")
    for row in recordings:
        name, expected = str(row["recording"]), row.get("segments")
        if row["method"] == "riemannian" and expected not in (None, counts[name]):
            raise RecordingError(
                f"{file}: {name} has {counts[name]} synergies, but {expected} in the table of "
                "recordings; is one of the two cut off, or of another analysis?"
            )


def analysis_tables(
    analyses: Sequence[Analysis],
    names: Sequence[str] | None,
    subjects: Sequence[str] | None,
    conditions: Sequence[str] | None,
) -> StudyTables:
    """Rows of all analyses, as those of a folder.

    Args:
        analyses: one of each recording.
        names: of the recordings; by default they are numbered.
        subjects: the persons; by default those of the motions.
        conditions: of the recordings, column "condition".

    Raises:
        ValueError: names, subjects or conditions are not one for each analysis, or names are equal.
    """
    count = len(analyses)
    names = [str(k) for k in range(1, count + 1)] if names is None else names
    if subjects is None:
        subjects = [each.motion.subject.name or "" for each in analyses]
    for what, given in (("names", names), ("subjects", subjects), ("conditions", conditions)):
        if given is not None and (isinstance(given, str) or len(given) != count):
            raise ValueError(f"{what} must be {count}, one for each analysis, got {given!r}")
    if len(set(names)) < count:
        raise ValueError(f"names must differ, got {list(names)!r}")
    recordings: list[Row] = []
    synergies: list[Row] = []
    for k, analysis in enumerate(analyses):
        identity: Row = {"recording": str(names[k]), "subject": str(subjects[k])}
        if conditions is not None:
            identity["condition"] = str(conditions[k])
        recordings += [identity | row for row in recording_rows(analysis)]
        synergies += [identity | row for row in synergy_rows(analysis)]
    return StudyTables(tuple(recordings), tuple(synergies))


OWN = "riemannian"
_ORDER = (OWN, "joint_inertia", "kinetic_energy", "euclidean_same_segments", "euclidean")
_LIKE_FOR_LIKE = f"{STRAIGHT_LINES}, same segments"


def method_labels(rows: Iterable[Row]) -> dict[str, str]:
    """Labels by key; a key whose label depends on the condition is its own label."""
    labels: dict[str, set[str]] = {}
    for row in rows:
        label = str(row.get("method_label") or row["method"])
        labels.setdefault(str(row["method"]), set()).add(label)
    order = sorted(labels, key=lambda key: (*(key != known for known in _ORDER), key))
    return {key: labels[key].pop() if len(labels[key]) == 1 else key for key in order}


def reference(
    methods: Mapping[str, str], conditions: Sequence[str], against: str | None
) -> tuple[str, str]:
    """What others are compared with: "method" or "condition", and its key.

    Raises:
        ValueError: there is no such method or condition; of None, no straight lines on the same
            segments.
    """
    wanted = _LIKE_FOR_LIKE if against is None else against
    if key := next((k for k, label in methods.items() if wanted in (k, label)), None):
        return "method", key
    if wanted in conditions:
        return "condition", wanted
    known = ", ".join(map(repr, (*methods, *conditions)))
    raise ValueError(f"against must be one of {known}, got {against!r}")


def length_unit(methods: Mapping[str, str]) -> str:
    """Unit of the synergies' lengths; empty if it is not known."""
    label = methods.get(OWN, "")
    if STRAIGHT_LINES in label:
        return "rad"
    return "sqrt(kg) m" if KINETIC_ENERGY in label else ""


_MEANS = (
    "Means over subjects of the subjects' means. SD: standard deviation over subjects. Intervals: "
    "of the mean, by Student's t."
)

_KINDS = {
    "file": "file that cannot be used",
    "solver": "solver that failed",
    "process": "process that died",
    "same": "same motion as another recording",
    "missing": "not analysed yet",
}


def count(number: int, noun: str) -> str:
    """A number with its noun: 1 subject, 2 subjects."""
    return f"{number} {noun}" + "s" * (number != 1)


def study_notes(
    rows: Sequence[Row], synergies: Sequence[Row] | None, failures: Sequence[Row]
) -> tuple[str, ...]:
    """Failures, missing methods, nameless subjects, a single subject, settings that differ."""
    notes = []
    recordings = {str(row["recording"]) for row in rows}
    if failures:
        kinds = Counter(_KINDS.get(str(row.get("kind")), "other error") for row in failures)
        why = "; ".join(f"{kind}: {number}" for kind, number in sorted(kinds.items()))
        notes.append(f"{count(len(failures), 'recording')} left out of the analysis ({why}).")
    labels = {str(row["method"]): str(row.get("method_label") or row["method"]) for row in rows}
    for method in sorted(labels):
        known = {
            row["recording"]
            for row in rows
            if row["method"] == method and math.isfinite(MEASURES["joint"].of(row))
        }
        if missing := len(recordings) - len(known):
            of = count(len(recordings), "recording")
            notes.append(f"{labels[method]}: no result in {missing} of {of}.")
    notes += subjects_note(rows)
    subjects = sorted({subject_of(row) for row in rows})
    for name in subjects:
        longer = [each for each in subjects if re.search(rf"[^0-9A-Za-z]{re.escape(name)}$", each)]
        if longer:
            notes.append(f"Subjects {name} and {', '.join(longer)} may be the same person.")
    if len(subjects) == 1:
        notes.append("One subject only: there is no spread over subjects, and nothing to test.")
    settings = {str(row["settings"]) for row in rows if row.get("settings")}
    if len(settings) > 1:
        notes.append(f"The recordings were analysed with {len(settings)} different settings.")
    if synergies is None:
        notes.append("There is no table of synergies.")
    return tuple(notes)


def subjects_note(rows: Sequence[Row]) -> list[str]:
    """A sentence, if files stand for persons in some of several recordings."""
    recordings = {str(row["recording"]) for row in rows}
    nameless = {str(row["recording"]) for row in rows if not row.get("subject")}
    by_file = {str(row["recording"]) for row in rows if row.get("subject_from") == "file name"}
    if by_file - nameless and len(recordings) > 1:
        return [
            f"Subjects of {len(nameless | by_file)} of {count(len(recordings), 'recording')} are "
            "named after files: several recordings of one person may be counted as several "
            "subjects. State the subjects with a table or by the paths, see `analyse`."
        ]
    if nameless:
        return [
            f"{count(len(nameless), 'recording')} without the name of a subject: each file counts "
            "as a subject of its own."
        ]
    return []


def means_note(notes: Sequence[str], means: Sequence[StudyMean]) -> str:
    """What stands below a table of means."""
    several = len({(each.subjects, each.recordings) for each in means if each.recordings}) > 1
    alone = any(each.subjects == 1 for each in means) and any(each.subjects > 1 for each in means)
    single = ["Of a single subject there is no spread."] * alone
    unequal = ["Methods are not all averaged over the same recordings."] * several
    return " ".join([_MEANS, *single, *unequal, *notes])


def tests_note(tests: Sequence[StudyTest], caveats: Sequence[str]) -> str:
    """What stands below a table of tests, with what is said of its subjects."""
    test = tests[0].test
    sentences = [
        "Pairs are subjects. Intervals: of the mean difference, by bootstrap. Effect: "
        "matched-pairs rank-biserial correlation, positive where numbers are smaller than the "
        f"reference's. Wilcoxon's signed-rank test, two-sided; last column corrected for "
        f"{count(tests[0].together, 'test')} by Holm's method."
    ]
    pairs = {each.test.pairs for each in tests}
    if pairs == {1}:
        sentences.append("One subject only: there is nothing to test.")
    else:
        most = max(each.test.wins + each.test.losses for each in tests)
        smallest = min(1.0, tests[0].together * min(each.test.smallest_p for each in tests))
        if smallest > (1.0 - test.confidence) * (1.0 + 1e-9):
            sentences.append(
                f"With {count(most, 'pair')} that differ{' at most' * (len(pairs) > 1)} and "
                f"{count(tests[0].together, 'test')} no corrected p can be below {smallest:.3g}."
            )
        if min(pairs) < 10:
            sentences.append("A bootstrap of fewer than 10 pairs underestimates the interval.")
    if names := {name: None for each in tests for name in each.left_out}:
        sentences.append(f"Left out, without a pair: {', '.join(names)}.")
    return " ".join([*sentences, *caveats])
