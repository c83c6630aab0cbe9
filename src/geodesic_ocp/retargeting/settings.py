"""How synergies are retargeted: everything that has a sensible default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from geodesic_ocp.arrays import as_integer, as_number, as_positive, short_repr
from geodesic_ocp.logarithm.to_pose.geodesic_to_pose import ENERGY_WEIGHT
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.ik.collision_avoidance import CollisionAvoidance

Formulation = Literal["constrained", "geodesic"]


@dataclass(frozen=True, repr=False)
class RetargetingSettings:
    """Settings of `retarget`.

    Attributes:
        formulation: "constrained", the path of least energy to any configuration in which the hand
            has exactly the target pose (`Reach`), subject to the constraints below; a pose out of
            reach is replaced by the nearest one. Or "geodesic", the free geodesic whose end comes
            nearest to the pose (`geodesic_to_pose`), without limits and collision avoidance.
        limits: whether the joints stay within their limits.
        speed_limits: whether the joints' speed limits are met, by other paths if there are any, and
            by scaling time.
        rest: whether the motion begins and ends at rest; by default at the person's speed, which a
            robot cannot do if the recording begins or ends in motion.
        num_starts: number of solutions sought for each synergy, from different configurations of
            inverse kinematics; the one of least energy is taken. After a failure the next
            configuration is tried in any case.
        position_weight, orientation_weight: of the pose error [1/m], [1/rad], for poses that are
            not reached; zero leaves the position or the orientation free altogether.
        energy_weight: of the energy, in the formulation "geodesic".
        scale: factor of positions; None: the ratio of the arms' lengths.
        mirror: whether left and right are exchanged; None: if the arms' sides differ.
        drop, merge: lengths below which synergies are dropped or merged (`merge_synergies`), in the
            person's metric; None: fractions of the longest synergy.
        obstacles, links, pairs, margin: collision bodies kept apart, in the robot's base frame; see
            `Reach` and `collision_pairs`.

    Raises:
        ValueError: a value of the wrong type or out of range; the message names the field.

    >>> import geodesic_ocp as go
    >>> settings = go.RetargetingSettings(rest=True, orientation_weight=0.0)
    >>> settings.rest, settings.limits, settings.formulation
    (True, True, 'constrained')
    """

    formulation: Formulation = "constrained"
    limits: bool = True
    speed_limits: bool = True
    rest: bool = False
    num_starts: int = 1
    position_weight: float = 1.0
    orientation_weight: float = 1.0
    energy_weight: float = ENERGY_WEIGHT
    scale: float | None = None
    mirror: bool | None = None
    drop: float | None = None
    merge: float | None = None
    obstacles: Sequence[Obstacle] = ()
    links: Sequence[str] | None = None
    pairs: Sequence[tuple[str, str]] = ()
    margin: float = 0.0

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
        if self.scale is not None:
            as_positive("scale", self.scale)
        collisions = self.collisions
        if not self.constrained and not collisions.is_empty:
            raise ValueError(
                "the formulation 'geodesic' does not avoid collisions; use 'constrained'"
            )

    def __repr__(self) -> str:
        return short_repr(self)

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
    def within_speed_limits(self) -> bool:
        """Whether paths stay within the joints' speed limits, if possible."""
        return self.speed_limits and self.constrained

    @property
    def pose_weights(self) -> tuple[float, float]:
        """Weights of position and orientation; one for those left free, which do not count."""
        return self.position_weight or 1.0, self.orientation_weight or 1.0
