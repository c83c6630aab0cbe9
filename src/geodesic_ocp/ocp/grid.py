"""Gauss-Lobatto collocation in segments: nodes, weights, differentiation, interpolation.

Berrut and Trefethen, "Barycentric Lagrange Interpolation", SIAM Review 46 (2004), for the
interpolation and the differentiation matrix; the nodes are the zeros of (1 - x^2) P'_d(x).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from numbers import Integral

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

_MAX_DEGREE = 100


@dataclass(frozen=True)
class Grid:
    """[0, 1] in equal segments, in each the degree + 1 Gauss-Lobatto nodes of one polynomial.

    Neighbouring segments share a node, so that there are segments * degree + 1 nodes in all.

    Raises:
        ValueError: fewer than one segment, or a degree below 2 or above 100.
    """

    segments: int = 1
    degree: int = 20

    def __post_init__(self) -> None:
        for name in ("segments", "degree"):
            value = getattr(self, name)
            if not isinstance(value, Integral):
                raise ValueError(f"{name} must be an integer, got {value!r}")
            object.__setattr__(self, name, int(value))
        if self.segments < 1:
            raise ValueError(f"segments must be at least 1, got {self.segments}")
        if not 2 <= self.degree <= _MAX_DEGREE:
            raise ValueError(f"degree must be 2 to {_MAX_DEGREE}, got {self.degree}")

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.segments * self.degree + 1

    @property
    def collocations(self) -> int:
        """Number of nodes of all segments, shared nodes counted in each."""
        return self.segments * (self.degree + 1)

    @property
    def breakpoints(self) -> Array:
        """Ends of the segments, (segments + 1,)."""
        return np.linspace(0.0, 1.0, self.segments + 1)

    @cached_property
    def nodes(self) -> Array:
        """All nodes, increasing from 0 to 1, (size,)."""
        inner = (_reference(self.degree).nodes[:-1] + 1.0) / 2.0
        starts = np.arange(self.segments)[:, None]
        return np.asarray(np.append(((starts + inner) / self.segments).ravel(), 1.0))

    @cached_property
    def weights(self) -> Array:
        """Quadrature weights of one segment's nodes, (degree + 1,); exact to degree 2 d - 1."""
        return _reference(self.degree).weights / (2.0 * self.segments)

    @cached_property
    def differentiation(self) -> Array:
        """Derivatives by s at one segment's nodes of the values there, (degree + 1, degree + 1)."""
        return _reference(self.degree).differentiation * 2.0 * self.segments

    def in_segments(self, values: Array) -> Array:
        """Values at all nodes (size, ...) by segment, (segments, degree + 1, ...)."""
        index = self.degree * np.arange(self.segments)[:, None] + np.arange(self.degree + 1)
        return np.asarray(values[index])

    def interpolate(self, values: Array, s: ArrayLike) -> Array:
        """The piecewise polynomial at s (k,), from values by segment (segments, degree + 1, n).

        Arguments a little outside [0, 1] extend the first and the last polynomial.
        """
        times = np.asarray(s, dtype=float)
        segment = np.clip(np.floor(times * self.segments).astype(int), 0, self.segments - 1)
        x = 2.0 * (times * self.segments - segment) - 1.0
        reference = _reference(self.degree)
        distance = x[:, None] - reference.nodes
        on_node = distance == 0.0
        terms = reference.barycentric / np.where(on_node, 1.0, distance)
        rows = np.where(on_node.any(axis=1, keepdims=True), on_node, terms)
        rows = rows / rows.sum(axis=1, keepdims=True)
        result: Array = np.einsum("kj,kjn->kn", rows, values[segment])
        return result


@dataclass(frozen=True)
class _Reference:
    """One segment on [-1, 1]."""

    nodes: Array
    weights: Array
    barycentric: Array
    differentiation: Array


@lru_cache(maxsize=64)
def _reference(degree: int) -> _Reference:
    polynomial = np.zeros(degree + 1)
    polynomial[degree] = 1.0
    slope = legendre.legder(polynomial)
    inner = legendre.legroots(slope).real
    for _ in range(2):  # Newton's method polishes the eigenvalue solver's roots
        inner = inner - legendre.legval(inner, slope) / legendre.legval(
            inner, legendre.legder(slope)
        )
    nodes = np.concatenate([[-1.0], np.sort(inner), [1.0]])
    nodes = (nodes - nodes[::-1]) / 2.0
    weights = 2.0 / (degree * (degree + 1) * legendre.legval(nodes, polynomial) ** 2)

    distance = nodes[:, None] - nodes
    np.fill_diagonal(distance, 1.0)
    # Products of distances under- and overflow at high degrees: 2 is the interval's capacity.
    barycentric = 1.0 / np.prod(2.0 * distance, axis=1)
    barycentric /= np.abs(barycentric).max()
    differentiation = barycentric / barycentric[:, None] / distance
    np.fill_diagonal(differentiation, 0.0)
    np.fill_diagonal(differentiation, -differentiation.sum(axis=1))
    return _Reference(nodes, weights, barycentric, differentiation)
