"""Files as tables name them: by the end of their path, with or without the suffix."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath


def named_file(text: str) -> str:
    """A path in a table as it is compared with those that `path_ends` gives."""
    return str(PurePosixPath(text.replace("\\", "/").removeprefix("./").lstrip("/")))


def path_ends(file: str) -> Iterator[str]:
    """What a table may call a file, the longest first, and with its suffix before without.

    >>> list(path_ends("S1/reach_1.5.c3d"))
    ['S1/reach_1.5.c3d', 'S1/reach_1.5', 'reach_1.5.c3d', 'reach_1.5']
    """
    path = PurePosixPath(file)
    parts = [part for part in path.parts if part != "/"]
    for start in range(len(parts)):
        for name in dict.fromkeys((path.name, path.stem)):
            yield "/".join([*parts[start:-1], name])
