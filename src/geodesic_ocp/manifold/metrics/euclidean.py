"""The Euclidean metric."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from geodesic_ocp.manifold.metric import Metric, as_metric


@dataclass(frozen=True)
class Euclidean(Metric):
    """The Euclidean metric of R^n, whose geodesics are straight lines."""

    dim: int

    def __post_init__(self) -> None:
        as_metric(self)

    def matrix(self, q: Any) -> Any:
        """The identity (n, n)."""
        return type(q).eye(self.dim)
