"""Symbolic mass matrix and frame poses of a pin.Model, from one of two back ends.

`pinocchio.casadi` (Pinocchio's own algorithms on CasADi scalars) where it can be imported,
otherwise the package's built-in algorithms, which read the same pin.Model. They compute the same
functions; the choice can be made by an argument or by the environment variable
GEODESIC_OCP_BACKEND.
"""

from __future__ import annotations

import importlib
import os
import warnings
from functools import lru_cache
from types import ModuleType
from typing import Any, Protocol

import casadi as ca
import pinocchio as pin

from geodesic_ocp.model import built_in
from geodesic_ocp.model.joints import configuration, motion_subspace, without_noise

BACKENDS = ("pinocchio.casadi", "built-in")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_BACKEND"
NOT_INSTALLED = (
    "pip's pin wheels leave it out; `make pinocchio-casadi` builds it for them, and conda-forge's"
    " pinocchio has it"
)


class RigidBody(Protocol):
    """What the rest of the package asks of a back end."""

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Joint-space mass-inertia matrix (nv, nv), both triangles filled."""

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        """Rotation (3, 3) and position (3, 1) [m] of a frame in the base frame."""

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Potential energy (1, 1) [J] in the model's gravity, zero at the base's height."""


class _PinocchioCasadi:
    """Pinocchio's algorithms instantiated on casadi.SX."""

    def __init__(self, module: ModuleType) -> None:
        self._cpin = module

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        for index in range(1, model.njoints):
            motion_subspace(model, index)  # refuses the same joints as the built-in back end
        if not _numbered_depth_first(model):
            return self._by_columns(model, q)
        symbolic = self._symbolic(model)
        matrix = self._cpin.crba(symbolic, symbolic.createData(), configuration(model, q))
        symmetric = ca.triu2symm(ca.triu(matrix))  # crba fills the upper triangle only
        return ca.SX(ca.cse(ca.densify(symmetric)))

    def _symbolic(self, model: pin.Model) -> Any:
        clean = model.copy()
        for index in range(model.njoints):
            clean.jointPlacements[index] = without_noise(model.jointPlacements[index])
        for index in range(model.nframes):
            clean.frames[index].placement = without_noise(model.frames[index].placement)
        return self._cpin.Model(clean)

    def _by_columns(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """The mass matrix as the torques of unit accelerations, without gravity."""
        weightless = model.copy()
        weightless.gravity = pin.Motion.Zero()
        symbolic = self._symbolic(weightless)
        data, still = symbolic.createData(), ca.SX.zeros(model.nv)
        columns = [
            ca.SX(self._cpin.rnea(symbolic, data, configuration(model, q), still, unit))
            for unit in ca.horzsplit(ca.SX.eye(model.nv))
        ]
        return ca.SX(ca.cse(ca.densify(ca.horzcat(*columns))))

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


def _numbered_depth_first(model: pin.Model) -> bool:
    """Whether every subtree's joints are numbered without gaps, which Pinocchio's crba relies on.

    Models from files are; a branch that was added to by hand after another may not be, and crba
    then leaves entries of the matrix out.
    """
    subtrees = [list(subtree) for subtree in model.subtrees]
    return all(subtree[-1] - subtree[0] == len(subtree) - 1 for subtree in subtrees[1:])


@lru_cache(maxsize=1)
def _pinocchio_casadi() -> ModuleType | str:
    """The module, or why it cannot be imported."""
    with warnings.catch_warnings():
        # Both of Pinocchio's modules register the same converter; Boost.Python says so once.
        warnings.filterwarnings("ignore", "to-Python converter", RuntimeWarning)
        try:
            return importlib.import_module("pinocchio.casadi")
        except ImportError as error:
            failure = error
    if isinstance(failure, ModuleNotFoundError) and failure.name == "pinocchio.casadi":
        return NOT_INSTALLED
    return f"it is there, but its import fails: {failure}"


def why_unavailable(name: str) -> str:
    """What keeps a back end from being used here; empty if nothing does."""
    if name == "built-in":
        return ""
    found = _pinocchio_casadi()
    return found if isinstance(found, str) else ""


def choose_backend(name: str | None = None) -> str:
    """The back end's name: the argument, the environment's, or the first that is available.

    A pinocchio.casadi that is there but cannot be imported is passed over with a RuntimeWarning.

    Raises:
        ValueError: the name is unknown, or that back end cannot be imported here.
    """
    name = name or os.environ.get(ENVIRONMENT_VARIABLE)
    if not name:
        missing = why_unavailable(BACKENDS[0])
        name = BACKENDS[1] if missing else BACKENDS[0]
        if missing not in ("", NOT_INSTALLED):
            # stacklevel: whoever made the Model
            warnings.warn(f"{BACKENDS[0]} is passed over: {missing}", RuntimeWarning, stacklevel=4)
    if name not in BACKENDS:
        raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, got {name!r}")
    if why_unavailable(name):
        raise ValueError(f"backend {name!r} cannot be imported here: {why_unavailable(name)}")
    return name


def rigid_body(backend: str) -> RigidBody:
    """The back end of that name, as `choose_backend` returned it."""
    if backend == "built-in":
        return built_in
    module = _pinocchio_casadi()
    assert not isinstance(module, str), module
    return _PinocchioCasadi(module)
