"""The labels of markers in a file: labels that occur twice, and several people."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.markers.markers import Markers


def distinct_labels(file: Path, labels: Sequence[str]) -> list[str]:
    """Return labels of which those that occur again have a number behind them, as in "RWRA (2)".

    Args:
        file: file that has the labels, for the warning.
        labels: labels of the markers.

    Warns:
        RuntimeWarning: a label occurs more than once; names it.
    """
    seen: Counter[str] = Counter()
    found: list[str] = []
    for label in labels:
        seen[label] += 1
        found.append(label if seen[label] == 1 else f"{label} ({seen[label]})")
    twice = [label for label, count in seen.items() if count > 1]
    if twice:
        warnings.warn(
            f"{file}: {', '.join(twice)} is the label of several markers: the first one is taken, "
            f"and the next is called {twice[0]} (2)",
            RuntimeWarning,
            stacklevel=5,
        )
    return found


def of_person(markers: Markers, person: str | None, source: str = "positions") -> Markers:
    """Return the markers of one person, named without the prefix.

    The prefix of a label is what precedes its last colon, as in "Ann:RSHO". Labels without one
    belong to the only person whose labels have one, if no marker of that person has such a name.

    Args:
        markers: markers with the labels of a file.
        person: prefix of the person, in capitals or not; None: the first one.
        source: file or argument that has the markers, for messages.

    Raises:
        RecordingError: there is no such person; names those that there are.

    Warns:
        RuntimeWarning: there are several people, and none is asked for; names them.
    """
    people = _columns_of_people(markers.names)
    wanted = next(iter(people))
    if person is not None:
        matching = [each for each in people if each.lower() == person.lower()]
        if not matching:
            named = ", ".join(filter(None, people))
            there = f"its people are {named}" if named else "no label has a prefix, as in Ann:RSHO"
            raise RecordingError(f"{source}: there is no person {person!r}; {there}")
        wanted = matching[0]
    elif len(people) > 1:
        first, *others = (each or "those without a prefix" for each in people)
        other = next(each for each in reversed(people) if each)
        warnings.warn(
            f"{source}: has markers of several people: {first} is taken, not {', '.join(others)}; "
            f"person={other!r} (--person {other}) says who is meant",
            RuntimeWarning,
            stacklevel=3,
        )
    columns = people[wanted]
    names = [markers.names[column] for column in columns]
    plain = [name.rpartition(":")[2].strip() for name in names]
    if "" in plain or len(set(plain)) < len(plain):
        plain = names
    subject = markers.subject
    if wanted and (len(people) > 1 or not subject.name):
        subject = replace(subject, name=wanted)
    return replace(
        markers, names=tuple(plain), positions=markers.positions[:, columns], subject=subject
    )


def _columns_of_people(labels: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns of the markers of each person by prefix, in the order of the labels."""
    people: dict[str, list[int]] = {}
    for column, label in enumerate(labels):
        prefix = label.rpartition(":")[0].strip()
        people.setdefault(prefix, []).append(column)
    if len(people) == 2 and "" in people:
        (prefix,) = (each for each in people if each)
        names = [{labels[k].rpartition(":")[2].strip() for k in own} for own in people.values()]
        if not names[0] & names[1]:
            return {prefix: list(range(len(labels)))}
    return people
