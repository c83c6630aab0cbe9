"""The metrics of the package, and those under which synergies are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any, Literal, get_args

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_not_negative, as_positive, settle
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.model.inertias import inertia_scale, scale_inertias
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.rigid_body import link_energies

JOINT_INERTIA = "kinetic energy with joint inertia"
KINETIC_ENERGY = "kinetic energy"
STRAIGHT_LINES = "straight lines"
MetricName = Literal["joint-inertia", "kinetic", "euclidean"]
METRIC_NAMES: tuple[str, ...] = get_args(MetricName)
# Of m r^2: what `fit_metric` estimates from recordings of the KIT database and the bundled one,
# with 0.02 to 0.04 as its 95 % interval.
FRACTION = 0.03
# Of `AdjustableKineticEnergy`: checks of its numbers, and parameters of every joint.
_CHECKS = {"payload": as_not_negative, "mass_ratio": as_positive, "height_ratio": as_positive}
_PER_JOINT = ("armature", "joint_inertia", "link_mass_ratios", "link_inertia_ratios")


@dataclass(frozen=True)
class Euclidean(Metric):
    """The Euclidean metric of R^n, whose geodesics are straight lines."""

    dim: int

    def __post_init__(self) -> None:
        as_metric(self)

    def matrix(self, q: Any) -> Any:
        """Return the identity (n, n)."""
        return type(q).eye(self.dim)


@dataclass(frozen=True)
class ModelMetric(Metric):
    """A metric on the joint space of a model."""

    model: Model

    @property
    def dim(self) -> int:  # type: ignore[override]
        """Number of degrees of freedom of the model."""
        return self.model.dof

    @property
    def joint_names(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the model's joints, in the order of q."""
        return self.model.joint_names

    @property
    def periods(self) -> tuple[float, ...]:  # type: ignore[override]
        """2 pi for continuous joints, inf for others."""
        return tuple(
            2.0 * np.pi if name in self.model.continuous else np.inf for name in self.joint_names
        )

    def check_units(self, name: str, q: Array) -> None:
        """Raise ValueError if a joint is over a revolution beyond its limits, as if in degrees.

        Joints that are continuous, prismatic or without limits may be anywhere.
        """
        low, high = self._conceivable
        outside = (q < low) | (q > high)
        if outside.any():
            index = int(np.argmax(outside))
            low = self.model.lower[index]
            high = self.model.upper[index]
            raise ValueError(
                f"{name}: {self.joint_names[index]} is at {q[index]:.4g} rad, more than a "
                f"revolution beyond its limits {low:.3g} to {high:.3g}: are these degrees? Angles "
                "must be in rad"
            )

    @cached_property
    def _conceivable(self) -> tuple[Array, Array]:
        """Limits of the joints, wider by a revolution; none for continuous and prismatic joints."""
        turning = np.array([unit == "rad" for unit in self.model.units])
        wider = np.where(turning & np.isinf(self.periods), 2.0 * np.pi, np.inf)
        return self.model.lower - wider, self.model.upper + wider


@dataclass(frozen=True)
class KineticEnergy(ModelMetric):
    """The mass-inertia matrix of a model as metric: |v|^2 / 2 is its kinetic energy [J].

    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q = [0.3, 0.1, -0.2, 0.8, 0.0, 0.0, 0.0]
    >>> metric.matrix(q).shape
    (7, 7)
    >>> round(metric.norm(q, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) ** 2 / 2.0, 3)  # 1 rad/s, in J
    0.201
    """

    def matrix(self, q: Any) -> Any:
        """Return mass-inertia matrix G(q), (n, n)."""
        return self.model.mass_matrix(q)

    def _energy(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Return kinetic energy v' G(q) v / 2 [J], summed over the bodies."""
        if not self._has_mass_matrix:
            return super()._energy(q, v)
        return ca.SX(self.model.kinetic_energy(q, v))

    def _christoffel_force(self, q: ca.SX, u: ca.SX, v: ca.SX) -> ca.SX:
        """Return sum_jk Gamma_ijk u_j v_k, (n, 1): the bilinear form of the Coriolis forces."""
        if not self._has_mass_matrix:
            return super()._christoffel_force(q, u, v)
        quadratic = ca.SX(self.model.coriolis_force(q, u))
        return quadratic if ca.is_equal(u, v) else ca.jtimes(quadratic, u, v) / 2

    @property
    def _has_mass_matrix(self) -> bool:
        """True if no subclass overrides `matrix`, so that the model's recursions apply."""
        return type(self).matrix is KineticEnergy.matrix


@lru_cache(maxsize=32)
def metric_of(model: Model) -> KineticEnergy:
    """Return the kinetic-energy metric of a model, whose functions are built once."""
    return KineticEnergy(model)


@dataclass(frozen=True)
class JacobiMetric(ModelMetric):
    """(E - V(q)) G(q): geodesics are the paths of torque-free motion at total energy E.

    Maupertuis' principle in Jacobi's form (Arnold, "Mathematical Methods of Classical Mechanics",
    section 45): the motion without torques, with kinetic energy E - V at q, follows a geodesic of
    this metric, at speed |dq/dt|_G = sqrt(2 (E - V)) instead of constant speed. The metric is
    defined only where V < E, and paths cannot leave that region.

    Attributes:
        model: provides mass matrix and potential energy, with the gravity of `model.pin`.
        energy: total energy E [J]; see `model.potential_energy` for its zero.

    Raises:
        ValueError: the energy is not a finite number.
    """

    energy: float

    def __post_init__(self) -> None:
        if not np.isfinite(self.energy):
            raise ValueError(f"energy must be finite [J], got {self.energy}")

    def matrix(self, q: Any) -> Any:
        """Return metric tensor (E - V(q)) G(q), (n, n); NaN where V(q) >= E."""
        kinetic = self.energy - self.model.potential_energy(q)
        # NaN stops a solver there, where negative squared lengths would attract it.
        return ca.if_else(kinetic > 0, kinetic, np.nan) * self.model.mass_matrix(q)

    def check_domain(self, name: str, q: Array) -> None:
        """Raise ValueError if the potential energy at q (n,) is too high."""
        potential = self.model.potential_energy(q)
        if potential >= self.energy:
            raise ValueError(
                f"{name}: the potential energy {potential:.6g} J at {q} is not below the total"
                f" energy of {self.energy:.6g} J: the model cannot be there"
            )


@dataclass(frozen=True, repr=False)
class AdjustableKineticEnergy(ModelMetric):
    """The kinetic energy of a model whose inertial parameters differ from the model's own.

    |v|^2 / 2 is the sum of

    - the links' energies: of the link behind joint i, the translational one times
      link_mass_ratios[i], the rotational one times link_mass_ratios[i] link_inertia_ratios[i], and
      both times mass_ratio height_ratio^2, as lengths scale with body height;
    - payload height_ratio^2 |v_h|^2 / 2, with the velocity v_h of the hand (end-effector);
    - (armature[i] + joint_inertia[i] m r^2) v_i^2 / 2, the energy of the joint inertia, which is
      given in absolute terms, or relative to the model's moving mass m and reach r, or both.

    The parameters are numbers or CasADi expressions, so that `fit_metric` can estimate them.

    >>> arm = go.human_arm()
    >>> metric = go.manifold.AdjustableKineticEnergy(arm, armature=0.05)
    >>> q = [0.3, 0.1, -0.2, 0.8, 0.0, 0.0, 0.0]
    >>> (metric.matrix(q) - arm.mass_matrix(q)).diagonal().round(3)
    array([0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05])

    Attributes:
        model: model whose links move.
        armature: joint inertia of every joint, (n,) or one number [kg m^2 or kg]; None: the
            model's.
        joint_inertia: further joint inertia relative to m r^2 (of prismatic joints, to m), (n,) or
            one number.
        payload: point mass at the hand [kg].
        mass_ratio, height_ratio: body mass and height relative to the model's.
        link_mass_ratios: mass of the link behind each joint relative to the model's, (n,) or one
            number.
        link_inertia_ratios: rotational inertia relative to the mass, compared with the model's,
            (n,) or one number.

    Raises:
        ValueError: a wrong number of entries, a negative number, a ratio of mass or height that is
            not positive, or a height ratio for a model with prismatic joints.
    """

    armature: Any = None
    joint_inertia: Any = 0.0
    payload: Any = 0.0
    mass_ratio: Any = 1.0
    height_ratio: Any = 1.0
    link_mass_ratios: Any = 1.0
    link_inertia_ratios: Any = 1.0
    label = "fitted kinetic energy"

    def __post_init__(self) -> None:
        n = self.model.dof
        if self.armature is None:
            settle(self, armature=tuple(np.array(self.model.pin.armature).tolist()))
        for name in _PER_JOINT:
            given = getattr(self, name)
            entries = tuple(given) if isinstance(given, (tuple, list, np.ndarray)) else (given,) * n
            if len(entries) != n:
                raise ValueError(f"{name} must have {n} entries, one a joint, got {len(entries)}")
            settle(self, **{name: entries})
            for joint, entry in zip(self.model.joint_names, entries, strict=True):
                if not isinstance(entry, ca.SX):
                    as_not_negative(f"{name} of {joint}", entry)
        for name, check in _CHECKS.items():
            if not isinstance(getattr(self, name), ca.SX):
                check(name, getattr(self, name))
        if "m" in self.model.units and not (
            isinstance(self.height_ratio, (int, float)) and self.height_ratio == 1.0
        ):
            raise ValueError("height_ratio: the model has prismatic joints, which do not scale")

    def __repr__(self) -> str:
        return f"AdjustableKineticEnergy({self.model.name}: {self.description})"

    @property
    def description(self) -> str:
        """The metric and its parameters in words.

        >>> arm = go.human_arm()
        >>> go.manifold.AdjustableKineticEnergy(arm, joint_inertia=0.02, payload=1.0).description
        'fitted kinetic energy with joint inertia 0.02 m r^2, payload 1 kg'
        """
        units = {
            "armature": ("joint inertia", "kg" if set(self.model.units) == {"m"} else "kg m^2"),
            "joint_inertia": ("joint inertia", "m" if set(self.model.units) == {"m"} else "m r^2"),
            "payload": ("payload", "kg"),
        }
        parts = []
        for each in fields(self)[1:]:
            given = getattr(self, each.name)
            values = given if isinstance(given, tuple) else (given,)
            without = 0.0 if each.default is None else each.default
            if any(isinstance(entry, ca.SX) or entry != without for entry in values):
                word, unit = units.get(each.name, (each.name.replace("_", " "), ""))
                parts.append(f"{word} {_range(values)} {unit}".strip())
        return f"{self.label} {'with ' + ', '.join(parts) if parts else 'of the links alone'}"

    @cached_property
    def adjusted(self) -> KineticEnergy | None:
        """The same metric as the kinetic energy of a model; None if a parameter is symbolic."""
        lists = (getattr(self, name) for name in _PER_JOINT)
        numbers = [self.payload, self.mass_ratio, self.height_ratio, *chain(*lists)]
        if any(isinstance(entry, ca.SX) for entry in numbers):
            return None
        scale = self.mass_ratio * self.height_ratio**2
        masses = scale * np.array(self.link_mass_ratios, dtype=float)
        model = scale_inertias(self.model, masses, masses * np.array(self.link_inertia_ratios))
        if self.payload:
            model = model.with_payload(self.payload * self.height_ratio**2)
        relative = np.array(self.joint_inertia, dtype=float)
        added = relative * inertia_scale(self.model) if np.any(relative) else 0.0
        return KineticEnergy(model.with_armature(np.array(self.armature, dtype=float) + added))

    def matrix(self, q: Any) -> Any:
        """Return metric tensor G(q), (n, n) [kg m^2 for revolute, kg for prismatic joints]."""
        if self.adjusted is not None:
            return self.adjusted.matrix(q)
        v = ca.SX.sym("v", self.dim)
        return ca.cse(ca.hessian(self._energy(q, v), v)[0])

    def _energy(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Return kinetic energy v' G(q) v / 2 [J]."""
        if self.adjusted is not None:
            return self.adjusted._energy(q, v)
        energies = link_energies(self.model.pin, q, v)
        armature, relative, masses, inertias = (
            ca.vertcat(*(ca.SX(entry) for entry in getattr(self, name))) for name in _PER_JOINT
        )
        if not relative.is_zero():
            armature += relative * ca.DM(inertia_scale(self.model))
        of_links = ca.dot(masses, energies[:, 0] + inertias * energies[:, 1])
        hand = ca.jtimes(self.model.hand_pose(q)[1], q, v)
        moved = self.mass_ratio * of_links + self.payload * ca.sumsqr(hand) / 2
        total = self.height_ratio**2 * moved + ca.dot(armature, v**2) / 2
        return ca.cse(ca.densify(ca.SX(total)))

    def _christoffel_force(self, q: ca.SX, u: ca.SX, v: ca.SX) -> ca.SX:
        """Return sum_jk Gamma_ijk u_j v_k, (n, 1)."""
        if self.adjusted is not None:
            return self.adjusted._christoffel_force(q, u, v)
        return super()._christoffel_force(q, u, v)


def _range(values: tuple[Any, ...]) -> str:
    """Return the least and the largest number; all values if one is an expression."""
    if any(isinstance(entry, ca.SX) for entry in values):
        return ", ".join(dict.fromkeys(map(str, values)))
    low = f"{min(values):.3g}"
    high = f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


# Functions of a model, in the order of the names: the kinetic energy with the model's or the
# default joint inertia, that of the links alone, and the Euclidean metric, whose geodesics are
# straight lines in joint space.
USUAL_METRICS: Mapping[str, Callable[[Model], Metric]] = {
    JOINT_INERTIA: lambda model: KineticEnergy(with_joint_inertia(model)),
    KINETIC_ENERGY: lambda model: KineticEnergy(
        model.with_armature(0.0) if np.any(model.armature) else model
    ),
    STRAIGHT_LINES: lambda model: Euclidean(model.dof),
}


def default_joint_inertia(model: Model) -> Array:
    """Return joint inertia (n,) that `analyse` assumes of an arm [kg m^2, kg for prismatic joints].

    a = 0.03 m r^2 for revolute and 0.03 m for prismatic joints, with the moving mass m and the
    reach r of the model. The geodesics of G(q) + diag(a) depend on the ratio of a and G only, so
    that a constant in kg m^2 would make them depend on the body mass that a recording states, which
    is often a placeholder.

    >>> go.manifold.default_joint_inertia(go.human_arm(height=1.75, mass=70.0)).round(3)
    array([0.044, 0.044, 0.044, 0.044, 0.044, 0.044, 0.044])

    Args:
        model: the arm.

    Raises:
        ValueError: the reach is infinite, as a prismatic joint has no limits, or zero.
    """
    if not has_default_joint_inertia(model):
        raise ValueError(
            f"{model.name!r}, with a reach of {model.reach:g} m and {model.mass:g} kg, has no "
            "default joint inertia: limit its joints (Model.with_limits), give the joint inertia "
            "(Model.with_armature), or choose another metric"
        )
    return np.asarray(FRACTION * inertia_scale(model))


def has_default_joint_inertia(model: Model) -> bool:
    """Return whether mass and reach of the model are positive and finite, as needed."""
    scale = inertia_scale(model)
    return bool(np.all(np.isfinite(scale) & (scale > 0.0)))


def with_joint_inertia(model: Model) -> Model:
    """Return the model with its own armature if it has any, otherwise with the default joint
    inertia.
    """
    return model if np.any(model.armature) else model.with_armature(default_joint_inertia(model))


def as_analysis_metric(metric: Metric | str | None, model: Model) -> Metric:
    """Return the metric of an analysis, from its name or None, which is "joint-inertia".

    Raises:
        ValueError: an unknown name, no metric, or one of another dimension or of other joints.
    """
    metric = METRIC_NAMES[0] if metric is None else metric
    if isinstance(metric, str) and metric in METRIC_NAMES:
        return [*USUAL_METRICS.values()][METRIC_NAMES.index(metric)](model)
    if not isinstance(metric, Metric):
        known = ", ".join(map(repr, METRIC_NAMES))
        raise ValueError(f"metric must be {known} or a Metric, got {metric!r}")
    if metric.dim != model.dof or (metric.joint_names or model.joint_names) != model.joint_names:
        joints = f" of the joints {', '.join(metric.joint_names)}" if metric.joint_names else ""
        raise ValueError(
            f"metric has dimension {metric.dim}{joints}, but {model.name!r} has {model.dof} "
            f"joints, {', '.join(model.joint_names)}"
        )
    return metric


def compared_metrics(metric: Metric, model: Model) -> dict[str, Metric]:
    """Return the metrics whose geodesics on the same segments are shown beside those of `metric`.

    By method: "kinetic_energy", without joint inertia; "joint_inertia", with the model's or the
    default one; "euclidean_same_segments". The metric itself is left out.
    """
    compared = {"kinetic_energy": USUAL_METRICS[KINETIC_ENERGY](model)}
    if np.any(model.armature) or has_default_joint_inertia(model):
        compared["joint_inertia"] = USUAL_METRICS[JOINT_INERTIA](model)
    compared["euclidean_same_segments"] = USUAL_METRICS[STRAIGHT_LINES](model)
    compared.pop(method_of(metric), None)
    return compared


def method_of(metric: Metric) -> str:
    """Get the method of `compared_metrics` that has a metric of this kind; "" for other metrics."""
    if isinstance(metric, Euclidean):
        return "euclidean_same_segments"
    if type(metric) is KineticEnergy:
        return "joint_inertia" if np.any(metric.model.armature) else "kinetic_energy"
    return ""


def joint_inertia_of(metric: Metric) -> str:
    """Return the joint inertia of a kinetic energy in words, such as "0.044 kg m^2"; empty without
    any.
    """
    if method_of(metric) != "joint_inertia":
        return ""
    assert isinstance(metric, KineticEnergy)
    units = np.array(metric.model.units)
    values = {unit: tuple(metric.model.armature[units == unit].tolist()) for unit in ("rad", "m")}
    per_unit = {"rad": "kg m^2", "m": "kg"}
    return ", ".join(f"{_range(each)} {per_unit[unit]}" for unit, each in values.items() if each)
