"""Outlines, those behind drawn first: arms and obstacles seen from one side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Colour = tuple[float, float, float]
_LAYER = 1e-3  # between the zorders of collections


@dataclass(frozen=True, eq=False, repr=False)
class Shape:
    """The outline of something in a figure.

    Attributes:
        outlines: convex polygons (m, 2) whose union it is.
        depth: how near to the observer it is.
        face: colour in it.
        edge: colour of its outline.
        width: of its outline [pt].
        hatch: pattern in it.
    """

    outlines: tuple[Array, ...]
    depth: float
    face: Colour
    edge: Colour
    width: float = 0.7
    hatch: str = ""

    def __repr__(self) -> str:
        return f"Shape({len(self.outlines)} outlines at depth {self.depth:.3g})"

    def moved(self, shift: ArrayLike) -> Shape:
        """The shape elsewhere in the figure."""
        outlines = tuple(outline + np.asarray(shift) for outline in self.outlines)
        return replace(self, outlines=outlines)


def mixed(colour: str, white: float) -> Colour:
    """A colour with this share of white."""
    from matplotlib.colors import to_rgb

    red, green, blue = (white + (1.0 - white) * each for each in to_rgb(colour))
    return red, green, blue


def draw_shapes(axes: Axes, shapes: Iterable[Shape], zorder: float = 2.0) -> None:
    """Draw shapes, those farther from the observer first; the axes' limits stay as they are."""
    ordered = sorted(shapes, key=lambda shape: shape.depth)
    runs = groupby(ordered, key=lambda shape: shape.hatch)
    for layer, (_, run) in enumerate(runs):
        _draw_run(axes, list(run), zorder + _LAYER * layer)


def _draw_run(axes: Axes, shapes: Sequence[Shape], zorder: float) -> None:
    from matplotlib.collections import PolyCollection

    outlines: list[Array] = []
    faces, edges, widths = [], [], []
    for shape in shapes:
        if len(shape.outlines) == 1:
            outlines.append(shape.outlines[0])
            faces.append(shape.face)
            edges.append(shape.edge)
            widths.append(shape.width)
            continue
        # Lines of twice the width, and fills over their inner halves: the outline of the union.
        count = len(shape.outlines)
        outlines += [*shape.outlines, *shape.outlines]
        faces += [shape.face] * (2 * count)
        edges += [shape.edge] * count + [shape.face] * count
        widths += [2.0 * shape.width] * count + [0.0] * count
    axes.add_artist(
        PolyCollection(
            outlines,
            facecolors=faces,
            edgecolors=edges,
            linewidths=widths,
            hatch=shapes[0].hatch or None,
            joinstyle="round",
            zorder=zorder,
        )
    )
