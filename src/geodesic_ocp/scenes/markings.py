"""What is drawn around the actors of a scene: paths, frames, ellipsoids, distances, points."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Indices
from geodesic_ocp.scenes.actor import Role


@dataclass(frozen=True, eq=False, repr=False)
class Trail:
    """A line in a scene, such as the path of a hand, with a dot that moves along it.

    Attributes:
        name: for the legend.
        points: of the line, (m, 3) [m].
        role: whose colour it has.
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
        name: of the frame.
        rotations: in the scene, (k, 3, 3) or (1, 3, 3).
        positions: of its origin, (k, 3) or (1, 3) [m].
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
        name: of the two, as in the constraint.
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
        role: whose colour it has; None: that of markers.
    """

    name: str
    positions: Array
    labels: tuple[str, ...]
    layer: str = "markers"
    role: Role | None = None

    def __repr__(self) -> str:
        return f"PointCloud({self.name!r}, {len(self.labels)} points)"
