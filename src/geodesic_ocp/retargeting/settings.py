"""Settings of retargeting, and the distances that the motion keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeAlias, cast, get_args

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import (
    Array,
    ShortRepr,
    as_integer,
    as_not_negative,
    as_number,
    as_positive,
    settle,
)
from geodesic_ocp.execution.clearance import Clearance, joined_clearance, keep_clear
from geodesic_ocp.execution.link_pairs import link_pairs, sampled_configurations
from geodesic_ocp.logarithm.geodesic_to_pose import ENERGY_WEIGHT
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.pose_search import CollisionAvoidance

Formulation = Literal["constrained", "geodesic"]
Tolerance: TypeAlias = tuple[float | str, float | str]
# Of a distance and of an angle, in m and rad; a unit follows those that end in it.
_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}, {"deg": np.pi / 180.0, "rad": 1.0}


@dataclass(frozen=True, repr=False)
class RetargetingSettings(ShortRepr):
    """Settings of `retarget`, which are also options of `geodesic-ocp retarget`.

    Weights are relative to the energy of the paths, in units of the least action.

    Attributes:
        formulation: constrained: all synergies in one program, paths of low energy between
            configurations in which the hand has the target poses; a pose out of reach is replaced
            by one nearby. geodesic: one synergy after the other, each the free
            geodesic whose end comes nearest to the pose, without limits and collision avoidance.
        limits: keep the joints within their position limits.
        speed_limits: meet the limits of the joints on speed, acceleration, jerk and torque, by the
            choice of the configurations and by taking more time than the person.
        torque_share: fraction of the torque limits that the motion may use; the rest serves a
            controller against errors of the model. A joint that takes more to hold the arm in some
            of the motion may take 1.5 times the most of that, up to its limit, and a note says so.
        rest: begin and end at rest; otherwise at the person's speed.
        rotor_inertia: add known or default inertia of the motors where the robot's file states no
            joint inertia.
        stretch_weight: weight of time beyond the person's, relative to the recording's duration.
        deviation_weight: weight of the trajectory's distance from the paths against time; larger
            values round the corners between synergies less.
        pose_tolerance: distance and angle by which the hand may miss a pose where that saves a
            detour, 10 mm and 5 degrees by default: numbers [m, rad], or texts with a unit such as
            "10mm" (m, cm, mm) and "5deg" (rad, deg). A rest in which the person's hand drifts
            farther becomes a movement. A pose that is missed by more, as it may be out of reach,
            makes the result no success.
        exact: attain every pose that is within reach; as a pose tolerance of zero.
        path_tolerance: distance and angle between the robot's hand and the person's that cost
            little between the poses, 30 mm and 5.7 degrees by default, given likewise; what is
            beyond costs in proportion. Larger values save energy and time; inf leaves the hand free
            between the poses.
        posture_weight: weight of the joints' mean squared distance from the middle of their ranges
            at the ends of the synergies, in half ranges.
        likeness_weight: weight of the mean squared difference between the elbow's offset from the
            line between shoulder and wrist and the person's offset, in lengths of the arm; of a
            body also of the squared angle [rad] between the turns of waist and thorax.
        position_weight: weight of the position error of poses that are not reached [1/m]; 0 leaves
            the hand's position free.
        orientation_weight: weight of the orientation error of poses that are not reached [1/rad]; 0
            leaves the hand's orientation free.
        scale: factor of positions, such as 1 to leave them as they are; default: the ratio of the
            arms' lengths; fit: the largest up to that for which most poses are within reach.
        mirror: exchange left and right; default: if the arms' sides differ.
        drop: length below which a synergy is dropped, in the person's metric; default:
            a fraction of the longest synergy.
        merge: length below which a synergy is merged with its neighbour, likewise.
        self_collision: keep the links of a robot apart, and two arms whose bases are known to be at
            one place, where their geometry is known.
        obstacles: bodies that the links are kept clear of, in the robot's base frame; see `Reach`.
        links: names of the links that are kept clear of obstacles; see `Reach`.
        pairs: pairs of links kept apart, in place of the pairs found for `self_collision`; see
            `execution.link_pairs`.
        margin: smallest distance allowed between links [m]; of links that never come twice as far
            apart, half of the largest distance that they can have. Paths keep it; a note names
            links that come nearer where the trajectory rounds their corners.
        obstacle_margin: smallest distance allowed to obstacles [m]; default: that between links.
        num_starts: number of geodesics sought for each synergy in the formulation "geodesic", of
            which the geodesic of least energy is taken.
        energy_weight: weight of the energy in the formulation "geodesic".

    Raises:
        ValueError: a value of the wrong type or out of range; the message names the field.

    >>> import geodesic_ocp as go
    >>> settings = go.retargeting.RetargetingSettings(rest=False, orientation_weight=0.0)
    >>> settings.rest, settings.limits, settings.formulation
    (False, True, 'constrained')
    """

    formulation: Formulation = "constrained"
    limits: bool = True
    speed_limits: bool = True
    torque_share: float = 0.9
    rest: bool = True
    rotor_inertia: bool = True
    stretch_weight: float = 5.0
    deviation_weight: float = 1.0
    pose_tolerance: Tolerance = (0.01, 0.087)
    exact: bool = False
    path_tolerance: Tolerance = (0.03, 0.1)
    posture_weight: float = 0.0
    likeness_weight: float = 30.0
    position_weight: float = 1.0
    orientation_weight: float = 1.0
    scale: float | Literal["fit"] | None = None
    mirror: bool | None = None
    drop: float | None = None
    merge: float | None = None
    self_collision: bool = True
    obstacles: Sequence[Obstacle] = ()
    links: Sequence[str] | None = None
    pairs: Sequence[tuple[str, str]] = ()
    margin: float = 0.01
    obstacle_margin: float | None = None
    num_starts: int = 1
    energy_weight: float = ENERGY_WEIGHT

    def __post_init__(self) -> None:
        formulations = get_args(Formulation)
        if self.formulation not in formulations:
            raise ValueError(
                f"formulation must be one of {', '.join(formulations)}, got {self.formulation!r}"
            )
        as_integer("num_starts", self.num_starts, 1)
        if self.mirror not in (None, True, False):
            raise ValueError(f"mirror must be True, False or None, got {self.mirror!r}")
        weights = ("position_weight", "orientation_weight", "posture_weight", "likeness_weight")
        for name in (*weights, "margin", "obstacle_margin"):
            value = getattr(self, name)
            if value is not None and as_number(name, value) < 0.0:
                raise ValueError(f"{name} must be zero or above, got {value:g}")
        pose, path = (
            _distance_and_angle(name, getattr(self, name))
            for name in ("pose_tolerance", "path_tolerance")
        )
        settle(self, pose_tolerance=pose)
        settle(self, path_tolerance=path)
        for value, unit in zip(path, ("m", "rad"), strict=True):
            if value != np.inf:
                as_positive("path_tolerance", value, unit)
        for value, unit in zip(pose, ("m", "rad"), strict=True):
            as_not_negative("pose_tolerance", value, unit)
        if pose[1] > np.pi:
            raise ValueError(f"pose_tolerance: the angle is in rad, at most pi, got {pose[1]:g}")
        if self.position_weight == self.orientation_weight == 0.0:
            raise ValueError("position_weight and orientation_weight must be not both zero")
        for name in ("energy_weight", "stretch_weight", "deviation_weight"):
            as_positive(name, getattr(self, name))
        if not 0.0 < as_number("torque_share", self.torque_share) <= 1.0:
            raise ValueError(f"torque_share must be above 0 and at most 1, got {self.torque_share}")
        if isinstance(self.scale, str) and self.scale != "fit":
            raise ValueError(f"scale must be a number, 'fit' or None, got {self.scale!r}")
        if self.scale is not None and self.scale != "fit":
            as_positive("scale", self.scale)
        collisions = self.collisions
        if not self.constrained and not collisions.is_empty:
            raise ValueError(
                "the formulation 'geodesic' does not avoid collisions; use 'constrained'"
            )

    @property
    def constrained(self) -> bool:
        """True if paths are constrained."""
        return self.formulation == "constrained"

    @property
    def allowed_miss(self) -> tuple[float, float]:
        """Distance [m] and angle [rad] by which poses may be missed."""
        return (0.0, 0.0) if self.exact else cast(tuple[float, float], self.pose_tolerance)

    @property
    def collisions(self) -> CollisionAvoidance:
        """The collision bodies that are kept apart, all by the largest of their margins."""
        margin = max([each.margin for each in self.each_apart if not each.is_empty], default=0.0)
        return CollisionAvoidance.checked(self.obstacles, self.links, self.pairs, margin)

    @property
    def each_apart(self) -> tuple[CollisionAvoidance, CollisionAvoidance]:
        """The obstacles and the pairs of links, each with its margin."""
        far = self.margin if self.obstacle_margin is None else self.obstacle_margin
        return (
            CollisionAvoidance.checked(self.obstacles, self.links, (), far),
            CollisionAvoidance.checked((), None, self.pairs, self.margin),
        )

    @property
    def within_limits(self) -> bool:
        """True if paths stay within the joints' limits."""
        return self.limits and self.constrained

    @property
    def pose_weights(self) -> tuple[float, float]:
        """Weights of position and orientation; one for those left free, which do not count."""
        return self.position_weight or 1.0, self.orientation_weight or 1.0


def _distance_and_angle(name: str, given: Tolerance) -> tuple[float, float]:
    """Return a distance [m] and an angle [rad] from numbers, or texts such as "10mm" and "5deg"."""
    try:
        distance, angle = (
            float(text.removesuffix(unit)) * units.get(unit, 1.0)
            for value, units in zip(given, _UNITS, strict=True)
            for text in [str(value)]
            for unit in [next(filter(text.endswith, units), "")]
        )
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} must be a distance [m] and an angle [rad], or with units such as 10mm 5deg, "
            f"got {given!r}"
        ) from None
    return distance, angle


BEYOND = 2e-3  # [m] that paths keep beyond the margin, as the trajectory leaves them in corners
_MANY = 256  # configurations, in one of which a link must not overlap an obstacle
_LESS = BEYOND  # [m] by which it may come nearer than the capsules on a path
_BETWEEN = 1e-4  # [m] by which it may be, between the instants at which paths are checked


def motion_clearance(robots: Sequence[Model], settings: RetargetingSettings) -> Clearance | None:
    """Return the distances that the settings ask for; None if there are none, or no geometry is
    known.

    Pairs of links whose capsules overlap although the links are apart are among them, as the exact
    geometry decides (`active_rows`).

    Raises:
        ValueError: links or pairs without collision bodies, or an obstacle that a link
            overlaps in any configuration.
    """
    if not settings.constrained:
        return None
    found = list[Clearance]()
    q = ca.SX.sym("q", sum(robot.dof for robot in robots))
    if settings.self_collision and not settings.pairs:
        found += filter(None, [_links_apart(tuple(robots), settings.margin)])
    first = 0
    for robot in robots:
        own = q[first : first + robot.dof]
        for obstacles, links, pairs, margin in settings.each_apart:
            distances = signed_distances(robot, own, obstacles, links=links, pairs=pairs)
            if distances:
                function = ca.Function("distances", [q], [ca.vertcat(*distances.values())])
                if obstacles:
                    _check_obstacles(function, robots, tuple(distances))
                found.append(Clearance(function, np.full(len(distances), margin), tuple(distances)))
        first += robot.dof
    return joined_clearance(found, q.numel()) if found else None


def _check_obstacles(distances: ca.Function, robots: Sequence[Model], names: Sequence[str]) -> None:
    """Raise a ValueError if a link and an obstacle overlap in all of many configurations."""
    largest = distances(sampled_configurations(robots, _MANY).T).full().max(axis=1)
    if always := [name for name, most in zip(names, largest, strict=True) if most < 0.0]:
        raise ValueError(
            f"obstacles: overlap in each of {_MANY} configurations: {', '.join(always)}; give them "
            "in the frame of the robot's base, and the links to be kept clear (--links)"
        )


@lru_cache(maxsize=8)
def _links_apart(robots: tuple[Model, ...], margin: float) -> Clearance | None:
    pairs = link_pairs(robots, margin=margin)
    both = (*pairs.constrained, *pairs.exact_only)  # without excess: the exact distances decide
    kept = replace(pairs, constrained=both, excess=(0.0,) * len(both))
    return keep_clear(robots, pairs=kept, margin=margin)


def of_trajectory(clearance: Clearance, least: Array, kept: Sequence[int]) -> Clearance:
    """Return the clearance with the bounds that a trajectory keeps near paths.

    Distances of capsules that are below their bounds along the paths, although those of the links
    are not, have none: they would only hold the trajectory to the paths.

    Args:
        clearance: all distances.
        least: along the paths (m,) [m].
        kept: numbers of those that the paths were kept from.
    """
    bound = np.minimum(clearance.lower, least - _BETWEEN)
    bound[least < clearance.lower] = -np.inf
    some = list(kept)
    bound[some] = np.minimum(clearance.lower[some], least[some] - _LESS)
    return replace(clearance, lower=bound)
