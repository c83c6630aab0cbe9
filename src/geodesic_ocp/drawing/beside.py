"""Several playbacks side by side, in one time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from geodesic_ocp.drawing.scene import PARAMETER, SECONDS, Playback, Scene


def beside(playbacks: Sequence[Playback], *, title: str = "") -> Playback:
    """Return several playbacks as one, whose panes are side by side and are played together.

    Spans and plots carry the titles of their playbacks; equal titles are numbered. Times are those
    of the playbacks. Where some are over time and others over a path parameter, these take as long
    as the longest of the former, which the notes of their scenes say.

    Args:
        playbacks: at least one.
        title: title of the whole; the titles of the playbacks by default.

    Raises:
        ValueError: there are no playbacks.
    """
    if not playbacks:
        raise ValueError("at least one playback must be given")
    if len(playbacks) == 1:
        return replace(playbacks[0], title=title or playbacks[0].title)
    titles = _numbered([playback.title for playback in playbacks])
    together = _in_one_time(playbacks)
    spans = {
        name if len(playback.spans) == 1 else f"{name}, {row}": each
        for name, playback in zip(titles, together, strict=True)
        for row, each in playback.spans.items()
    }
    plots = [
        replace(plot, title=f"{name}, {plot.title}" if plot.title else name)
        for name, playback in zip(titles, together, strict=True)
        for plot in playback.plots
    ]
    heights = {playback.elevation for playback in playbacks}
    return Playback(
        title or _listed(dict.fromkeys(playback.title for playback in playbacks)),
        _titled(titles, together),
        spans,
        tuple(plots),
        together[0].time_label,
        _between([playback.azimuth for playback in playbacks]),
        _hidden(playbacks),
        heights.pop() if len(heights) == 1 else None,
    )


def _between(azimuths: Sequence[float]) -> float:
    """Return the mean of directions [deg], as that of unit vectors: that of 170 and -170 is 180."""
    angles = np.radians(azimuths)
    mean = np.degrees(np.arctan2(np.sin(angles).mean(), np.cos(angles).mean()))
    return round(float(mean), 9)


def _hidden(playbacks: Sequence[Playback]) -> tuple[str, ...]:
    """Return the layers that are hidden wherever there are such."""
    shown = set[str]()
    for playback in playbacks:
        layers = {layer for scene in playback.scenes for layer in scene.layers}
        shown |= layers - set(playback.hidden)
    every = dict.fromkeys(each for one in playbacks for each in one.hidden)
    return tuple(each for each in every if each not in shown)


def _titled(titles: Sequence[str], playbacks: Sequence[Playback]) -> tuple[Scene, ...]:
    """Return the scenes of all: a single one has the title of its playback, others have it in
    front.
    """
    scenes = []
    for title, playback in zip(titles, playbacks, strict=True):
        if len(playback.scenes) == 1:
            scenes.append(replace(playback.scenes[0], title=title))
        else:
            scenes += [replace(each, title=f"{title}, {each.title}") for each in playback.scenes]
    return tuple(scenes)


def _numbered(titles: Sequence[str]) -> list[str]:
    """Return titles that differ: equal ones get numbers."""
    counts, seen, found = Counter(titles), Counter[str](), []
    for title in titles:
        seen[title] += 1
        found.append(f"{title} ({seen[title]})" if counts[title] > 1 else title)
    return found


def _listed(titles: Sequence[str] | dict[str, None]) -> str:
    *first, last = titles
    return f"{', '.join(first)} and {last}" if first else last


def _in_one_time(playbacks: Sequence[Playback]) -> list[Playback]:
    """Get the playbacks, with path parameters stretched to the longest time if there is a time."""
    timed = [playback for playback in playbacks if playback.time_label == SECONDS]
    if not timed or len(timed) == len(playbacks):
        return list(playbacks)
    longest = max(timed, key=lambda playback: playback.range[1] - playback.range[0])
    if not longest.range[1] > longest.range[0]:  # still pictures beside a path
        return [replace(playback, time_label=PARAMETER) for playback in playbacks]
    return [
        playback if playback.time_label == SECONDS else _stretched(playback, *longest.range)
        for playback in playbacks
    ]


def _stretched(playback: Playback, begin: float, end: float) -> Playback:
    """Return a playback over a path parameter, as one over the time from `begin` to `end` [s]."""
    first, last = playback.range
    rate = (end - begin) / (last - first) if last > first else 0.0

    said = f"path parameter {first:g} to {last:g} in {end - begin:.3g} s"

    def at(moved: Any) -> Any:
        return begin + rate * (moved - first)

    return replace(
        playback,
        scenes=tuple(
            replace(each, time=at(each.time), note="; ".join(filter(None, (each.note, said))))
            for each in playback.scenes
        ),
        spans={
            row: tuple(replace(each, start=at(each.start), stop=at(each.stop)) for each in spans)
            for row, spans in playback.spans.items()
        },
        plots=tuple(
            replace(plot, curves=tuple(replace(each, time=at(each.time)) for each in plot.curves))
            for plot in playback.plots
        ),
        time_label=SECONDS,
    )
