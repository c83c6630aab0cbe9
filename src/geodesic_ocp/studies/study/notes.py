"""What limits a study, in sentences."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence

from geodesic_ocp.studies.study.statistics.means import StudyMean
from geodesic_ocp.studies.study.statistics.measures import MEASURES
from geodesic_ocp.studies.study.statistics.subject_tests import StudyTest
from geodesic_ocp.studies.study.statistics.subjects import subject_of
from geodesic_ocp.studies.tables.columns import Row

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
