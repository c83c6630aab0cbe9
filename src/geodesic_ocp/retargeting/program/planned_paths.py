"""The paths of all synergies, as the program over all of them found them."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False, repr=False)
class PlannedPaths:
    """The solution of the program.

    Attributes:
        starts: configurations in which the arms begin.
        paths: of the movements of each arm.
        within_reach: which poses each arm attains, at its m + 1 waypoints: neither out of reach,
            nor with links too near each other.
        near_misses: which poses each arm misses on purpose, to avoid a detour.
        longer: time added to each interval between `edges`, relative.
        edges: times [s] in the recording at which a movement of any arm begins or ends.
        action: of all paths at constant speed and in the person's time [J s].
        iterations: of Ipopt, on all grids.
        segments: of the last grids.
        success: whether the program is solved.
        status: how Ipopt stopped, a sentence.
        kept: numbers of the distances that entered the program.
        least_distances: along the paths (m,) [m], in the order of the clearance; empty without one.
        too_near: names of the distances that fall below their bounds by more than a millimetre,
            each with by how much [m], and the time in the recording [s].
    """

    starts: tuple[Array, ...]
    paths: tuple[tuple[Path, ...], ...]
    within_reach: tuple[tuple[bool, ...], ...]
    near_misses: tuple[tuple[bool, ...], ...]
    longer: Array
    edges: Array
    action: float
    iterations: int
    segments: int
    success: bool
    status: str
    kept: tuple[int, ...]
    least_distances: Array
    too_near: tuple[tuple[str, float, float], ...]

    def __repr__(self) -> str:
        count = sum(len(each) for each in self.paths)
        return (
            f"PlannedPaths({count} paths of action {self.action:.4g} J s, {self.iterations} "
            f"iterations on up to {self.segments} segments, {self.status})"
        )
