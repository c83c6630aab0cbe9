"""Symbolic dynamics of a model, by one of two back ends.

`pinocchio.casadi` (Pinocchio's own algorithms on CasADi scalars) is used if it can be imported,
otherwise the package's built-in algorithms on the same pin.Model. Both compute the same functions;
where Pinocchio's expressions are more than a tenth larger, the former takes the built-in ones, too.
An argument or the environment variable GEODESIC_OCP_BACKEND overrides the choice.
"""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_choice, as_vector, evaluate, is_symbolic
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.model import rigid_body
from geodesic_ocp.model.joints import without_noise

BACKENDS = ("pinocchio.casadi", "built-in")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_BACKEND"
_VECTORISED = ("frame_pose", "inverse_dynamics", "mass_matrix")
NOT_INSTALLED = (
    "the pin wheels on PyPI do not include it; `make pinocchio-casadi` builds it for them, and the"
    " pinocchio of conda-forge includes it"
)


@dataclass(frozen=True)
class _PinocchioCasadi:
    """Pinocchio's algorithms instantiated on casadi.SX, for joints of one coordinate each."""

    cpin: Any  # the module pinocchio.casadi

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        built_in = rigid_body.mass_matrix(model, q)
        if not _numbered_depth_first(model):
            return built_in
        matrix = self.cpin.crba(*self._with_data(model), q)
        return _unless_larger(ca.triu2symm(ca.triu(matrix)), built_in)  # the upper triangle is set

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        energy = ca.SX(self.cpin.computeKineticEnergy(*self._with_data(_bare(model)), q, v))
        energy += ca.dot(ca.DM(model.armature), v**2) / 2
        return _unless_larger(energy, rigid_body.kinetic_energy(model, q, v))

    def coriolis_force(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        force = ca.SX(self.cpin.nonLinearEffects(*self._with_data(_bare(model)), q, v))
        return _unless_larger(force, rigid_body.coriolis_force(model, q, v))

    def inverse_dynamics(
        self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
    ) -> ca.SX:
        bare = _bare(model)
        force = ca.SX(self.cpin.rnea(*self._with_data(bare), q, v, a))
        force += ca.DM(model.armature) * a
        # The weight is the derivative of the potential energy, for gravity in any direction.
        for axis, unit in enumerate(np.eye(3)):
            bare.gravity = pin.Motion(unit, np.zeros(3))
            height = self.potential_energy(bare, q)
            force += gravity[axis] * ca.jacobian(height, q).T
        return _unless_larger(force, rigid_body.inverse_dynamics(model, q, v, a, gravity))

    def _with_data(self, model: pin.Model) -> tuple[Any, Any]:
        clean = model.copy()
        for index in range(model.njoints):
            clean.jointPlacements[index] = without_noise(model.jointPlacements[index])
        for index in range(model.nframes):
            clean.frames[index].placement = without_noise(model.frames[index].placement)
        symbolic = self.cpin.Model(clean)
        return symbolic, symbolic.createData()

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        symbolic, data = self._with_data(model)
        self.cpin.framesForwardKinematics(symbolic, data, q)
        pose = data.oMf[frame]
        return ca.densify(ca.SX(pose.rotation)), ca.densify(ca.SX(pose.translation))

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        return ca.SX(self.cpin.computePotentialEnergy(*self._with_data(model), q))


def _bare(model: pin.Model) -> pin.Model:
    """Return a copy without gravity, and without armature, which Pinocchio omits for any axis."""
    copy = model.copy()
    copy.gravity, copy.armature = pin.Motion.Zero(), np.zeros(model.nv)
    return copy


def _unless_larger(expression: ca.SX, built_in: ca.SX) -> ca.SX:
    """Return Pinocchio's expression, or the built-in one if that saves more than a tenth of it."""
    own = ca.SX(ca.cse(ca.densify(expression)))
    return own if ca.n_nodes(own) <= 1.1 * ca.n_nodes(built_in) else built_in


def _numbered_depth_first(model: pin.Model) -> bool:
    """Return whether the joints of every subtree are numbered consecutively, as crba requires.

    Models from files are. In models built by hand, joints can be appended to an earlier branch;
    crba then omits entries of the matrix. The recursions over single bodies, computeKineticEnergy
    and nonLinearEffects, are not affected.
    """
    return all(tree[-1] - tree[0] == len(tree) - 1 for tree in list(map(list, model.subtrees))[1:])


@lru_cache(maxsize=1)
def _pinocchio_casadi() -> ModuleType | str:
    """Return the module, or the reason why it cannot be imported."""
    with warnings.catch_warnings():
        # Both modules of Pinocchio register the same converter, about which Boost.Python warns.
        warnings.filterwarnings("ignore", "to-Python converter", RuntimeWarning)
        try:
            return importlib.import_module("pinocchio.casadi")
        except ImportError as error:
            failure = error
    if isinstance(failure, ModuleNotFoundError) and failure.name == "pinocchio.casadi":
        return NOT_INSTALLED
    return f"it is installed, but its import fails: {failure}"


def why_unavailable(name: str) -> str:
    """Return why a back end cannot be used here; empty if it can."""
    if name == "built-in":
        return ""
    found = _pinocchio_casadi()
    return found if isinstance(found, str) else ""


def choose_backend(name: str | None = None) -> str:
    """Return name of the back end: the argument, the environment variable, or the first available
    one.

    A pinocchio.casadi that is installed but cannot be imported is skipped with a RuntimeWarning.

    Raises:
        ValueError: the name is unknown, or the back end cannot be imported.
    """
    name = name or os.environ.get(ENVIRONMENT_VARIABLE)
    if not name:
        missing = why_unavailable(BACKENDS[0])
        name = BACKENDS[1] if missing else BACKENDS[0]
        if missing not in ("", NOT_INSTALLED):
            # stacklevel: the caller of Model
            warnings.warn(f"{BACKENDS[0]} is skipped: {missing}", RuntimeWarning, stacklevel=4)
    as_choice("backend", name, BACKENDS)
    if why_unavailable(name):
        raise ValueError(f"backend {name!r} cannot be imported: {why_unavailable(name)}")
    return name


@dataclass(frozen=True, eq=False)
class SymbolicFunctions:
    """Algorithms of a back end for one model, each built when it is first called."""

    pin: pin.Model
    backend: str
    _built: dict[tuple[Any, ...], ca.Function] = field(default_factory=dict, init=False, repr=False)

    def value(self, name: str, *options: int, **vectors: Any) -> Any:
        """Return an algorithm of the back end at q (n,), or at q and v; symbolic if they are.

        Those of `_VECTORISED` also take k rows (k, n), and give their matrices stacked (k, ...).
        """
        function = self._function(name, vectors, *options)
        if is_symbolic(*vectors.values()):
            return evaluate(function, *vectors.values())
        if np.ndim(vectors["q"]) < 2 or name not in _VECTORISED:
            sized = [as_vector(key, value, self._size(key)) for key, value in vectors.items()]
            return evaluate(function, *sized)
        count = len(vectors["q"])
        rows = (self._rows(*each, count) for each in vectors.items())
        shapes = [function.size_out(k) for k in range(function.n_out())]
        ends = np.cumsum([height * width for height, width in shapes])[:-1]
        parts = zip(np.split(at_rows(function, *rows), ends, axis=1), shapes, strict=True)
        found = [part.reshape(count, *shape[::-1]).swapaxes(1, 2) for part, shape in parts]
        return found[0] if len(found) == 1 else tuple(found)

    def _function(self, name: str, arguments: Iterable[str], *options: int) -> ca.Function:
        key = (name, *options)
        if key not in self._built:
            sizes = tuple((each, self._size(each)) for each in arguments)
            model = _Content(self.pin.saveToString(), self.pin)
            self._built[key] = _function(model, self.backend, name, sizes, options)
        return self._built[key]

    def _size(self, name: str) -> int:
        return 3 if name == "gravity" else self.pin.nv

    def _rows(self, name: str, values: Any, count: int) -> Array:
        """Return values (k, n), or the same vector (n,) k times."""
        size = self._size(name)
        if name == "gravity":
            return np.tile(as_vector(name, values, size), (count, 1))
        rows = np.asarray(values, dtype=float)
        if rows.shape != (count, size) or not np.all(np.isfinite(rows)):
            wanted = f"(k, {size}) with k = {count}"
            raise ValueError(f"{name} must be finite, of shape {wanted}, got {rows.shape}")
        return rows


@dataclass(frozen=True)
class _Content:
    """A model; those of equal content are equal."""

    text: str
    pin: pin.Model = field(compare=False, repr=False)


@lru_cache(maxsize=256)
def _function(
    model: _Content,
    backend: str,
    name: str,
    sizes: tuple[tuple[str, int], ...],
    options: tuple[int, ...],
) -> ca.Function:
    """Build an algorithm; equal models share it, as building takes hundredths of a second."""
    symbols = [ca.SX.sym(each, size) for each, size in sizes]
    algorithms = rigid_body if backend == "built-in" else _PinocchioCasadi(_pinocchio_casadi())
    algorithm = getattr(algorithms, "frame_pose" if name == "jacobian" else name)
    outputs = algorithm(model.pin, *symbols, *options)
    if name == "jacobian":
        outputs = _jacobian(*symbols, *outputs)
    listed = list(outputs) if isinstance(outputs, tuple) else [outputs]
    return ca.Function("_".join((name, *map(str, options))), symbols, listed)


def _jacobian(q: ca.SX, rotation: ca.SX, position: ca.SX) -> ca.SX:
    """Return Jacobian (6, n) of a pose: linear, then angular velocity, in base frame axes."""
    columns = [
        ca.inv_skew(ca.reshape(ca.jacobian(rotation, angle), 3, 3) @ rotation.T)
        for angle in ca.vertsplit(q)
    ]
    jacobian = ca.vertcat(ca.jacobian(position, q), ca.horzcat(*columns))
    return ca.densify(ca.cse(jacobian))
