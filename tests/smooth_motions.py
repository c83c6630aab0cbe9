"""Synthetic smooth motions of the right arm."""

from __future__ import annotations

import numpy as np

import geodesic_ocp as go

_NAMES = go.human_arm("right").joint_names


def swinging() -> go.Motion:
    """Two seconds at 100 Hz, every joint at a frequency of its own."""
    time = np.arange(0.0, 2.0, 0.01)
    swing = np.sin(np.outer(time, [1.0, 1.7, 0.8, 2.0, 1.3, 2.2, 0.9]))
    centre = np.array([0.6, 0.1, -0.8, 1.3, 0.1, -0.1, -0.1])
    return go.Motion(time, centre + 0.3 * swing, _NAMES)


def reversing() -> go.Motion:
    """0.9 s in 46 samples with velocities; the joints reverse at different times."""
    time = np.linspace(0.0, 0.9, 46)
    rates = np.array([5.0, 7.0, 4.0, 9.0, 6.0, 11.0, 8.0])
    phase = time[:, None] * rates + np.arange(7)
    q = [0.3, 0.1, -0.7, 1.0, 0.1, 0.0, 0.1] + 0.2 * np.sin(phase)
    return go.Motion(time, q, _NAMES, 0.2 * rates * np.cos(phase))
