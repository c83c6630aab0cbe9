"""Configurations at the waypoints from which the program may start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.ik.collision_avoidance import CollisionAvoidance
from geodesic_ocp.ocp.ik.pose_search import PoseSearch
from geodesic_ocp.retargeting.poses.targets import REACHED, middle_of_ranges
from geodesic_ocp.retargeting.program.waypoints import ArmWaypoints

_STARTS = 96  # of the search at each waypoint
_CARRIED = 32  # more, the configurations found at the waypoint before
_MOST = 64  # configurations at a waypoint
_SAME = 0.05  # [rad or m]
# Poses out of reach: errors up to this factor above the least, and this much more [m or rad]. The
# nearest pose may be on the other side of a singularity.
_NEARLY, _MORE = 1.5, 0.02
MISSED = 1e3, 1e5  # range of weights of squared errors [1/m^2] or [1/rad^2]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Configurations (k, n) with the pose of a waypoint, or with the nearest ones.

    Attributes:
        q: the configurations.
        within_reach: whether they attain the pose.
        least: error of the one nearest to it [m or rad].
    """

    q: Array
    within_reach: bool
    least: float = 0.0

    @property
    def missed(self) -> float:
        """Weight of the squared error of a pose out of reach: the nearer, the larger; else zero."""
        return 0.0 if self.within_reach else float(np.clip(self.least**-2, *MISSED))

    def joined(self, other: Candidates) -> Candidates:
        """Those of both, or of the one that attains the pose."""
        if self.within_reach != other.within_reach:
            return self if self.within_reach else other
        least = min(self.least, other.least)
        return Candidates(_distinct([*self.q, *other.q]), self.within_reach, least)


def first_candidates(waypoints: ArmWaypoints) -> list[Candidates]:
    """Configurations at each waypoint, from random starts and those of the waypoint before."""
    found: list[Candidates] = []
    rng = np.random.default_rng(0)
    for number in range(waypoints.count + 1):
        if number == 0 and waypoints.start is not None:
            found.append(Candidates(waypoints.start[None, :], True))
            continue
        lower, upper = _search(waypoints, number, middle_of_ranges(waypoints.arm)[0]).bounds(
            waypoints.limited
        )
        starts = rng.uniform(lower, upper, (_STARTS, waypoints.arm.dof))
        before = found[-1].q[:_CARRIED] if found else middle_of_ranges(waypoints.arm)[0][None, :]
        found.append(candidates_near(waypoints, number, np.vstack([before, starts])))
    return found


def candidates_near(waypoints: ArmWaypoints, number: int, starts: Array) -> Candidates:
    """Configurations at one waypoint, each near one of the starts (k, n)."""
    search = _search(waypoints, number, starts[0])
    arm = waypoints.arm
    if waypoints.limited:
        bounds = arm.lower, arm.upper
    else:
        bounds = np.full(arm.dof, -np.inf), np.full(arm.dof, np.inf)
    q, errors = search.from_every_start(bounds, starts, waypoints.row_weights)
    least = float(errors.min())
    enough = REACHED * 1e-2
    within = least <= enough
    order = np.argsort(errors)
    chosen = order[errors[order] <= (enough if within else _NEARLY * least + _MORE)]
    return Candidates(_distinct(list(q[chosen]))[:_MOST], within, 0.0 if within else least)


def _search(waypoints: ArmWaypoints, number: int, near: Array) -> PoseSearch:
    pose = waypoints.poses[number]
    return PoseSearch.checked(
        *("retarget", waypoints.arm, near, pose.position, pose.rotation, CollisionAvoidance())
    )


def _distinct(configurations: Sequence[Array]) -> Array:
    """Those that differ from all before them."""
    kept = np.empty((0, len(configurations[0])))
    for q in configurations:
        if not len(kept) or np.abs(kept - q).max(axis=1).min() > _SAME:
            kept = np.vstack([kept, q])
    return kept
