"""The two back ends of the symbolic rigid-body algorithms, and the choice between them.

`pinocchio.casadi` (Pinocchio's own algorithms on CasADi scalars) is used if it can be imported,
otherwise the package's built-in algorithms on the same pin.Model. Both compute the same functions;
where Pinocchio's expressions are more than a tenth larger, the former takes the built-in ones, too.
An argument or the environment variable GEODESIC_OCP_BACKEND overrides the choice.
"""

from __future__ import annotations

import importlib
import os
import warnings
from functools import lru_cache
from types import ModuleType
from typing import Any, Protocol

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.model.dynamics import built_in
from geodesic_ocp.model.joints import configuration, motion_subspace, without_noise

BACKENDS = ("pinocchio.casadi", "built-in")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_BACKEND"
NOT_INSTALLED = (
    "the pin wheels on PyPI do not include it; `make pinocchio-casadi` builds it for them, and the"
    " pinocchio of conda-forge includes it"
)


class RigidBody(Protocol):
    """The functions that a back end provides."""

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Joint-space mass-inertia matrix (nv, nv), both triangles filled."""

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        """Kinetic energy v' G(q) v / 2, (1, 1) [J], armature included."""

    def coriolis_force(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        """Coriolis and centrifugal forces C(q, v) v, (nv, 1), without gravity."""

    def inverse_dynamics(
        self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
    ) -> ca.SX:
        """Joint forces G(q) a + C(q, v) v + g(q), (nv, 1), armature included."""

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        """Rotation (3, 3) and position (3, 1) [m] of a frame in the base frame."""

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Gravitational potential energy (1, 1) [J], zero at the height of the base."""


class _PinocchioCasadi:
    """Pinocchio's algorithms instantiated on casadi.SX."""

    def __init__(self, module: ModuleType) -> None:
        self._cpin = module

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        for index in range(1, model.njoints):
            motion_subspace(model, index)  # rejects the same joints as the built-in back end
        if not _numbered_depth_first(model):
            return self._mass_matrix_by_columns(model, q)
        symbolic = self._symbolic(model)
        matrix = self._cpin.crba(symbolic, symbolic.createData(), configuration(model, q))
        symmetric = ca.triu2symm(ca.triu(matrix))  # crba fills the upper triangle only
        return _unless_larger(symmetric, built_in.mass_matrix(model, q))

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        bare = model.copy()
        bare.armature = np.zeros(model.nv)  # which Pinocchio omits for joints of any axis
        symbolic = self._symbolic(bare)
        data, full = symbolic.createData(), configuration(model, q)
        energy = ca.SX(self._cpin.computeKineticEnergy(symbolic, data, full, v))
        energy += ca.dot(ca.DM(model.armature), v**2) / 2
        return _unless_larger(energy, built_in.kinetic_energy(model, q, v))

    def coriolis_force(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        symbolic = self._symbolic(_weightless(model))
        data, full = symbolic.createData(), configuration(model, q)
        force = ca.SX(self._cpin.nonLinearEffects(symbolic, data, full, v))
        return _unless_larger(force, built_in.coriolis_force(model, q, v))

    def inverse_dynamics(
        self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
    ) -> ca.SX:
        bare = _weightless(model)
        bare.armature = np.zeros(model.nv)  # which Pinocchio omits for joints of any axis
        symbolic = self._symbolic(bare)
        data, full = symbolic.createData(), configuration(model, q)
        force = ca.SX(self._cpin.rnea(symbolic, data, full, v, a)) + ca.DM(model.armature) * a
        # The weight is the derivative of the potential energy, for gravity in any direction.
        for axis, unit in enumerate(np.eye(3)):
            bare.gravity = pin.Motion(unit, np.zeros(3))
            height = self.potential_energy(bare, q)
            force += gravity[axis] * ca.jacobian(height, q).T
        return _unless_larger(force, built_in.inverse_dynamics(model, q, v, a, gravity))

    def _symbolic(self, model: pin.Model) -> Any:
        clean = model.copy()
        for index in range(model.njoints):
            clean.jointPlacements[index] = without_noise(model.jointPlacements[index])
        for index in range(model.nframes):
            clean.frames[index].placement = without_noise(model.frames[index].placement)
        return self._cpin.Model(clean)

    def _mass_matrix_by_columns(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """The mass matrix as torques of unit accelerations at rest, without gravity."""
        symbolic = self._symbolic(_weightless(model))
        data, still = symbolic.createData(), ca.SX.zeros(model.nv)
        columns = [
            ca.SX(self._cpin.rnea(symbolic, data, configuration(model, q), still, unit))
            for unit in ca.horzsplit(ca.SX.eye(model.nv))
        ]
        return _unless_larger(ca.horzcat(*columns), built_in.mass_matrix(model, q))

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        symbolic = self._symbolic(model)
        data = symbolic.createData()
        self._cpin.framesForwardKinematics(symbolic, data, configuration(model, q))
        pose = data.oMf[frame]
        return ca.densify(ca.SX(pose.rotation)), ca.densify(ca.SX(pose.translation))

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        symbolic = self._symbolic(model)
        data = symbolic.createData()
        return ca.SX(self._cpin.computePotentialEnergy(symbolic, data, configuration(model, q)))


def _weightless(model: pin.Model) -> pin.Model:
    copy = model.copy()
    copy.gravity = pin.Motion.Zero()
    return copy


def _unless_larger(expression: ca.SX, built_in: ca.SX) -> ca.SX:
    """Pinocchio's expression, or the built-in one if that saves more than a tenth of it."""
    own = ca.SX(ca.cse(ca.densify(expression)))
    return own if ca.n_nodes(own) <= 1.1 * ca.n_nodes(built_in) else built_in


def _numbered_depth_first(model: pin.Model) -> bool:
    """Whether the joints of every subtree are numbered consecutively, as Pinocchio's crba requires.

    Models from files are. In models built by hand, joints can be appended to an earlier branch;
    crba then omits entries of the matrix. The recursions over single bodies, computeKineticEnergy
    and nonLinearEffects, are not affected.
    """
    subtrees = [list(subtree) for subtree in model.subtrees]
    return all(subtree[-1] - subtree[0] == len(subtree) - 1 for subtree in subtrees[1:])


@lru_cache(maxsize=1)
def _pinocchio_casadi() -> ModuleType | str:
    """The module, or the reason why it cannot be imported."""
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
    """Why a back end cannot be used here; empty if it can."""
    if name == "built-in":
        return ""
    found = _pinocchio_casadi()
    return found if isinstance(found, str) else ""


def choose_backend(name: str | None = None) -> str:
    """Name of the back end: the argument, the environment variable, or the first available one.

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
    if name not in BACKENDS:
        raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, got {name!r}")
    if why_unavailable(name):
        raise ValueError(f"backend {name!r} cannot be imported: {why_unavailable(name)}")
    return name


def rigid_body(backend: str) -> RigidBody:
    """The back end with the name that `choose_backend` returned."""
    if backend == "built-in":
        return built_in
    module = _pinocchio_casadi()
    assert not isinstance(module, str), module
    return _PinocchioCasadi(module)
