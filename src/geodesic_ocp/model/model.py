"""Model: a Pinocchio model with a hand (end-effector) frame, as CasADi functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import (
    Array,
    as_number,
    as_positive,
    as_vector,
    is_symbolic,
    real_array,
    settle,
)
from geodesic_ocp.model.doubts import doubts_of
from geodesic_ocp.model.dynamics import SymbolicFunctions, choose_backend
from geodesic_ocp.model.joints import (
    continuous_joints,
    frame_index,
    joint_values,
    max_reach,
    motion_subspace,
    with_angles,
    with_joint_frames,
)
from geodesic_ocp.model.primitives import Ball, Bodies, Body, Capsule
from geodesic_ocp.tables import markdown, new_table

ROUNDING = 1e-9  # of moments of inertia in files, relative to the largest one


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A mechanical system of joints with one degree of freedom, and hand (end-effector) frames.

    Attributes:
        pin: the Pinocchio model, of which a private copy is kept.
        hand: name of the hand frame in `pin`.
        backend: "built-in" or "pinocchio.casadi"; None: $GEODESIC_OCP_BACKEND, or "built-in".
        continuous: names of the joints that are periodic: configurations one revolution apart are
            the same. Continuous joints of `pin` are added, with limits of +-2 pi rad.
        shapes: capsules and spheres fixed to its frames, or a function that reads them when needed.
        hands: names of all hand frames, with `hand`, such as both of a person; `hand` by default.
        armature_from: where the armature was read, such as "the file"; "" if it was given.

    Configurations are 1-d arrays [rad or m] in the order of `joint_names`. Two models are equal
    only if they are the same object.

    Raises:
        ValueError: not one degree of freedom in a joint, a negative armature, or no such frame.
    """

    pin: pin.Model
    hand: str
    backend: str | None = None
    continuous: tuple[str, ...] = ()
    shapes: Bodies = ()
    hands: tuple[str, ...] = ()
    armature_from: str = ""
    _hand_id: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        settle(self, hands=_as_hands(self.pin, self.hand, self.hands))
        for index in range(1, self.pin.njoints):
            motion_subspace(self.pin, index)
        joints = list(map(str, self.pin.names))[1:]
        for joint, inertia in zip(joints, self.pin.armature, strict=True):
            if not 0.0 <= inertia < np.inf:
                wanted = "must be finite and not negative"
                raise ValueError(f"armature of joint {joint!r} {wanted}, got {inertia:g}")
        for name in set(self.continuous).difference(joints):
            raise ValueError(f"continuous: {name!r} is not a joint of the model")
        periodic = {*self.continuous, *continuous_joints(self.pin)}
        continuous = tuple(name for name in joints if name in periodic)
        settle(self, pin=with_joint_frames(with_angles(self.pin)))
        settle(self, backend=choose_backend(self.backend))
        settle(self, _hand_id=frame_index(self.pin, self.hand))
        settle(self, continuous=continuous)

    def __repr__(self) -> str:
        what = f"{self.name!r}, dof={self.dof}, hand={self.hand!r}, backend={self.backend!r}"
        if inertia := self.describe_armature():
            source = self.armature_from and f" from {self.armature_from}"
            what += f", {inertia}{source}"
        if self.doubts:
            what += f", doubts: {'; '.join(self.doubts)}"
        return f"Model({what})"

    def _repr_markdown_(self) -> str:
        values = self.lower.tolist(), self.upper.tolist(), self.armature.tolist()
        rows = tuple(zip(self.joint_names, self.units, *values, strict=True))
        table = markdown(
            new_table(("joint", "unit", "lower limit", "upper limit", "armature"), rows)
        )
        hands = "`, `".join(self.hands)
        doubts = "".join(f"\n- {doubt}" for doubt in self.doubts)
        doubtful = f"\n\ndoubts:\n{doubts}" if doubts else ""
        return f"**{self.name}**: hand `{hands}`, mass {self.mass:.3g} kg\n\n{table}{doubtful}"

    @property
    def name(self) -> str:
        """Name of the Pinocchio model."""
        return str(self.pin.name)

    @property
    def dof(self) -> int:
        """Number n of degrees of freedom."""
        return int(self.pin.nv)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the configuration."""
        return tuple(self.pin.names)[1:]

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each coordinate, "rad" or "m"."""
        twists = (motion_subspace(self.pin, index) for index in range(1, self.pin.njoints))
        return tuple("rad" if np.any(twist[3:]) else "m" for twist in twists)

    @cached_property
    def lower(self) -> Array:
        """Lower joint limits (n,) [rad or m]; -inf if unlimited."""
        return self._per_joint(self.pin.lowerPositionLimit)

    @cached_property
    def upper(self) -> Array:
        """Upper joint limits (n,) [rad or m]; inf if unlimited."""
        return self._per_joint(self.pin.upperPositionLimit)

    def _per_joint(self, values: Array) -> Array:
        """Return a copy that cannot be written to; the largest floats stand for infinity."""
        huge = np.abs(values) >= np.finfo(float).max
        copy = np.where(huge, np.copysign(np.inf, values), values)
        copy.flags.writeable = False
        return copy

    @cached_property
    def armature(self) -> Array:
        """Joint inertia (n,) on the diagonal of G [kg m^2, kg for prismatic joints], read-only.

        Pinocchio's `Model.armature`; of a geared motor it is the inertia of the rotor times the
        square of the gear ratio.
        """
        return self._per_joint(self.pin.armature)

    def describe_armature(self) -> str:
        """Return the range of the joint inertia in words; "" if there is none."""
        if not self.armature.any():
            return ""
        low = self.armature.min()
        high = self.armature.max()
        shown = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
        units = {"kg m^2" if unit == "rad" else "kg" for unit in self.units}
        return f"joint inertia {shown} {' and '.join(sorted(units))}"

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What can hardly be right in inertias and limits, a sentence each (`model.doubts`)."""
        return doubts_of(self.pin)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Collision bodies: capsules and spheres around the links, from a file or a table.

        Raises:
            ValueError: the collision geometry of the file cannot be read; names the link.
        """
        return self.shapes() if callable(self.shapes) else tuple(self.shapes)

    @cached_property
    def mass(self) -> float:
        """Total moving mass [kg]."""
        return float(sum(inertia.mass for inertia in list(self.pin.inertias)[1:]))

    @cached_property
    def reach(self) -> float:
        """Largest distance [m] of the hand from its first joint, within the joint limits.

        Found by local optimization from several configurations, so strictly a lower bound.
        """
        return max_reach(self.pin, self._hand_id, self.lower, self.upper)

    @cached_property
    def _functions(self) -> SymbolicFunctions:
        return SymbolicFunctions(self.pin, str(self.backend))

    def mass_matrix(self, q: Any) -> Any:
        """Get mass-inertia matrix G(q), (n, n) [kg m^2 for revolute, kg for prismatic joints].

        Of k configurations (k, n): (k, n, n).
        """
        return self._functions.value("mass_matrix", q=q)

    def kinetic_energy(self, q: Any, v: Any) -> Any:
        """Return kinetic energy v' G(q) v / 2 [J] at the joint velocities v (n,) [rad/s or m/s]."""
        energy = self._functions.value("kinetic_energy", q=q, v=v)
        return energy if is_symbolic(q, v) else float(energy[0, 0])

    def coriolis_force(self, q: Any, v: Any) -> Any:
        """Return Coriolis and centrifugal forces C(q, v) v, (n,) [N m or N], gravity excluded."""
        force = self._functions.value("coriolis_force", q=q, v=v)
        return force if is_symbolic(q, v) else force[:, 0]

    def inverse_dynamics(self, q: Any, v: Any, a: Any, gravity: Any = (0.0, 0.0, -9.81)) -> Any:
        """Return joint forces G(q) a + C(q, v) v + g(q), (n,) [N m or N], at joint accelerations a
        (n,).

        For k states (k, n): (k, n). `gravity`: of free fall, in axes of the base (3,) [m/s^2].
        """
        force = self._functions.value("inverse_dynamics", q=q, v=v, a=a, gravity=gravity)
        return force if is_symbolic(q, v, a, gravity) else force[..., 0]

    def hand_pose(self, q: Any) -> Any:
        """Return rotation (3, 3) and position (3,) [m] of the hand frame in the base frame.

        For k configurations (k, n): rotations (k, 3, 3) and positions (k, 3).
        """
        return self._pose(self._hand_id, q)

    def frame_pose(self, frame: str, q: Any) -> Any:
        """Return pose of any frame of `pin`, in the form of `hand_pose`.

        Raises:
            ValueError: there is no such frame.
        """
        return self._pose(frame_index(self.pin, frame), q)

    def _pose(self, frame: int, q: Any) -> Any:
        rotation, position = self._functions.value("frame_pose", frame, q=q)
        return rotation, position if is_symbolic(q) else position[..., 0]

    def stacked_poses(self, frames: Sequence[str], q: Any) -> Any:
        """Return stacked poses of h frames, of the hand if none are given: rotations (3 h, 3) and
        positions (3 h,) [m].

        For k configurations (k, n): rotations (k, 3 h, 3) and positions (k, 3 h).
        """
        rotations, positions = zip(
            *(self.frame_pose(frame, q) for frame in frames or (self.hand,)), strict=True
        )
        if is_symbolic(q):
            return ca.vertcat(*rotations), ca.vertcat(*positions)
        return np.concatenate(rotations, axis=-2), np.concatenate(positions, axis=-1)

    def stacked_jacobians(self, frames: Sequence[str], q: Any) -> Any:
        """Return stacked Jacobians of h frames (6 h, n), see `hand_jacobian`."""
        indices = [frame_index(self.pin, frame) for frame in frames]
        found = [self._functions.value("jacobian", index, q=q) for index in indices]
        return ca.vertcat(*found) if is_symbolic(q) else np.concatenate(found, axis=-2)

    @cached_property
    def shared_joints(self) -> tuple[str, ...]:
        """Names of the joints that move all hands, of a waist; none for a single hand."""
        chains = [list(self.pin.supports[self.joint_of(hand)])[1:] for hand in self.hands]
        shared = set(chains[0]).intersection(*chains[1:]) if len(chains) > 1 else set()
        return tuple(str(self.pin.names[index]) for index in chains[0] if index in shared)

    def moves(self, frame: str) -> bool:
        """Return whether any of the joints moves the frame.

        Raises:
            ValueError: there is no such frame.
        """
        return self.joint_of(frame) > 0

    def joint_of(self, frame: str) -> int:
        """Return index in `pin` of the joint that carries a frame; 0 for a fixed frame.

        Raises:
            ValueError: there is no such frame.
        """
        return int(self.pin.frames[frame_index(self.pin, frame)].parentJoint)

    def hand_jacobian(self, q: Any) -> Any:
        """Return Jacobian (6, n) of the hand: linear [m], then angular velocity, in base frame
        axes.
        """
        return self._functions.value("jacobian", self._hand_id, q=q)

    def potential_energy(self, q: Any) -> Any:
        """Return gravitational potential energy V(q) [J], zero at the height of the base."""
        energy = self._functions.value("potential_energy", q=q)
        return energy if is_symbolic(q) else float(energy[0, 0])

    def with_payload(
        self, mass: float, position: ArrayLike = (0.0, 0.0, 0.0), inertia: ArrayLike | None = None
    ) -> Model:
        """Return the model with an object rigidly attached to the hand.

        Args:
            mass: mass of the object [kg].
            position: its centre of mass in the hand frame, (3,) [m].
            inertia: its inertia about the centre of mass, in the axes of the hand frame, (3, 3)
                [kg m^2]; None: a point mass.

        Raises:
            ValueError: mass is not positive, the inertia is not symmetric or has a negative
                principal moment, or the hand does not move.
        """
        mass = as_positive("mass", mass, "kg")
        body = _body_inertia(mass, as_vector("position", position, 3), inertia)
        loaded = self.pin.copy()
        hand = loaded.frames[self._hand_id]
        if hand.parentJoint == 0:
            raise ValueError(f"the hand {self.hand!r} does not move: a payload has no effect there")
        loaded.appendBodyToJoint(hand.parentJoint, body, hand.placement)
        loaded.name = f"{self.name} with {mass:g} kg"
        return replace(self, pin=loaded)

    def with_armature(self, value: ArrayLike | Mapping[str, float]) -> Model:
        """Return the model with another joint inertia a, so that its mass matrix is G(q) + diag(a).

        It replaces the joint inertia that the model has; G(q) is that of the bodies alone.

        >>> go.human_arm("right").with_armature({"RWx_joint": 0.05, "RWy_joint": 0.05}).armature
        array([0.  , 0.  , 0.  , 0.  , 0.  , 0.05, 0.05])

        Args:
            value: one number for all joints, n numbers, or some by joint name, where the others
                keep theirs [kg m^2, kg for prismatic joints].

        Raises:
            ValueError: an unknown joint, not 1 or n numbers, or one that is negative or not finite.
        """
        entries = np.array([*value.values()] if isinstance(value, Mapping) else value, dtype=object)
        if any(isinstance(entry, (bool, np.bool_)) for entry in entries.flat):
            raise ValueError(f"armature must be numbers, not truth values, got {value!r}")
        if isinstance(value, str) or not isinstance(value, (Mapping, Sequence, np.ndarray)):
            value = [as_number("armature", value)] * self.dof
        geared = self.pin.copy()
        geared.armature = joint_values("armature", value, self.armature, self.joint_names)
        return replace(self, pin=geared, armature_from="")

    def with_limits(
        self,
        lower: ArrayLike | Mapping[str, float] | None = None,
        upper: ArrayLike | Mapping[str, float] | None = None,
    ) -> Model:
        """Return the model with other joint limits [rad or m]: n numbers, or some by joint name.

        Raises:
            ValueError: wrong shapes or names, not numbers, or a lower limit above the upper one.
        """
        lower = joint_values("lower", lower, self.lower, self.joint_names)
        upper = joint_values("upper", upper, self.upper, self.joint_names)
        for joint, low, high in zip(self.joint_names, lower, upper, strict=True):
            if low > high or low == np.inf or high == -np.inf:  # the range is empty
                raise ValueError(f"{joint}: the lower limit {low:g} lies above the upper {high:g}")
        limited = self.pin.copy()
        limited.lowerPositionLimit = lower
        limited.upperPositionLimit = upper
        return replace(self, pin=limited)

    def with_hand(self, hand: str, *others: str) -> Model:
        """Return the model with this hand frame, and others; one of its `hands` alone keeps the
        others.

        Raises:
            ValueError: there is no such frame, or it is given twice.
        """
        hands = self.hands if hand in self.hands and not others else (hand, *others)
        if (hand, hands) == (self.hand, self.hands):
            return self
        return replace(self, hand=hand, hands=hands)

    def with_bodies(self, *bodies: Body) -> Model:
        """Return the model with these capsules and spheres, each with a link, as collision bodies.

        Raises:
            ValueError: a body has no link, or its link is not a frame of the model.
        """
        for body in bodies:
            if not isinstance(body, (Capsule, Ball)) or body.link is None:
                raise ValueError(f"bodies must be Capsule or Ball with a link, got {body!r}")
            frame_index(self.pin, body.link)
        return replace(self, shapes=bodies)


def as_model(model: Any) -> Model:
    """Return the argument, if it is a model; ValueError otherwise."""
    if not isinstance(model, Model):
        hint = "; use its attribute model" if hasattr(model, "model") else ""
        raise ValueError(f"model must be a Model, got {model!r}{hint}")
    return model


def hand_labels(hands: Sequence[str]) -> tuple[str, ...]:
    """Return names of the hands for tables and figures.

    A single one is "hand". Several are called as their frames; where `combine` has put the name of
    an arm before that of the frame, as in "human left arm/hand", its side takes that place.

    >>> from geodesic_ocp.model.model import hand_labels
    >>> hand_labels(["human left arm/hand", "human right arm/hand"])
    ('left hand', 'right hand')
    """
    if len(hands) == 1:
        return ("hand",)
    labels = []
    for name in hands:
        arm, _, frame = name.rpartition("/")
        sides = {"right", "left"}.intersection(arm.lower().replace("_", " ").split())
        labels.append(f"{sides.pop()} {frame}" if len(sides) == 1 else name)
    return tuple(labels) if len(set(labels)) == len(hands) else tuple(hands)


def _as_hands(model: pin.Model, hand: str, hands: Sequence[str]) -> tuple[str, ...]:
    """Return names of the hand frames, `hand` alone if there are no others.

    Raises:
        ValueError: one of them is no frame of the model or occurs twice, or `hand` is missing.
    """
    names = (hand,) if isinstance(hands, str) or not hands else tuple(hands)
    for name in (hand, *names):
        frame_index(model, name)
    if hand not in names or len(set(names)) < len(names):
        raise ValueError(f"hands must differ and include the hand {hand!r}, got {', '.join(names)}")
    return names


def _body_inertia(mass: float, centre: Array, inertia: ArrayLike | None) -> pin.Inertia:
    """Return spatial inertia from mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m^2].

    Raises:
        ValueError: the inertia is not symmetric, or has a negative principal moment.
    """
    try:
        moments = np.zeros((3, 3)) if inertia is None else real_array(inertia)
    except (TypeError, ValueError):
        moments = np.zeros(0)
    if moments.shape != (3, 3) or not np.all(np.isfinite(moments)):
        raise ValueError(f"inertia must be 3 x 3 finite numbers, got {inertia!r}")
    largest = np.abs(moments).max()
    if np.abs(moments - moments.T).max() > ROUNDING * largest:
        raise ValueError(f"inertia must be symmetric, got {moments.tolist()}")
    if np.linalg.eigvalsh(moments)[0] < -ROUNDING * largest:
        raise ValueError(f"inertia has a negative principal moment: {moments.tolist()}")
    return pin.Inertia(mass, centre, (moments + moments.T) / 2)
