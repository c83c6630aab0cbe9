"""Collision bodies that are kept apart, and their smallest distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from geodesic_ocp.arrays import as_number
from geodesic_ocp.model.distances import as_pair
from geodesic_ocp.model.primitives import Obstacle


class CollisionAvoidance(NamedTuple):
    """Arguments of `signed_distances`, and the smallest distance allowed [m]."""

    obstacles: tuple[Obstacle, ...] = ()
    links: tuple[str, ...] | None = None
    pairs: tuple[tuple[str, str], ...] = ()
    margin: float = 0.0

    @classmethod
    def checked(
        cls,
        obstacles: Sequence[Obstacle],
        links: Sequence[str] | None,
        pairs: Sequence[tuple[str, str]],
        margin: float,
    ) -> CollisionAvoidance:
        """From arguments as users give them; ValueError if a pair or the margin is malformed."""
        links = None if links is None else tuple(links)
        return cls(tuple(obstacles), links, tuple(map(as_pair, pairs)), as_number("margin", margin))

    @property
    def bodies(self) -> tuple[Any, Any, Any]:
        """Everything but the margin, which enters programs as a bound."""
        return self.obstacles, self.links, self.pairs

    @property
    def is_empty(self) -> bool:
        """Whether nothing is kept apart."""
        return not (self.obstacles or self.pairs)
