"""Gauss-Lobatto collocation in segments: nodes, weights, differentiation, interpolation.

Berrut and Trefethen, "Barycentric Lagrange Interpolation", SIAM Review 46 (2004), for the
interpolation and the differentiation matrix; the nodes are the zeros of (1 - x^2) P'_d(x).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_integer, as_vector, settle

_MAX_DEGREE = 100


@dataclass(frozen=True, repr=False)
class Grid(ShortRepr):
    """A grid on [0, 1]: segments, each with the degree + 1 Gauss-Lobatto nodes of one polynomial.

    Neighbouring segments share a node, so that there are segments * degree + 1 nodes.

    Attributes:
        segments: number of segments.
        degree: degree of the polynomials.
        ends: breakpoints of the segments from 0 to 1, (segments + 1,); None: equal widths.
        via_segments: indices of the breakpoints at which a problem's via points lie.

    Raises:
        ValueError: fewer than one segment, a degree below 2 or above 100, or breakpoints or indices
            that do not increase.
    """

    segments: int = 1
    degree: int = 20
    ends: tuple[float, ...] | None = None
    via_segments: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        ends = self.ends
        via = tuple(as_integer("via_segments", k, 1) for k in self.via_segments)
        segments = as_integer("segments", self.segments, 1)
        degree = as_integer("degree", self.degree, 2)
        if degree > _MAX_DEGREE:
            raise ValueError(f"degree must be 2 to {_MAX_DEGREE}, got {degree}")
        if ends is not None:
            ends = tuple(as_vector("ends", ends, segments + 1).tolist())
            if ends[0] != 0.0 or ends[-1] != 1.0 or not np.all(np.diff(ends) > 0.0):
                raise ValueError(f"ends must increase from 0 to 1, got {ends}")
        if via and not np.all(np.diff([0, *via, segments]) > 0):
            raise ValueError(f"via_segments must increase between 0 and {segments}, got {via}")
        values = {"segments": segments, "degree": degree, "ends": ends, "via_segments": via}
        for name, value in values.items():
            settle(self, **{name: value})

    def with_via_points(self, via_s: Sequence[float]) -> Grid:
        """Return the grid with via points at these s, increasing between 0 and 1.

        The segments are distributed in proportion to the distances between via points, at least
        two each, and have equal widths between two of them.

        Raises:
            ValueError: they do not increase between 0 and 1.
        """
        edges = np.array([0.0, *via_s, 1.0])
        if not np.all(np.diff(edges) > 0.0):
            raise ValueError(f"via points must increase between s = 0 and 1, got {list(via_s)}")
        counts = np.maximum(2, np.round(self.segments * np.diff(edges)).astype(int))
        via = np.cumsum(counts)
        ends = np.interp(np.arange(via[-1] + 1), [0, *via], edges)
        inner = tuple(via[:-1].tolist())
        return Grid(len(ends) - 1, self.degree, tuple(ends.tolist()), inner)

    def with_via_points_at(self, via_s: Sequence[float]) -> Grid:
        """Return the grid with its via points at other s; the segments between them are scaled."""
        old = [0.0, *self.breakpoints[list(self.via_segments)], 1.0]
        ends = np.interp(self.breakpoints, old, [0.0, *via_s, 1.0])
        return replace(self, ends=tuple(ends.tolist()))

    @property
    def via_s(self) -> Array:
        """Path parameters s of the via points."""
        return self.breakpoints[list(self.via_segments)]

    @property
    def via_nodes(self) -> list[int]:
        """Indices of the nodes at which the via points lie."""
        return [self.degree * segment for segment in self.via_segments]

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.segments * self.degree + 1

    @property
    def collocations(self) -> int:
        """Number of nodes of all segments, with shared nodes counted twice."""
        return self.segments * (self.degree + 1)

    @cached_property
    def breakpoints(self) -> Array:
        """Breakpoints of the segments, (segments + 1,)."""
        return np.array(self.ends or np.arange(self.segments + 1) / self.segments)

    @cached_property
    def widths(self) -> Array:
        """Widths of the segments, (segments,)."""
        equal = np.full(self.segments, 1.0 / self.segments)
        return equal if self.ends is None else np.diff(self.breakpoints)

    @cached_property
    def nodes(self) -> Array:
        """All nodes, increasing from 0 to 1, (size,)."""
        inner = (_reference(self.degree).nodes[:-1] + 1.0) / 2.0
        nodes = self.breakpoints[:-1, None] + self.widths[:, None] * inner
        return np.asarray(np.append(nodes.ravel(), 1.0))

    @cached_property
    def weights(self) -> Array:
        """Quadrature weights of the segments' nodes, (segments, degree + 1).

        Exact for polynomials up to degree 2 d - 1.
        """
        return np.asarray(np.outer(self.widths, _reference(self.degree).weights / 2.0))

    @cached_property
    def differentiation(self) -> Array:
        """Derivatives by s at the segments' nodes of the values there.

        (segments, degree + 1, degree + 1): multiply it with `in_segments`.
        """
        return np.asarray(
            (2.0 / self.widths)[:, None, None] * _reference(self.degree).differentiation
        )

    @cached_property
    def quadrature(self) -> Quadrature:
        """Quadrature of functions of position and velocity, finer than the grid's nodes.

        Gauss-Legendre with 1.5 times as many points as the degree, in each segment. With the nodes
        themselves as quadrature points, a coarse path can bend between them where the metric is
        large, and the discrete energy falls below that of the geodesic.
        """
        return self.gauss(-(-3 * self.degree // 2))

    def gauss(self, points: int) -> Quadrature:
        """Return Gauss-Legendre quadrature with so many points in each segment."""
        weights, values, slopes = _gauss(self.degree, points)
        return Quadrature(
            np.outer(self.widths, weights / 2.0),
            values,
            (2.0 / self.widths)[:, None, None] * slopes,
        )

    def in_segments(self, values: Array) -> Array:
        """Get values at all nodes (size, ...) arranged by segment, (segments, degree + 1, ...)."""
        index = self.degree * np.arange(self.segments)[:, None] + np.arange(self.degree + 1)
        return np.asarray(values[index])

    def interpolate(self, values: Array, s: ArrayLike) -> Array:
        """Return the piecewise polynomial at s (k,), from values by segment (segments, degree + 1,
        n).

        Slightly outside [0, 1] the first or the last polynomial is extrapolated.
        """
        times = np.asarray(s, dtype=float)
        segment = np.searchsorted(self.breakpoints[1:-1], times, side="right")
        x = 2.0 * (times - self.breakpoints[segment]) / self.widths[segment] - 1.0
        rows = _interpolation(_reference(self.degree), x)
        result: Array = np.einsum("kj,kjn->kn", rows, values[segment])
        return result


@dataclass(frozen=True)
class Quadrature:
    """Quadrature points within the segments of a grid: m per segment."""

    weights: Array  # (segments, m); they sum to one
    values: Array  # (m, degree + 1), from the values at a segment's nodes to those at its points
    slopes: Array  # (segments, m, degree + 1), to the derivatives by s at its points


@dataclass(frozen=True)
class _Reference:
    """One segment on [-1, 1]."""

    nodes: Array
    weights: Array
    barycentric: Array
    differentiation: Array


def _interpolation(reference: _Reference, x: Array) -> Array:
    """Return Barycentric interpolation from the nodes to x (k,) in [-1, 1]: (k, degree + 1)."""
    distance = x[:, None] - reference.nodes
    on_node = distance == 0.0
    terms = reference.barycentric / np.where(on_node, 1.0, distance)
    rows = np.where(on_node.any(axis=1, keepdims=True), on_node, terms)
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))


@lru_cache(maxsize=64)
def _gauss(degree: int, points: int) -> tuple[Array, Array, Array]:
    """Return weights of Gauss points, and matrices to values and slopes there."""
    x, weights = legendre.leggauss(points)
    values = _interpolation(_reference(degree), x)
    return weights, values, values @ _reference(degree).differentiation


@lru_cache(maxsize=64)
def interpolation_between(degree: int, finer: int, parts: int) -> tuple[Array, Array]:
    """Return matrices from values at a segment's nodes to values and slopes within its parts.

    (parts * (finer + 1), degree + 1) each, at the nodes of degree `finer` in each of equal parts.
    """
    inner = (_reference(finer).nodes + 1.0) / 2.0
    x = 2.0 * (np.arange(parts)[:, None] + inner).ravel() / parts - 1.0
    values = _interpolation(_reference(degree), x)
    return values, values @ _reference(degree).differentiation


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
    # Distances are scaled by the inverse capacity of the interval, so that products stay finite.
    barycentric = 1.0 / np.prod(2.0 * distance, axis=1)
    barycentric /= np.abs(barycentric).max()
    differentiation = barycentric / barycentric[:, None] / distance
    np.fill_diagonal(differentiation, 0.0)
    np.fill_diagonal(differentiation, -differentiation.sum(axis=1))
    return _Reference(nodes, weights, barycentric, differentiation)
