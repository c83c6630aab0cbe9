"""Playback: scenes with a common time, named spans of it, and curves over it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from geodesic_ocp.arrays import Array
from geodesic_ocp.scenes.actor import Role
from geodesic_ocp.scenes.scene import Scene

SECONDS, PARAMETER = "time [s]", "path parameter s"


@dataclass(frozen=True)
class Span:
    """A named span of time, such as a synergy.

    Attributes:
        name: shown on the slider.
        start, stop: in the playback's time.
        text: that describes it in full, such as "synergy 3 (0.42 s)".
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
        role: whose colour and dashes it has; None: one of a series of line styles.
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
        label: of the vertical axis, with its unit in brackets, as "hand speed [m/s]".
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
        title: of all.
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
        """The same with these layers shown at first, and all others hidden.

        Raises:
            ValueError: there is no such layer.
        """
        chosen = [layers] if isinstance(layers, str) else list(layers)
        for name in chosen:
            if name not in self.layers:
                known = ", ".join(self.layers) or "none"
                raise ValueError(f"layers: {name!r} must be one of {known}")
        return replace(self, hidden=tuple(name for name in self.layers if name not in chosen))
