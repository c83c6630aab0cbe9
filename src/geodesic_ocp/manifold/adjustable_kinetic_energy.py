"""The kinetic energy with joint inertia, payload and inertial parameters that can be adjusted."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import as_number
from geodesic_ocp.manifold.metrics import KineticEnergy, ModelMetric
from geodesic_ocp.model.inertias import inertia_scale, scale_inertias
from geodesic_ocp.model.rigid_body import link_energies

_POSITIVE = ("mass_ratio", "height_ratio")
_PER_JOINT = ("armature", "joint_inertia", "link_mass_ratios", "link_inertia_ratios")


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

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm()
    >>> metric = go.AdjustableKineticEnergy(arm, armature=0.05)
    >>> q = [0.3, 0.1, -0.2, 0.8, 0.0, 0.0, 0.0]
    >>> (metric.matrix(q) - arm.mass_matrix(q)).diagonal().round(3)
    array([0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05])

    Attributes:
        model: whose links move.
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
            object.__setattr__(self, "armature", tuple(np.array(self.model.pin.armature).tolist()))
        for name in _PER_JOINT:
            given = getattr(self, name)
            entries = tuple(given) if isinstance(given, (tuple, list, np.ndarray)) else (given,) * n
            if len(entries) != n:
                raise ValueError(f"{name} must have {n} entries, one a joint, got {len(entries)}")
            object.__setattr__(self, name, entries)
            for joint, entry in zip(self.model.joint_names, entries, strict=True):
                _check(f"{name} of {joint}", entry, positive=False)
        for name in ("payload", *_POSITIVE):
            _check(name, getattr(self, name), positive=name in _POSITIVE)
        if "m" in self.model.units and not (
            isinstance(self.height_ratio, (int, float)) and self.height_ratio == 1.0
        ):
            raise ValueError("height_ratio: the model has prismatic joints, which do not scale")

    def __repr__(self) -> str:
        return f"AdjustableKineticEnergy({self.model.name}: {self.description})"

    @property
    def description(self) -> str:
        """The metric and its parameters in words.

        >>> import geodesic_ocp as go
        >>> go.AdjustableKineticEnergy(go.human_arm(), joint_inertia=0.02, payload=1.0).description
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
        """Metric tensor G(q), (n, n) [kg m^2 for revolute, kg for prismatic joints]."""
        if self.adjusted is not None:
            return self.adjusted.matrix(q)
        v = ca.SX.sym("v", self.dim)
        return ca.cse(ca.hessian(self._energy(q, v), v)[0])

    def _energy(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Kinetic energy v' G(q) v / 2 [J]."""
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
        """sum_jk Gamma_ijk u_j v_k, (n, 1)."""
        if self.adjusted is not None:
            return self.adjusted._christoffel_force(q, u, v)
        return super()._christoffel_force(q, u, v)


def _check(name: str, value: Any, positive: bool) -> None:
    """ValueError if a number is negative, not finite, or zero where it must be positive."""
    if isinstance(value, ca.SX):
        return
    number = as_number(name, value)
    if number < 0.0 or (positive and number == 0.0):
        raise ValueError(
            f"{name} must be {'positive' if positive else 'not negative'}, got {value}"
        )


def _range(values: tuple[Any, ...]) -> str:
    """The least and the largest number; all values if one is an expression."""
    if any(isinstance(entry, ca.SX) for entry in values):
        return ", ".join(dict.fromkeys(map(str, values)))
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"
