"""Elements of a scene: actors, trails, solids, frames, spans and plots; playbacks of scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.drawing.actors import Actor, extreme_points
from geodesic_ocp.drawing.look import Indices
from geodesic_ocp.drawing.styles import Role

_UNKNOWN = "\N{REPLACEMENT CHARACTER}"


def plain_text(text: str) -> str:
    """Return the text on one line, without what cannot be printed.

    Names of joints and files may contain anything. Control characters, NUL and line breaks among
    them, and characters that change the direction of writing become spaces; bytes that are no UTF-8
    (lone surrogates, as Python reads such names of files) become U+FFFD.
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() else _UNKNOWN if "\ud800" <= each <= "\udfff" else " "
        for each in text
    )


@dataclass(frozen=True, eq=False, repr=False)
class Trail(ShortRepr):
    """A line in a scene, such as the path of a hand, with a dot that moves along it."""

    name: str  # for the legend
    points: Array  # points of the line, (m, 3) [m]
    role: Role  # role whose colour it has
    dot: Array | None = None  # positions (k, 3) [m] of the dot over time; None: no dot
    layer: str = "hand path"  # name of the switch that shows it

    _shown = ("name", "points")


@dataclass(frozen=True, eq=False, repr=False)
class Solid(ShortRepr):
    """A stationary body in a scene, such as an obstacle."""

    name: str  # for the legend
    vertices: Array  # (k, 3) [m], in the scene
    triangles: Indices  # (m, 3), indices of vertices, counter-clockwise seen from outside
    unbounded: bool = False  # whether it is a piece of something infinite, such as a half-space
    layer: str = "obstacles"  # name of the switch that shows it

    _shown = ("name",)


@dataclass(frozen=True, eq=False, repr=False)
class FrameTrack(ShortRepr):
    """A coordinate frame over time, drawn as three axes."""

    name: str
    rotations: Array  # in the scene, (k, 3, 3) or (1, 3, 3)
    positions: Array  # positions of its origin, (k, 3) or (1, 3) [m]
    layer: str = "frames"  # name of the switch that shows it

    _shown = ("name",)


@dataclass(frozen=True, eq=False, repr=False)
class EllipsoidTrack(ShortRepr):
    """An ellipsoid over time, such as the unit ball of the metric at the hand."""

    name: str  # for the legend
    centres: Array  # (k, 3) [m]
    # matrices (k, 3, 3) that map the unit ball onto the ellipsoid around its centre [m, as drawn],
    # such as those whose columns are the semi-axes
    axes: Array
    layer: str = "mobility ellipsoids"  # name of the switch that shows it

    _shown = ("name",)


@dataclass(frozen=True, eq=False, repr=False)
class Gap(ShortRepr):
    """The distance between two bodies over time, drawn between their nearest points."""

    name: str  # name of the two, as in the constraint
    # starts, ends: nearest points, (k, 3) [m] each
    starts: Array
    ends: Array
    distances: Array  # (k,) [m], negative where the bodies overlap
    layer: str = "clearances"  # name of the switch that shows it

    _shown = ("name",)


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud(ShortRepr):
    """Points over time, such as markers."""

    name: str  # for the legend
    # (k, m, 3), or (1, m, 3) if they do not move [m]; NaN where a point is not known
    positions: Array
    labels: tuple[str, ...]  # names of the m points
    layer: str = "markers"  # name of the switch that shows it
    role: Role | None = None  # role whose colour it has; None: that of markers

    _shown = ("name", "labels")


_EMPTY = 0.5  # [m], half the size of a scene in which there is nothing
_INSTANTS = 30  # at most, at which bodies are looked at
_KINDS = ("actors", "trails", "solids", "clouds", "gaps", "frames", "ellipsoids")


@dataclass(frozen=True, eq=False, repr=False)
class Scene(ShortRepr):
    """One pane: actors and what is drawn around them; x points right, y forward and z up."""

    title: str  # above the pane
    time: Array  # time of the samples (k,), increasing; a single one if nothing moves
    actors: tuple[Actor, ...] = ()
    trails: tuple[Trail, ...] = ()
    solids: tuple[Solid, ...] = ()
    frames: tuple[FrameTrack, ...] = ()
    ellipsoids: tuple[EllipsoidTrack, ...] = ()
    gaps: tuple[Gap, ...] = ()
    clouds: tuple[PointCloud, ...] = ()
    note: str = ""  # beside the title, in smaller type

    _shown = ("title", "actors", "time")

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the switches that it needs, in order of first use."""
        names = [str(item.layer) for kind in _KINDS for item in getattr(self, kind)]
        return tuple(name for name in dict.fromkeys(names) if name)

    def showing(self, layers: Collection[str]) -> Scene:
        """Return what is shown with these layers."""
        shown = {"", *layers}
        kinds: dict[str, Any] = {kind: getattr(self, kind) for kind in _KINDS}
        for kind, items in kinds.items():
            kinds[kind] = tuple(item for item in items if item.layer in shown)
        return replace(self, **kinds)

    def beside(self, other: Scene) -> Scene:
        """Return the scene with everything of another one, too."""
        both: Any = {kind: getattr(self, kind) + getattr(other, kind) for kind in _KINDS}
        return replace(self, **both)

    def points(self) -> Array:
        """Return points (k, 3) [m] that are extreme in all directions: a view that holds them
        holds nearly everything at all times, but obstacles without end.
        """
        found = [np.zeros((0, 3)), *(trail.points for trail in self.trails)]
        found += [solid.vertices for solid in self.solids if not solid.unbounded]
        found += [cloud.positions.reshape(-1, 3) for cloud in self.clouds]
        for each in self.ellipsoids:
            found += [(each.centres[:, None] + end * each.axes).reshape(-1, 3) for end in (-1, 1)]
        for actor in self.actors:
            for link, vertices, _ in actor.links():
                last = len(actor.positions[link]) - 1
                instants = np.unique(np.linspace(0, last, _INSTANTS).astype(int))
                ends = actor.placed(link, extreme_points(vertices), instants)
                found.append(ends.reshape(-1, 3))
        every = np.concatenate(found)
        every = extreme_points(every[np.isfinite(every).all(axis=1)])
        return every if len(every) else np.array([[-_EMPTY] * 3, [_EMPTY] * 3])

    def bounds(self) -> tuple[Array, Array]:
        """Return corners (3,) [m] of a box around everything of finite size."""
        points = self.points()
        return points.min(axis=0), points.max(axis=0)


SECONDS = "time [s]"
PARAMETER = "path parameter s"


Cut = Literal["stable", "doubtful"]  # what is known of a cut


@dataclass(frozen=True)
class Span:
    """A named span of time, such as a synergy."""

    name: str  # shown on the slider
    # start, stop: in the playback's time
    start: float
    stop: float
    text: str = ""  # full description, such as "synergy 3 (0.42 s)"
    cut: Cut | None = None  # how sure its start is, if that is known


def numbered_spans(what: str, ends: Iterable[tuple[float, float]]) -> tuple[Span, ...]:
    """Return spans with these ends, numbered from 1, such as "synergy 3 (0.42 s)"."""
    return tuple(
        Span(str(number), float(start), float(stop), f"{what} {number} ({stop - start:.2f} s)")
        for number, (start, stop) in enumerate(ends, 1)
    )


@dataclass(frozen=True, eq=False, repr=False)
class Curve(ShortRepr):
    """One line of a plot.

    Attributes:
        name: for the legend.
        time: (k,), increasing.
        values: (k,), in the unit of the plot.
        role: role whose colour and dashes it has; None: one of a series of line styles.
        layer: name of the switch that shows it, with what has it in the scenes; "": always shown.
    """

    name: str
    time: Array
    values: Array
    role: Role | None = None
    layer: str = ""

    _shown = ("name", "time")


@dataclass(frozen=True, eq=False, repr=False)
class Plot(ShortRepr):
    """Curves over time, drawn below the scenes."""

    label: str  # label of the vertical axis, with its unit in brackets, as "hand speed [m/s]"
    curves: tuple[Curve, ...]  # at least one
    title: str = ""  # above the plot; usually what several plots of the same label differ in
    marks: tuple[float, ...] = ()  # values of horizontal lines, such as limits
    marked: str = ""  # what these are, for the legend

    _shown = ("label", "curves")


@dataclass(frozen=True, eq=False, repr=False)
class Playback:
    """Scenes side by side that are played together.

    Attributes:
        scenes: one pane each.
        spans: rows of the slider by name, such as the synergies of "person" and "panda"; empty if
            nothing divides the time.
        plots: below the scenes.
        time_label: `SECONDS` or `PARAMETER`.
        azimuth: initial direction from which the camera looks [deg]; at 0 it faces the models, from
            the front (+y), positive angles are to their right (+x).
        hidden: layers that are not shown until they are switched on.
        elevation: initial height of the camera above the horizon [deg]; None: the viewer's choice.
    """

    title: str
    scenes: tuple[Scene, ...]
    spans: dict[str, tuple[Span, ...]]
    plots: tuple[Plot, ...] = ()
    time_label: str = SECONDS
    azimuth: float = 50.0
    hidden: tuple[str, ...] = ("clearances", "frames", "mobility ellipsoids")
    elevation: float | None = None

    def __repr__(self) -> str:
        start, stop = self.range
        return f"Playback({self.title!r}, {len(self.scenes)} scenes, {start:.3g} to {stop:.3g})"

    @property
    def range(self) -> tuple[float, float]:
        """The first and the last time of all scenes."""
        return (
            min(float(scene.time[0]) for scene in self.scenes),
            max(float(scene.time[-1]) for scene in self.scenes),
        )

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the switches of all scenes, in order of first use."""
        return tuple(dict.fromkeys(name for scene in self.scenes for name in scene.layers))

    def showing(self, layers: Collection[str]) -> Playback:
        """Return the same with these layers shown at first, and all others hidden.

        Raises:
            ValueError: there is no such layer.
        """
        chosen = [layers] if isinstance(layers, str) else list(layers)
        for name in chosen:
            if name not in self.layers:
                known = ", ".join(self.layers) or "none"
                raise ValueError(f"layers: {name!r} must be one of {known}")
        return replace(self, hidden=tuple(name for name in self.layers if name not in chosen))


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
    counts = Counter(titles)
    seen = Counter[str]()
    found = []
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
