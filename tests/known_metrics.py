"""Metrics whose geodesics are known in closed form."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go

# In the documented form of a file of known geodesics.
DIAGONAL: dict[str, Any] = {
    "name": "diagonal",
    "metric": {"kind": "euclidean", "dim": 2},
    "q0": [0.0, 0.0],
    "v0": [3.0, 4.0],
    "q1": [3.0, 4.0],
    "length": 5.0,
    "log": True,
    "tolerances": {"exp": 1e-10, "log": 1e-9},
    "points": [{"s": 0.5, "q": [1.5, 2.0]}],
    "source": "Pythagoras.",
}


class Sphere(go.Metric):
    """The unit sphere in colatitude and longitude: ds^2 = dt^2 + sin^2 t dp^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))


class HalfPlane(go.Metric):
    """The hyperbolic upper half-plane in (x, y): ds^2 = (dx^2 + dy^2) / y^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return type(q).eye(2) / q[1] ** 2


class PolarPlane(go.Metric):
    """The Euclidean plane in radius and angle: ds^2 = dr^2 + r^2 dp^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return ca.diag(ca.vertcat(1.0, q[0] ** 2))


class OutsideEllipse(go.Metric):
    """Flat, but undefined in an ellipse about the origin."""

    dim = 2

    def matrix(self, q: ca.SX) -> ca.SX:
        outside = q[1] ** 2 + 4.0 * q[0] ** 2 > 0.3
        return type(q).eye(2) * ca.if_else(outside, 1.0, np.nan)


def on_sphere(q: np.ndarray) -> np.ndarray:
    """Points of R^3 (..., 3) for colatitude and longitude (..., 2)."""
    t, p = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)


def half_plane_distance(a: np.ndarray, b: np.ndarray) -> float:
    """arcosh(1 + |a - b|^2 / (2 a_y b_y))."""
    return float(np.arccosh(1.0 + np.sum((a - b) ** 2) / (2.0 * a[1] * b[1])))


def in_plane(q: np.ndarray) -> np.ndarray:
    """Cartesian points (..., 2) for polar coordinates (..., 2)."""
    r, p = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack([r * np.cos(p), r * np.sin(p)], axis=-1)
