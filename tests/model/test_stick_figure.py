"""Stick figures against lengths and positions that are known."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.model.stick_figure import stick_figure


def test_an_arm_is_a_chain_of_rigid_links_from_shoulder_to_hand(
    arm: go.Model, rng: np.random.Generator
) -> None:
    q = rng.uniform(arm.lower, arm.upper, (20, 7))
    links = stick_figure(arm, q)
    assert links.shape == (20, 3, 2, 3)
    assert links[:, 0, 0] == pytest.approx(0.0, abs=1e-12)
    assert np.array_equal(links[:, 1:, 0], links[:, :-1, 1])
    assert links[:, -1, 1] == pytest.approx(arm.hand_pose(q)[1], abs=1e-12)
    lengths = np.linalg.norm(links[:, :, 1] - links[:, :, 0], axis=-1)
    assert lengths == pytest.approx(np.tile(lengths[0], (20, 1)), abs=1e-12)
    assert lengths[0, :2] == pytest.approx([0.188 * 1.75, 0.145 * 1.75])


def test_both_arms_end_in_hands() -> None:
    left, right = (go.human_arm(side) for side in ("left", "right"))
    shoulders = np.array([[-0.2, 0.0, 1.4], [0.2, 0.0, 1.4]])
    q = np.linspace(-0.3, 0.3, 14)
    links = stick_figure(go.combine(left, right, placements=list(shoulders)), q)[0]
    ends = [arm.hand_pose(q[part])[1] for arm, part in ((left, slice(7)), (right, slice(7, 14)))]
    drawn = links[:, 1]
    for end, shoulder in zip(ends, shoulders, strict=True):
        assert np.linalg.norm(drawn - (shoulder + end), axis=1).min() < 1e-12
    assert len(links) == 6
