"""How close the links of robots come to each other over a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field

from geodesic_ocp.table import Table


@dataclass(frozen=True)
class ClosestApproach:
    """Where two links are closest.

    Attributes:
        one, other: names of the links.
        distance: between them [m]; 0 if they touch or overlap.
        sample: index of the configuration.
        time: of the sample [s]; None if the trajectory has no times.
    """

    one: str
    other: str
    distance: float
    sample: int
    time: float | None


@dataclass(frozen=True, eq=False, repr=False)
class ClearanceReport:
    """How close the links of robots come to each other over a trajectory.

    Attributes:
        closest: the closest pairs of links, the closest first.
        pairs: number of pairs that were compared.
        samples: number of configurations.
        unknown: what is not known, a sentence each.
    """

    closest: tuple[ClosestApproach, ...]
    pairs: int
    samples: int
    unknown: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        if not self.closest:
            return f"ClearanceReport(not known: {'; '.join(self.unknown)})"
        first = self.closest[0]
        found = (
            f"{first.one} to {first.other} {first.distance:.4g} m, the least of {self.pairs} pairs"
        )
        return f"ClearanceReport({'; '.join([found, *self.unknown])})"

    def __str__(self) -> str:
        return str(self.table())

    @property
    def least(self) -> float | None:
        """Least distance of any two links [m], 0 if some touch; None if it is not known."""
        return self.closest[0].distance if self.closest else None

    @property
    def pair(self) -> tuple[str, str] | None:
        """The links that come closest; None if it is not known."""
        return (self.closest[0].one, self.closest[0].other) if self.closest else None

    @property
    def time(self) -> float | None:
        """When they come closest [s]; None if it is not known."""
        return self.closest[0].time if self.closest else None

    def table(self) -> Table:
        """The closest pairs, with what is not known as a note."""
        rows = tuple(
            (
                f"{each.one} to {each.other}",
                each.distance,
                each.sample if each.time is None else each.time,
            )
            for each in self.closest
        )
        instant = "sample" if any(each.time is None for each in self.closest) else "time [s]"
        return Table(("links", "distance [m]", instant), rows, " ".join(self._sentences()))

    def _sentences(self) -> list[str]:
        return [f"{each[:1].upper()}{each[1:]}." for each in self.unknown]

    def _repr_markdown_(self) -> str:
        return self.table().markdown()
