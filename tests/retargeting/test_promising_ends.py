"""The ends of paths that are tried first are those to which paths have little energy."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.retargeting.least_energy import least_energy_path
from geodesic_ocp.retargeting.promising_ends import promising_ends
from geodesic_ocp.retargeting.targets import KeyPose, Pose, PoseFinder, line_energy

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
END = np.array([2.6, 0.7, -2.1, 2.4, -1.4, -0.2, -1.2])
TOLERANCE = 1e-4


@pytest.fixture
def target(arm: go.Model) -> KeyPose:
    rotation, _ = arm.hand_pose(END)
    return KeyPose(Pose(rotation, None), END, (0.0, 0.0))


def test_first_end_has_the_path_of_least_energy(arm: go.Model, target: KeyPose) -> None:
    finder = PoseFinder(arm, go.RetargetingSettings(num_starts=3), TOLERANCE)
    ends = promising_ends(finder, START, target, np.inf)
    lines, energies = [], []
    for end, rough in ends:
        assert rough is not None
        path = least_energy_path(arm, START, target.pose, end, limits=True, tolerance=TOLERANCE)
        assert path.success
        assert rough.energy == pytest.approx(path.energy, rel=2e-2)
        lines.append(line_energy(arm, START, end))
        energies.append(path.energy)
    assert len(energies) > 1
    assert energies[0] == min(energies)
    assert lines[0] > min(lines)  # the straight line would have misled


def test_energies_of_fast_paths_count_more(arm: go.Model, target: KeyPose) -> None:
    """A joint that can move only little decides."""
    settings = go.RetargetingSettings(num_starts=3)
    finder = PoseFinder(arm, settings, TOLERANCE)
    reach = np.full(arm.dof, np.inf)
    for joint in range(arm.dof):
        reach[joint] = 1e-3
        costs = [
            rough.energy * max(1.0, float((np.abs(rough.path.nodes[-1] - START) / reach).max()))
            for _, rough in promising_ends(finder, START, target, reach)[:3]
            if rough is not None
        ]
        assert costs == sorted(costs)
        reach[joint] = np.inf
