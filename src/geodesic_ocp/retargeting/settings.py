"""How synergies are retargeted, and the distances that the motion keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, as_integer, as_number, as_positive
from geodesic_ocp.execution.clearance import Clearance, clearance_constraint
from geodesic_ocp.execution.link_pairs import LinkPairs, link_pairs
from geodesic_ocp.logarithm.geodesic_to_pose import ENERGY_WEIGHT
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.pose_search import CollisionAvoidance

Formulation = Literal["constrained", "geodesic"]


@dataclass(frozen=True, repr=False)
class RetargetingSettings(ShortRepr):
    """Settings of `retarget`.

    Attributes:
        formulation: "constrained", all synergies as one program: paths of least energy between
            configurations in which the hand has exactly the target poses, subject to the
            constraints below; a pose out of reach is replaced by the nearest one. Or "geodesic",
            one synergy after the other, each the free geodesic whose end comes nearest to the pose
            (`geodesic_to_pose`), without limits and collision avoidance.
        limits: whether the joints stay within their limits.
        speed_limits: whether the limits of the joints on speed, acceleration, jerk and torque are
            met: by the choice of the configurations, and by taking more time than the person.
        torque_share: of the torque limits that the motion may use. What is left serves a controller
            against errors of the model.
        rest: whether the motion begins and ends at rest; otherwise at the person's speed, which a
            robot cannot do if the recording begins or ends in motion.
        rotor_inertia: whether a robot whose file states no joint inertia gets the known one of its
            motors, or a default (`robot_armature`).
        stretch_weight: of time beyond the person's, relative to the recording's duration, in units
            of the least action.
        deviation_weight: of the trajectory's distance from the paths against time, see
            `plan_trajectory`; larger values round the corners between synergies less.
        near_misses: errors of the hand's position [m] and orientation [rad] up to which a pose
            within reach may be missed if attaining it takes a detour; 0: such poses are attained.
        posture_weight: of the mean squared distance of the joints from the middle of their ranges
            at the ends of the synergies, in half ranges, in the same unit.
        likeness_weight: of the mean squared distance of the elbow's offset from the line between
            shoulder and wrist from that of the person, in lengths of the arm, in the same unit.
        position_weight, orientation_weight: of the pose error [1/m], [1/rad], for poses that are
            not reached; zero leaves the position or the orientation free altogether.
        scale: factor of positions; None: the ratio of the arms' lengths.
        mirror: whether left and right are exchanged; None: if the arms' sides differ.
        drop, merge: lengths below which synergies are dropped or merged (`merge_synergies`), in the
            person's metric; None: fractions of the longest synergy.
        self_collision: whether the links of a robot, and two arms whose bases are known to be at
            one place, are kept apart where their geometry is known.
        obstacles, links: obstacles, and the links that are kept clear of them, in the robot's base
            frame; see `Reach`.
        pairs: pairs of links kept apart, in place of those found for `self_collision`; see
            `collision_pairs`.
        margin: smallest distance allowed between any of them [m].
        num_starts, energy_weight: in the formulation "geodesic": number of geodesics sought for
            each synergy, from different initial velocities, of which that of least energy is taken;
            and weight of the energy.

    Raises:
        ValueError: a value of the wrong type or out of range; the message names the field.

    >>> import geodesic_ocp as go
    >>> settings = go.RetargetingSettings(rest=False, orientation_weight=0.0)
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
    deviation_weight: float = 3.0
    near_misses: float = 0.0
    posture_weight: float = 0.0
    likeness_weight: float = 30.0
    position_weight: float = 1.0
    orientation_weight: float = 1.0
    scale: float | None = None
    mirror: bool | None = None
    drop: float | None = None
    merge: float | None = None
    self_collision: bool = True
    obstacles: Sequence[Obstacle] = ()
    links: Sequence[str] | None = None
    pairs: Sequence[tuple[str, str]] = ()
    margin: float = 0.01
    num_starts: int = 1
    energy_weight: float = ENERGY_WEIGHT

    def __post_init__(self) -> None:
        if self.formulation not in get_args(Formulation):
            raise ValueError(
                f"formulation must be one of {', '.join(get_args(Formulation))}, got "
                f"{self.formulation!r}"
            )
        as_integer("num_starts", self.num_starts, 1)
        if self.mirror not in (None, True, False):
            raise ValueError(f"mirror must be True, False or None, got {self.mirror!r}")
        weights = [
            as_number(name, getattr(self, name))
            for name in ("position_weight", "orientation_weight")
        ]
        if min(weights) < 0.0 or max(weights) == 0.0:
            raise ValueError(
                "position_weight and orientation_weight must be zero or above, and not both zero, "
                f"got {weights[0]:g} and {weights[1]:g}"
            )
        as_positive("energy_weight", self.energy_weight)
        for name in ("stretch_weight", "deviation_weight"):
            as_positive(name, getattr(self, name))
        if not 0.0 < as_number("torque_share", self.torque_share) <= 1.0:
            raise ValueError(f"torque_share must be above 0 and at most 1, got {self.torque_share}")
        for name in ("posture_weight", "likeness_weight", "near_misses"):
            if as_number(name, getattr(self, name)) < 0.0:
                raise ValueError(f"{name} must be zero or above, got {getattr(self, name):g}")
        if self.scale is not None:
            as_positive("scale", self.scale)
        collisions = self.collisions
        if not self.constrained and not collisions.is_empty:
            raise ValueError(
                "the formulation 'geodesic' does not avoid collisions; use 'constrained'"
            )

    @property
    def constrained(self) -> bool:
        """Whether paths are constrained."""
        return self.formulation == "constrained"

    @property
    def collisions(self) -> CollisionAvoidance:
        """The collision bodies that are kept apart."""
        return CollisionAvoidance.checked(self.obstacles, self.links, self.pairs, self.margin)

    @property
    def within_limits(self) -> bool:
        """Whether paths stay within the joints' limits."""
        return self.limits and self.constrained

    @property
    def pose_weights(self) -> tuple[float, float]:
        """Weights of position and orientation; one for those left free, which do not count."""
        return self.position_weight or 1.0, self.orientation_weight or 1.0


TOUCHING = 1e-3  # [m]
_CLOSE = 2e-3  # [m], smallest distance of links whose capsules overlap in most configurations
_MORE = 2e-3  # [m] that paths keep beyond the margin, as the trajectory leaves them in corners
_LESS = 3e-3  # [m] by which it may come nearer than the capsules on a path


def motion_clearance(robots: Sequence[Model], settings: RetargetingSettings) -> Clearance | None:
    """The distances that the settings ask for; None if there are none, or no geometry is known.

    Pairs of links whose capsules overlap although the links are apart are among them, as the exact
    geometry decides (`active_rows`). Most of these are neighbours that are always near each other:
    they must not touch.

    Raises:
        ValueError: links or pairs without collision bodies.
    """
    if not settings.constrained:
        return None
    found: list[Clearance] = []
    if settings.self_collision and not settings.pairs:
        pairs_found = _pairs(tuple(robots), settings.margin)
        named = [*pairs_found.constrained, *pairs_found.exact_only]
        every = clearance_constraint(robots, pairs=named, margin=settings.margin) if named else None
        close = {f"{one} to {other}" for one, other in pairs_found.exact_only}
        if every is not None:
            wide = [name.partition(" (")[0] in close for name in every.names]
            found.append(replace(every, lower=np.where(wide, _CLOSE, every.lower)))
    obstacles, links, pairs, margin = settings.collisions
    if obstacles or pairs:
        total, first = sum(robot.dof for robot in robots), 0
        q = ca.SX.sym("q", total)
        for robot in robots:
            own = q[first : first + robot.dof]
            distances = signed_distances(robot, own, obstacles, links=links, pairs=pairs)
            function = ca.Function("distances", [q], [ca.vertcat(*distances.values())])
            found.append(Clearance(function, np.full(len(distances), margin), tuple(distances)))
            first += robot.dof
    return _together(found) if found else None


@lru_cache(maxsize=8)
def _pairs(robots: tuple[Model, ...], margin: float) -> LinkPairs:
    return link_pairs(robots, margin=margin)


def of_paths(clearance: Clearance) -> Clearance:
    """With the bounds that paths keep."""
    return replace(clearance, lower=np.asarray(clearance.lower) + _MORE)


def of_trajectory(clearance: Clearance, least: Array, kept: Sequence[int]) -> Clearance:
    """With the bounds that a trajectory keeps near paths.

    Distances of capsules that are below their bounds along the paths, although those of the links
    are not, have none: they would only hold the trajectory to the paths.

    Args:
        clearance: all distances.
        least: along the paths (m,) [m].
        kept: numbers of those that the paths were kept from.
    """
    bound = np.where(least < clearance.lower, -np.inf, clearance.lower)
    some = list(kept)
    bound[some] = np.minimum(clearance.lower[some], least[some] - _LESS)
    return replace(clearance, lower=bound)


def in_check(clearance: Clearance) -> Clearance:
    """With the bounds that a check of the trajectory asks for: links must not touch."""
    return replace(clearance, lower=np.full(len(clearance.names), TOUCHING))


def _together(parts: Sequence[Clearance]) -> Clearance:
    if len(parts) == 1:
        return parts[0]
    q = ca.SX.sym("q", parts[0].dof)
    function = ca.Function("distances", [q], [ca.vertcat(*(each.function(q) for each in parts))])
    lower = np.concatenate([each.lower for each in parts])
    owners = [(part, index) for part in parts for index in range(len(part.names))]

    def exact(configuration: Array, row: int) -> float:
        part, index = owners[row]
        if part.exact is not None:
            return part.exact(configuration, index)
        return max(0.0, float(part.row(index)(configuration)))

    return Clearance(function, lower, tuple(name for each in parts for name in each.names), exact)
