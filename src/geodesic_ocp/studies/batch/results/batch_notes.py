"""What the tables of many recordings rest on, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from geodesic_ocp.studies.tables.columns import Row


def notes_of(rows: Sequence[Row], others: int) -> Iterator[str]:
    """Subjects named after files, assumed heights and masses, and results that are in no table.

    Args:
        rows: of the table of recordings.
        others: number of results in the folder that are not of these recordings.
    """
    by_name = {str(row["recording"]): row for row in rows}
    recordings = list(by_name.values())
    files = [row for row in recordings if row.get("subject_from") == "file name"]
    if len(recordings) > 1 and files:
        yield (
            f"Subjects of {_of(files, recordings)} are named after their files, as nothing else "
            "names them: recordings of one person would count as several subjects. State the "
            "subjects with a table (--subjects) or by the paths (--subject-from)."
        )
    for name, usual in (("height", "m"), ("mass", "kg")):
        assumed = [row for row in recordings if row.get(f"{name}_from") == "assumed"]
        if assumed:
            value = assumed[0][f"{name}_{usual}"]
            yield f"Assumed, not in the recording: a body {name} of {value} {usual} in " + (
                f"{_of(assumed, recordings)}."
            )
    if others:
        yield (
            f"{others} other result{'s' * (others != 1)} in the folder {_are(others)} not of these "
            "recordings and in none of the tables."
        )


def _of(some: Sequence[Row], all_of_them: Sequence[Row]) -> str:
    return f"{len(some)} of {len(all_of_them)} recordings"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"
