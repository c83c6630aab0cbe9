"""A constrained problem with a known solution, and a check of the derivatives of an NLP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go
from geodesic_ocp.ocp.transcription import Transcription


@dataclass(frozen=True)
class PlaneAroundDisc(go.Problem):
    """From (-1, 0) to (1, 0) around a disc at the origin: two tangents and an arc."""

    radius: float = 0.5
    metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (-1.0, 0.0)), (q1, (1.0, 0.0), "far side")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.radius, ca.norm_2(q), np.inf, "disc")]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, np.sin(np.pi * s)])

    @property
    def exact_length(self) -> float:
        tangent = np.sqrt(1.0 - self.radius**2)
        return 2.0 * (tangent + self.radius * np.arcsin(self.radius))


def check_derivatives(
    transcription: Transcription, p: np.ndarray, rng: np.random.Generator
) -> None:
    """Derivatives assembled from those of one node, against CasADi's of the whole NLP."""
    x = ca.MX.sym("x", transcription.dim * transcription.grid.size)
    (f, g), (_, gradient) = transcription.differentiable(x, p), transcription.objective(x, p)
    factors = rng.normal(size=g.shape[0])
    outputs = [ca.hessian(1.7 * f + ca.dot(factors, g), x)[0], ca.gradient(f, x), gradient]
    outputs += [ca.jacobian(g, x), transcription.constraints(x, p)[1]]
    nodes = rng.normal(size=x.shape[0])
    hessian, *pairs = (out.full() for out in ca.Function("whole", [x], outputs)(nodes))
    for expected, assembled in (pairs[:2], pairs[2:]):
        np.testing.assert_allclose(assembled, expected, rtol=1e-12, atol=1e-14)
    upper = transcription.hessian(nodes, p, 1.7, factors).full()
    assert np.abs(upper - np.triu(hessian)).max() < 1e-13 * np.abs(hessian).max()
