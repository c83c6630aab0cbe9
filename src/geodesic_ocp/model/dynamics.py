"""Symbolic dynamics of a model, by one of two back ends.

The package's built-in algorithms on a pin.Model are the default: their expressions are smaller, and
results do not depend on what else is installed. `pinocchio.casadi` (Pinocchio's own algorithms on
CasADi symbols) computes the same functions. An argument or the environment variable
GEODESIC_OCP_BACKEND chooses it.
"""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, as_choice, as_vector, evaluate, is_symbolic
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.model import rigid_body
from geodesic_ocp.model.casadi_interface.library import COMMAND, PinocchioLibrary, find_library
from geodesic_ocp.model.joints import without_noise

BACKENDS = ("built-in", "pinocchio.casadi")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_BACKEND"
_VECTORISED = ("frame_pose", "inverse_dynamics", "mass_matrix")
NOT_INSTALLED = (
    f"the pin wheels on PyPI do not include it; `{COMMAND}` (in a clone `make pinocchio-casadi`)"
    " builds it for them, and the pinocchio of conda-forge includes it"
)


@dataclass(frozen=True)
class _Module:
    """The module `pinocchio.casadi`, as of conda-forge, with the methods of the library."""

    cpin: Any

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        matrix = ca.SX(self.cpin.crba(*self._with_data(model), q))
        return ca.SX(ca.triu2symm(ca.triu(matrix)))  # the upper triangle is set

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        return ca.SX(self.cpin.computeKineticEnergy(*self._with_data(model), q, v))

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        return ca.SX(self.cpin.computePotentialEnergy(*self._with_data(model), q))

    def inverse_dynamics(self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        return ca.SX(self.cpin.rnea(*self._with_data(model), q, v, a))

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        symbolic, data = self._with_data(model)
        self.cpin.framesForwardKinematics(symbolic, data, q)
        pose = data.oMf[frame]
        return ca.SX(pose.rotation), ca.SX(pose.translation)

    def _with_data(self, model: pin.Model) -> tuple[Any, Any]:
        symbolic = self.cpin.Model(model)
        return symbolic, symbolic.createData()


@dataclass(frozen=True)
class _PinocchioCasadi:
    """The back end on Pinocchio's algorithms: with armature, and gravity in any direction."""

    algorithms: _Module | PinocchioLibrary

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        if _numbered_depth_first(model):
            of_bodies = self.algorithms.mass_matrix(_bare(model), q)
        else:
            a = ca.SX.sym("a", model.nv)
            forces = self.algorithms.inverse_dynamics(_bare(model), q, ca.SX.zeros(model.nv), a)
            of_bodies = ca.jacobian(forces, a)
        return _shared(of_bodies + ca.diag(ca.SX(model.armature)))

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        of_bodies = self.algorithms.kinetic_energy(_bare(model), q, v)
        return _shared(of_bodies + ca.dot(ca.SX(model.armature), v**2) / 2)

    def coriolis_force(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        a = ca.SX.zeros(model.nv)
        return _shared(self.algorithms.inverse_dynamics(_bare(model), q, v, a))

    def inverse_dynamics(
        self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
    ) -> ca.SX:
        bare = _bare(model)
        force = self.algorithms.inverse_dynamics(bare, q, v, a) + ca.SX(model.armature) * a
        # The weight is the derivative of the potential energy, for gravity in any direction.
        for axis, unit in enumerate(np.eye(3)):
            bare.gravity = pin.Motion(unit, np.zeros(3))
            force += gravity[axis] * ca.gradient(self.algorithms.potential_energy(bare, q), q)
        return _shared(force)

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        rotation, translation = self.algorithms.frame_pose(_clean(model), q, frame)
        return ca.densify(rotation), ca.densify(translation)

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        return ca.densify(self.algorithms.potential_energy(_clean(model), q))


def _clean(model: pin.Model) -> pin.Model:
    """Return a copy without rounding errors in rotations, which would make expressions larger."""
    copy = model.copy()
    for index in range(model.njoints):
        copy.jointPlacements[index] = without_noise(model.jointPlacements[index])
    for index in range(model.nframes):
        copy.frames[index].placement = without_noise(model.frames[index].placement)
    return copy


def _bare(model: pin.Model) -> pin.Model:
    """Return a clean copy without gravity and armature; Pinocchio's energies have no armature."""
    copy = _clean(model)
    copy.gravity = pin.Motion.Zero()
    copy.armature = np.zeros(model.nv)
    return copy


def _shared(expression: ca.SX) -> ca.SX:
    """Return a dense expression in which equal terms are computed once."""
    return ca.cse(ca.densify(expression))


def _numbered_depth_first(model: pin.Model) -> bool:
    """Return whether the joints of every subtree are numbered consecutively, as crba requires.

    Models from files are. In models built by hand, joints can be appended to an earlier branch;
    crba then omits entries of the matrix. The recursions over single bodies,
    computeKineticEnergy and rnea, are not affected.
    """
    return all(tree[-1] - tree[0] == len(tree) - 1 for tree in list(map(list, model.subtrees))[1:])


def _pinocchio_casadi() -> _Module | PinocchioLibrary | str:
    """Return the module or the library that was built, or the reason why there is neither."""
    return _module() or find_library() or NOT_INSTALLED


@lru_cache(maxsize=1)
def _module() -> _Module | str:
    """Return the module, or the reason why it cannot be imported; empty if it is not installed."""
    with warnings.catch_warnings():
        # Both modules of Pinocchio register the same converter, about which Boost.Python warns.
        warnings.filterwarnings("ignore", "to-Python converter", RuntimeWarning)
        try:
            return _Module(importlib.import_module("pinocchio.casadi"))
        except ImportError as error:
            failure = error
    if isinstance(failure, ModuleNotFoundError) and failure.name == "pinocchio.casadi":
        return ""
    return f"its module is installed, but cannot be imported: {failure}"


def why_unavailable(name: str) -> str:
    """Return why a back end cannot be used here; empty if it can."""
    if name == "built-in":
        return ""
    found = _pinocchio_casadi()
    return found if isinstance(found, str) else ""


def backend_version(name: str) -> str:
    """Return version and origin of a back end that can be used here."""
    if name == "built-in":
        return f"of geodesic_ocp {version('geodesic_ocp')}"
    found = _found()
    origin = found.file if isinstance(found, PinocchioLibrary) else found.cpin.__file__
    return f"of Pinocchio {pin.__version__}, {origin}"


def choose_backend(name: str | None = None) -> str:
    """Return name of the back end: the argument, the environment variable, or "built-in".

    Raises:
        ValueError: the name is unknown, or the back end cannot be used here.
    """
    name = name or os.environ.get(ENVIRONMENT_VARIABLE) or BACKENDS[0]
    as_choice("backend", name, BACKENDS)
    if missing := why_unavailable(name):
        raise ValueError(f"backend {name!r} cannot be used: {missing}")
    return name


@dataclass(eq=False)
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


def _found() -> _Module | PinocchioLibrary:
    found = _pinocchio_casadi()
    if isinstance(found, str):
        raise ValueError(f"backend 'pinocchio.casadi' cannot be used: {found}")
    return found


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
    algorithms = rigid_body if backend == "built-in" else _PinocchioCasadi(_found())
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
