"""Capsules, balls and half-spaces."""

from __future__ import annotations

import pytest

import geodesic_ocp as go


def test_wrong_primitives_are_rejected(arm: go.Model) -> None:
    with pytest.raises(ValueError, match="radius must be positive"):
        go.Ball((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match=r"start must have shape \(3,\)"):
        go.Capsule((0.0, 0.0), (0.0, 0.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="normal must not be zero"):
        go.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="with a link"):
        arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1))
    with pytest.raises(ValueError, match="no frame 'elbow'"):
        arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1, "elbow"))
    assert arm.with_bodies(go.Ball((0.0, 0.0, 0.0), 0.1, "hand")).bodies[0].radius == 0.1
