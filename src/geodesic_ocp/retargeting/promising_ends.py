"""Configurations in which a path to a hand pose may end, the most promising ones first."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.least_energy import FoundPath, least_energy_path
from geodesic_ocp.retargeting.targets import KeyPose, PoseFinder, line_energy

_COMPARED = 3  # ends whose rough paths are compared
_PROMISING = 2.5  # times the least energy of a straight line


def promising_ends(
    finder: PoseFinder, start: Array, target: KeyPose, reach: Array | float
) -> list[tuple[Array, FoundPath | None]]:
    """Ends (n,) of a path, by the energy of a rough path to each, which is returned with them.

    The energy of a straight line says little about that of the path, whose end moves along the
    configurations with the pose. Where even a path of uniform speed takes longer than the time
    there is, the energy counts as many times more: a fast path of little energy would slow the
    whole motion.

    Args:
        finder: inverse kinematics of the robot under the settings.
        start: configuration (n,) of the path.
        target: pose of the hand at its end.
        reach: how far each joint moves at most in the time there is (n,) [rad or m].
    """
    settings, arm = finder.settings, finder.arm
    ends = finder.end_configurations(start, target)
    if not settings.collisions.is_empty:  # rough paths ignore them
        return [(end, None) for end in ends]
    compared = max(_COMPARED, settings.num_starts)
    lines = [line_energy(arm, start, end) for end in ends[:compared]]
    promising = [
        end
        for number, (end, energy) in enumerate(zip(ends, lines, strict=False))
        if number < settings.num_starts or energy <= _PROMISING * lines[0]
    ]
    ranked = []
    for end in promising:
        pose = target.pose if target.within_reach else target.pose.reached_by(arm, end)
        rough = least_energy_path(
            *(arm, start, pose, end),
            limits=settings.within_limits,
            tolerance=finder.tolerance,
            is_rough=True,
        )
        scale = float((np.abs(rough.path.nodes[-1] - start) / reach).max())
        cost = rough.energy * max(1.0, scale) if rough.success else np.inf
        ranked.append((cost, end, rough))
    ranked.sort(key=lambda each: each[0])
    others = [(end, None) for end in ends[len(promising) :]]
    return [*((end, rough) for _, end, rough in ranked), *others]
