"""The rigid-body algorithms of one model as CasADi functions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import as_vector, evaluate, is_symbolic
from geodesic_ocp.model.dynamics.rigid_body import rigid_body


@dataclass(frozen=True, eq=False)
class SymbolicFunctions:
    """Algorithms of a back end for one model, each built when it is first called."""

    pin: pin.Model
    backend: str
    _built: dict[str, ca.Function] = field(default_factory=dict, init=False, repr=False)

    def value(self, name: str, **vectors: Any) -> Any:
        """An algorithm of the back end at q (n,), or at q and v; symbolic if they are."""
        return evaluate(self._function(name, "".join(vectors)), *self._checked(**vectors))

    def inverse_dynamics(self, q: Any, v: Any, a: Any, gravity: Any) -> Any:
        """Joint forces at one state, (n,) each, or at several, (k, n) each."""
        if "inverse_dynamics" not in self._built:
            symbols = [ca.SX.sym(name, self.pin.nv) for name in "qva"] + [ca.SX.sym("gravity", 3)]
            force = rigid_body(self.backend).inverse_dynamics(self.pin, *symbols)
            self._built["inverse_dynamics"] = ca.Function("inverse_dynamics", symbols, [force])
        function = self._built["inverse_dynamics"]
        if is_symbolic(q, v, a, gravity):
            return function(q, v, a, gravity)
        free_fall = as_vector("gravity", gravity, 3)
        if np.ndim(q) < 2:
            state = self._checked(q=q, v=v, a=a)
            return evaluate(function, *state, free_fall)[:, 0]
        rows = [np.asarray(each, dtype=float) for each in (q, v, a)]
        for name, each in zip("qva", rows, strict=True):
            if each.shape != (len(rows[0]), self.pin.nv) or not np.all(np.isfinite(each)):
                raise ValueError(
                    f"{name} must be finite, of shape ({len(rows[0])}, {self.pin.nv}), "
                    f"got {each.shape}"
                )
        if len(rows[0]) == 0:
            return np.zeros((0, self.pin.nv))
        fall = np.repeat(free_fall[:, None], len(rows[0]), axis=1)
        return evaluate(function.map(len(rows[0])), *(each.T for each in rows), fall).T

    def jacobian(self, frame: int, q: Any) -> Any:
        """Jacobian (6, n) of a frame: linear, then angular velocity, in base frame axes."""
        return evaluate(self._jacobian(frame), *self._checked(q=q))

    def pose(self, frame: int, q: Any) -> Any:
        """Rotation and position of a frame at one configuration (n,) or at several (k, n)."""
        function = self._function("frame_pose", "q", frame)
        if is_symbolic(q) or np.ndim(q) < 2:
            rotation, position = evaluate(function, *self._checked(q=q))
            return rotation, position if is_symbolic(q) else position[:, 0]
        rows = np.asarray(q, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != self.pin.nv or not np.all(np.isfinite(rows)):
            raise ValueError(f"q must be finite, of shape (k, {self.pin.nv}), got {rows.shape}")
        rotations, positions = evaluate(function.map(len(rows)), rows.T)
        return rotations.reshape(3, -1, 3).transpose(1, 0, 2), positions.reshape(3, -1).T

    def _function(self, name: str, arguments: str, *options: int) -> ca.Function:
        key = "_".join((name, *map(str, options)))
        if key not in self._built:
            symbols = [ca.SX.sym(argument, self.pin.nv) for argument in arguments]
            outputs = getattr(rigid_body(self.backend), name)(self.pin, *symbols, *options)
            listed = list(outputs) if isinstance(outputs, tuple) else [outputs]
            self._built[key] = ca.Function(key, symbols, listed)
        return self._built[key]

    def _jacobian(self, frame: int) -> ca.Function:
        key = f"jacobian_{frame}"
        if key not in self._built:
            q = ca.SX.sym("q", self.pin.nv)
            rotation, position = self._function("frame_pose", "q", frame)(q)
            columns = [
                ca.inv_skew(ca.reshape(ca.jacobian(rotation, q[i]), 3, 3) @ rotation.T)
                for i in range(self.pin.nv)
            ]
            jacobian = ca.vertcat(ca.jacobian(position, q), ca.horzcat(*columns))
            self._built[key] = ca.Function(
                "hand_jacobian", [q], [ca.densify(ca.cse(jacobian))], ["q"], ["J"]
            )
        return self._built[key]

    def _checked(self, **vectors: Any) -> list[Any]:
        if is_symbolic(*vectors.values()):
            return list(vectors.values())
        return [as_vector(name, value, self.pin.nv) for name, value in vectors.items()]
