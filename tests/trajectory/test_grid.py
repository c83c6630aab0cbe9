"""Gauss-Lobatto grids, and paths on them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_metrics import Sphere
from numpy.testing import assert_allclose

import geodesic_ocp as go

EVEN = st.builds(go.Grid, segments=st.integers(1, 6), degree=st.integers(2, 40))


@st.composite
def uneven(draw: st.DrawFn) -> go.Grid:
    widths = np.array(draw(st.lists(st.floats(0.1, 1.0), min_size=1, max_size=6)))
    ends = np.cumsum([0.0, *widths / widths.sum()])
    ends[-1] = 1.0
    return go.Grid(widths.size, draw(st.integers(2, 40)), tuple(ends))


GRIDS = EVEN | uneven()


@given(grid=GRIDS)
def test_nodes_and_weights(grid: go.Grid) -> None:
    nodes = grid.nodes
    assert nodes.shape == (grid.size,)
    assert nodes[0] == 0.0
    assert nodes[-1] == 1.0
    assert np.all(np.diff(nodes) > 0)
    assert np.all(grid.weights > 0)
    assert np.array_equal(nodes[:: grid.degree], grid.breakpoints)


@given(grid=EVEN)
def test_even_grids_are_symmetric(grid: go.Grid) -> None:
    nodes = grid.nodes
    assert nodes + nodes[::-1] == pytest.approx(np.ones(grid.size), abs=1e-15)
    ends = tuple(np.linspace(0.0, 1.0, grid.segments + 1))
    again = go.Grid(grid.segments, grid.degree, ends)
    assert_allclose(again.nodes, nodes, rtol=0, atol=1e-15)
    assert_allclose(again.differentiation, grid.differentiation, rtol=1e-13, atol=1e-12)


@given(grid=GRIDS, power=st.integers(0, 79))
def test_quadrature_is_exact_to_degree_2d_minus_1(grid: go.Grid, power: int) -> None:
    power = min(power, 2 * grid.degree - 1)
    values = grid.in_segments(grid.nodes**power)
    assert np.sum(values * grid.weights) == pytest.approx(1.0 / (power + 1), rel=1e-11)


@given(grid=GRIDS, seed=st.integers(0, 2**32 - 1))
def test_polynomials_of_the_degree_are_exact(grid: go.Grid, seed: int) -> None:
    rng = np.random.default_rng(seed)
    polynomial = np.polynomial.Chebyshev(rng.normal(size=grid.degree + 1), domain=[0, 1])
    values = grid.in_segments(polynomial(grid.nodes))[..., None]
    s = rng.uniform(0.0, 1.0, 20)
    size = np.abs(polynomial(np.linspace(0, 1, 200))).max()
    assert grid.interpolate(values, s)[:, 0] == pytest.approx(polynomial(s), abs=1e-12 * size)
    slopes = grid.interpolate(grid.differentiation @ values, s)[:, 0]
    steepest = np.abs(polynomial.deriv()(np.linspace(0, 1, 200))).max()
    assert slopes == pytest.approx(polynomial.deriv()(s), abs=1e-9 * steepest + 1e-9 * size)


def test_interpolation_on_and_between_nodes() -> None:
    grid = go.Grid(3, 5)
    values = grid.in_segments(np.exp(grid.nodes))[..., None]
    assert grid.interpolate(values, grid.nodes)[:, 0] == pytest.approx(np.exp(grid.nodes))


def test_wrong_grids_are_named() -> None:
    with pytest.raises(ValueError, match="segments must be a positive integer, got 0"):
        go.Grid(0, 4)
    with pytest.raises(ValueError, match="degree must be an integer of at least 2, got 1"):
        go.Grid(1, 1)
    with pytest.raises(ValueError, match=r"segments must be a positive integer, got 1\.5"):
        go.Grid(1.5, 4)
    with pytest.raises(ValueError, match=r"ends must have shape \(3,\), got \(2,\)"):
        go.Grid(2, 4, (0.0, 1.0))
    with pytest.raises(ValueError, match="ends must increase from 0 to 1"):
        go.Grid(2, 4, (0.0, 1.2, 1.0))


def circle(s: np.ndarray) -> np.ndarray:
    return np.column_stack([np.full(len(s), 1.0), 2.0 * s])


def test_path_length_energy_and_derivatives() -> None:
    grid = go.Grid(2, 8)
    path = go.Path(Sphere(), grid, circle(grid.nodes))
    assert path.length == pytest.approx(2.0 * np.sin(1.0), rel=1e-12)
    assert path.energy == pytest.approx(path.length**2 / 2, rel=1e-12)
    assert path(0.3) == pytest.approx([1.0, 0.6])
    assert path([0.0, 0.5, 1.0], 1) == pytest.approx(np.tile([0.0, 2.0], (3, 1)), abs=1e-12)
    assert path(0.7, order=2) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_length_of_a_path_with_a_corner() -> None:
    """The derivative jumps where segments meet: each side counts with its own."""
    grid = go.Grid(2, 4)
    bent = np.where(grid.nodes < 0.5, -grid.nodes, 5.0 * grid.nodes - 3.0)
    nodes = np.column_stack([bent, np.zeros(grid.size)])
    assert go.Path(go.Euclidean(2), grid, nodes).length == pytest.approx(0.5 + 2.5, rel=1e-10)


def test_wrong_paths_and_arguments_are_named() -> None:
    grid = go.Grid(1, 4)
    with pytest.raises(ValueError, match=r"nodes must have shape \(5, 2\), got \(4, 2\)"):
        go.Path(Sphere(), grid, np.zeros((4, 2)))
    with pytest.raises(ValueError, match="nodes must be finite"):
        go.Path(Sphere(), grid, np.full((5, 2), np.nan))
    path = go.Path(Sphere(), grid, circle(grid.nodes))
    for s in (-0.1, 1.1, np.nan, [0.5, 2.0]):
        with pytest.raises(ValueError, match=r"s must lie in \[0, 1\]"):
            path(s)
    with pytest.raises(ValueError, match="order must not be negative"):
        path(0.5, -1)


@given(degree=st.integers(2, 24), segments=st.integers(1, 4))
def test_quadrature_integrates_products_of_path_and_metric(degree: int, segments: int) -> None:
    """It is exact for polynomials of degree 3 d - 1, in values and in slopes."""
    grid = go.Grid(segments, degree)
    quadrature = grid.quadrature
    s = grid.in_segments(grid.nodes)
    path = s**degree  # its square times its slope has degree 3 d - 1
    density = (quadrature.values @ path[..., None])[..., 0] ** 2 * (
        quadrature.slopes @ path[..., None]
    )[..., 0]
    integral = float(np.sum(quadrature.weights * density))
    assert integral == pytest.approx(1.0 / 3.0, rel=1e-11)
