"""Configurations at the waypoints from which the program may start."""

from __future__ import annotations

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
_NEAR = 32  # more of them that miss a pose within reach
_ROUNDS = 4  # of searches, whose results are joined
_MISSED = 1e3, 1e5  # range of weights of squared errors [1/m^2] or [1/rad^2]
_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Candidates:
    """Configurations (k, n) with the pose of a waypoint, or with the nearest ones.

    Attributes:
        q: the configurations.
        errors: of their poses (k,) [m or rad]; zero for those that attain the pose.
    """

    q: Array
    errors: Array

    @classmethod
    def attaining(cls, *configurations: Array) -> Candidates:
        """Configurations with the pose."""
        return cls(np.array(configurations), np.zeros(len(configurations)))

    @property
    def within_reach(self) -> bool:
        """Whether any of them attains the pose."""
        return bool(self.errors.min() == 0.0)

    @property
    def missed(self) -> Array:
        """Weights of the squared errors (k,); zero for those that attain the pose.

        The nearer the pose, the larger: of a pose out of reach as that of the nearest one, and of
        one within reach as that of each.
        """
        least = self.errors if self.within_reach else np.full_like(self.errors, self.errors.min())
        weights = np.clip(np.maximum(least, _TINY) ** -2, *_MISSED)
        return np.where(self.errors == 0.0, 0.0, weights)

    def joined(self, other: Candidates, near_misses: float) -> Candidates:
        """Those of both; if any attains the pose, without larger errors than `near_misses`."""
        q = np.vstack([self.q, other.q])
        errors = np.concatenate([self.errors, other.errors])
        return _chosen(q, errors, near_misses, _MOST * _ROUNDS)


def first_candidates(waypoints: ArmWaypoints) -> list[Candidates]:
    """Configurations at each waypoint, from random starts and those of the waypoint before."""
    found: list[Candidates] = []
    rng = np.random.default_rng(0)
    for number in range(waypoints.count + 1):
        if number == 0 and waypoints.start is not None:
            found.append(Candidates.attaining(waypoints.start))
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
    errors = np.where(errors <= REACHED * 1e-2, 0.0, errors)
    return _chosen(q, errors, waypoints.near_misses, _MOST)


def _chosen(q: Array, errors: Array, near_misses: float, most: int) -> Candidates:
    """Distinct ones of configurations (k, n), up to a number, those with the least errors first."""
    least = float(errors.min())
    largest = near_misses if least == 0.0 else _NEARLY * least + _MORE
    order = np.argsort(errors, kind="stable")
    order = order[errors[order] <= largest]
    kept: list[int] = []
    near = 0
    for index in order.tolist():
        if kept and np.abs(q[kept] - q[index]).max(axis=1).min() <= _SAME:
            continue
        near += bool(least == 0.0 and errors[index] > 0.0)
        if len(kept) - near >= most or near > _NEAR:
            continue
        kept.append(index)
    return Candidates(q[kept], errors[kept])


def _search(waypoints: ArmWaypoints, number: int, near: Array) -> PoseSearch:
    pose = waypoints.poses[number]
    return PoseSearch.checked(
        *("retarget", waypoints.arm, near, pose.position, pose.rotation, CollisionAvoidance())
    )
