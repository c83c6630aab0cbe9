"""Elements of a scene: actors, trails, solids, frames, spans and plots."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Indices, Mesh
from geodesic_ocp.model.meshes import meshes
from geodesic_ocp.model.model import Model

# What something shows; each role has one colour in scenes, plots and figures.
Role: TypeAlias = Literal[
    "observed",
    "predicted",
    "baseline",
    "second baseline",
    "third baseline",
    "fourth baseline",
    "neutral",
]


@dataclass(frozen=True, eq=False, repr=False)
class Actor:
    """A model that moves, or stands still, in a scene.

    Attributes:
        name: name of the model, for the legend.
        meshes: meshes of its links, each in the frame of its link.
        rotations: rotations of each link in the scene, (k, 3, 3), or (1, 3, 3) if it does not move.
        positions: positions of each link in the scene, (k, 3) or (1, 3) [m].
        role: role whose colour it has; None: the colours of its meshes.
        translucent: drawn as an overlay through which others are seen.
        layer: name of the switch that shows it; "" if it is always shown.
    """

    name: str
    meshes: tuple[Mesh, ...]
    rotations: Mapping[str, Array]
    positions: Mapping[str, Array]
    role: Role | None = None
    translucent: bool = False
    layer: str = ""

    def __repr__(self) -> str:
        return f"Actor({self.name!r}, {len(self.meshes)} meshes)"


def model_actor(
    model: Model,
    q: Array,
    *,
    name: str = "",
    rotation: ArrayLike | None = None,
    position: ArrayLike = (0.0, 0.0, 0.0),
    role: Role | None = None,
    translucent: bool = False,
    layer: str = "",
    hidden: Collection[str] = (),
    shown: tuple[Mesh, ...] | None = None,
) -> Actor:
    """Return the links of a model in configurations q.

    Args:
        model: model whose links are shown.
        q: configurations (k, n) [rad or m].
        name: the model's by default.
        rotation, position: rotation and position of the model's base in the scene, (3, 3) and (3,)
            [m].
        role, translucent, layer: see `Actor`.
        hidden: links that are not drawn.
        shown: meshes; those of `meshes` by default.
    """
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    parts = meshes(model) if shown is None else shown
    parts = tuple(part for part in parts if part.link not in hidden)
    rotations, positions = {}, {}
    for link in dict.fromkeys(part.link for part in parts):
        # One pose is enough for a link that does not move.
        turned, moved = model.frame_pose(link, q if model.moves(link) else q[:1])
        rotations[link] = turn @ turned
        positions[link] = moved @ turn.T + np.asarray(position, dtype=float)
    return Actor(name or model.name, parts, rotations, positions, role, translucent, layer)


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
class Trail:
    """A line in a scene, such as the path of a hand, with a dot that moves along it.

    Attributes:
        name: for the legend.
        points: points of the line, (m, 3) [m].
        role: role whose colour it has.
        dot: positions (k, 3) [m] of the dot over time; None: no dot.
        layer: name of the switch that shows it.
    """

    name: str
    points: Array
    role: Role
    dot: Array | None = None
    layer: str = "hand path"

    def __repr__(self) -> str:
        return f"Trail({self.name!r}, {len(self.points)} points)"


@dataclass(frozen=True, eq=False, repr=False)
class Solid:
    """A stationary body in a scene, such as an obstacle.

    Attributes:
        name: for the legend.
        vertices: (k, 3) [m], in the scene.
        triangles: (m, 3), indices of vertices, counter-clockwise seen from outside.
        unbounded: whether it is a piece of something infinite, such as a half-space.
        layer: name of the switch that shows it.
    """

    name: str
    vertices: Array
    triangles: Indices
    unbounded: bool = False
    layer: str = "obstacles"

    def __repr__(self) -> str:
        return f"Solid({self.name!r})"


@dataclass(frozen=True, eq=False, repr=False)
class FrameTrack:
    """A coordinate frame over time, drawn as three axes.

    Attributes:
        name: name of the frame.
        rotations: in the scene, (k, 3, 3) or (1, 3, 3).
        positions: positions of its origin, (k, 3) or (1, 3) [m].
        layer: name of the switch that shows it.
    """

    name: str
    rotations: Array
    positions: Array
    layer: str = "frames"

    def __repr__(self) -> str:
        return f"FrameTrack({self.name!r})"


@dataclass(frozen=True, eq=False, repr=False)
class EllipsoidTrack:
    """An ellipsoid over time, such as the unit ball of the metric at the hand.

    Attributes:
        name: for the legend.
        centres: (k, 3) [m].
        axes: matrices (k, 3, 3) that map the unit ball onto the ellipsoid around its centre [m, as
            drawn], such as those whose columns are the semi-axes.
        layer: name of the switch that shows it.
    """

    name: str
    centres: Array
    axes: Array
    layer: str = "mobility ellipsoids"

    def __repr__(self) -> str:
        return f"EllipsoidTrack({self.name!r})"


@dataclass(frozen=True, eq=False, repr=False)
class Gap:
    """The distance between two bodies over time, drawn between their nearest points.

    Attributes:
        name: name of the two, as in the constraint.
        starts, ends: nearest points, (k, 3) [m] each.
        distances: (k,) [m], negative where the bodies overlap.
        layer: name of the switch that shows it.
    """

    name: str
    starts: Array
    ends: Array
    distances: Array
    layer: str = "clearances"

    def __repr__(self) -> str:
        return f"Gap({self.name!r}, least {self.distances.min():.3g} m)"


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud:
    """Points over time, such as markers.

    Attributes:
        name: for the legend.
        positions: (k, m, 3), or (1, m, 3) if they do not move [m]; NaN where a point is not known.
        labels: names of the m points.
        layer: name of the switch that shows it.
        role: role whose colour it has; None: that of markers.
    """

    name: str
    positions: Array
    labels: tuple[str, ...]
    layer: str = "markers"
    role: Role | None = None

    def __repr__(self) -> str:
        return f"PointCloud({self.name!r}, {len(self.labels)} points)"


_EMPTY = 0.5  # [m], half the size of a scene in which there is nothing


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """One pane: actors and what is drawn around them; x points right, y forward and z up.

    Attributes:
        title: above the pane.
        time: time of the samples (k,), increasing; a single one if nothing moves.
        note: beside the title, in smaller type.
    """

    title: str
    time: Array
    actors: tuple[Actor, ...] = ()
    trails: tuple[Trail, ...] = ()
    solids: tuple[Solid, ...] = ()
    frames: tuple[FrameTrack, ...] = ()
    ellipsoids: tuple[EllipsoidTrack, ...] = ()
    gaps: tuple[Gap, ...] = ()
    clouds: tuple[PointCloud, ...] = ()
    note: str = ""

    def __repr__(self) -> str:
        return f"Scene({self.title!r}, {len(self.actors)} actors, {len(self.time)} samples)"

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the switches that it needs, in order of first use."""
        kinds = (
            *(self.actors, self.trails, self.solids, self.clouds),
            *(self.gaps, self.frames, self.ellipsoids),
        )
        names = [str(item.layer) for items in kinds for item in items]
        return tuple(name for name in dict.fromkeys(names) if name)

    def bounds(self) -> tuple[Array, Array]:
        """Return corners (3,) [m] of a box around the actors, the trails and obstacles of finite
        size.
        """
        points = [np.zeros((0, 3))]
        for actor in self.actors:
            for mesh in actor.meshes:
                box = np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
                corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
                turned = corners @ actor.rotations[mesh.link].transpose(0, 2, 1)
                points.append((turned + actor.positions[mesh.link][:, None]).reshape(-1, 3))
        points += [trail.points for trail in self.trails]
        points += [solid.vertices for solid in self.solids if not solid.unbounded]
        every = np.concatenate(points)
        if not len(every):
            return np.full(3, -_EMPTY), np.full(3, _EMPTY)
        return every.min(axis=0), every.max(axis=0)


SECONDS, PARAMETER = "time [s]", "path parameter s"


@dataclass(frozen=True)
class Span:
    """A named span of time, such as a synergy.

    Attributes:
        name: shown on the slider.
        start, stop: in the playback's time.
        text: full description, such as "synergy 3 (0.42 s)".
    """

    name: str
    start: float
    stop: float
    text: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Curve:
    """One line of a plot.

    Attributes:
        name: for the legend.
        time: (k,), increasing.
        values: (k,), in the unit of the plot.
        role: role whose colour and dashes it has; None: one of a series of line styles.
    """

    name: str
    time: Array
    values: Array
    role: Role | None = None

    def __repr__(self) -> str:
        return f"Curve({self.name!r}, {len(self.time)} samples)"


@dataclass(frozen=True, eq=False, repr=False)
class Plot:
    """Curves over time, drawn below the scenes.

    Attributes:
        label: label of the vertical axis, with its unit in brackets, as "hand speed [m/s]".
        curves: at least one.
        title: above the plot; usually what several plots of the same label differ in.
        marks: values of horizontal lines, such as limits.
        marked: what these are, for the legend.
    """

    label: str
    curves: tuple[Curve, ...]
    title: str = ""
    marks: tuple[float, ...] = ()
    marked: str = ""

    def __repr__(self) -> str:
        return f"Plot({self.label!r}, {len(self.curves)} curves)"


@dataclass(frozen=True, eq=False, repr=False)
class Playback:
    """Scenes side by side that are played together.

    Attributes:
        title: title of all.
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
