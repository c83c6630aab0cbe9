"""The compiled interface: where it is kept, and its functions."""

from __future__ import annotations

import ctypes
import sysconfig
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled import cache
from geodesic_ocp.model.joints import motion_subspace

SOURCE = Path(__file__).with_name("pinocchio_casadi.cpp")
COMMAND = "python -m geodesic_ocp.model.casadi_interface.build"
_ERROR = b"error: "


@dataclass(frozen=True)
class PinocchioLibrary:
    """Pinocchio's algorithms for models of joints with one coordinate each, as expressions.

    Attributes:
        file: the shared library.
    """

    file: Path

    def mass_matrix(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Return joint-space mass matrix (nv, nv)."""
        return self._function("mass_matrix", model)(q)

    def kinetic_energy(self, model: pin.Model, q: ca.SX, v: ca.SX) -> ca.SX:
        """Return kinetic energy [J]."""
        return self._function("kinetic_energy", model)(q, v)

    def potential_energy(self, model: pin.Model, q: ca.SX) -> ca.SX:
        """Return potential energy [J] in the model's gravity."""
        return self._function("potential_energy", model)(q)

    def inverse_dynamics(self, model: pin.Model, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
        """Return joint forces (nv, 1) in the model's gravity."""
        return self._function("inverse_dynamics", model)(q, v, a)

    def frame_pose(self, model: pin.Model, q: ca.SX, frame: int) -> tuple[ca.SX, ca.SX]:
        """Return rotation (3, 3) and position (3, 1) [m] of a frame in the base frame."""
        rotation, position = self._function("frame_pose", model, frame)(q)
        return rotation, position

    def _function(self, quantity: str, model: pin.Model, frame: int = 0) -> ca.Function:
        rows = [_joint_row(model, index) for index in range(1, model.njoints)]
        joints = np.array(rows, dtype=float)
        at = model.frames[frame]
        text = _call(
            _loaded(self.file),
            quantity.encode(),
            len(rows),
            joints,
            np.array([at.parentJoint, *_placement(at.placement)], dtype=float),
            np.array(model.gravity.linear, dtype=float),
        )
        if text.startswith(_ERROR):
            raise RuntimeError(f"{self.file}: {text.removeprefix(_ERROR).decode()}")
        return ca.Function.deserialize(text.decode())


def _joint_row(model: pin.Model, index: int) -> list[float]:
    """Return the numbers of a joint, in the order of `JointRow` in the source."""
    linear, angular = np.split(motion_subspace(model, index), 2)
    turns = bool(np.any(angular))
    axis = angular if turns else linear
    pitch = linear @ angular
    body = model.inertias[index]
    place = _placement(model.jointPlacements[index])
    inertia = (body.mass, *body.lever, *body.inertia.ravel())
    return [model.parents[index], turns, *axis, pitch, *place, *inertia]


def _placement(placement: pin.SE3) -> Array:
    return np.concatenate([placement.rotation.ravel(), placement.translation])


def _call(library: Any, quantity: bytes, count: int, *arrays: Array) -> bytes:
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
    address = library.pinocchio_casadi(quantity, ctypes.c_long(count), *pointers)
    try:
        return ctypes.string_at(address)
    finally:
        library.pinocchio_casadi_release(address)


@lru_cache
def _loaded(file: Path) -> Any:
    """Load the library; its calls hold Python's lock, as CasADi's counts of references need."""
    library = ctypes.PyDLL(str(file))
    library.pinocchio_casadi.restype = ctypes.c_void_p
    library.pinocchio_casadi_release.argtypes = [ctypes.c_void_p]
    return library


def folder() -> Path:
    """Return the folder of built interfaces, beside that of compiled functions."""
    return cache.cache_folder().parent / "pinocchio_casadi"


def prefix() -> str:
    """Return what the names of libraries for these versions and this platform begin with."""
    source = sha256(SOURCE.read_bytes()).hexdigest()[:8]
    platform = sysconfig.get_platform()
    return f"pin-{pin.__version__}_casadi-{ca.CasadiMeta.version()}_{platform}_{source}_"


def find_library() -> PinocchioLibrary | str:
    """Return the library for the installed versions, or why it cannot be used.

    The reason is empty where none has been built.
    """
    where = folder()
    files = sorted(where.glob(f"{prefix()}*.so"), key=lambda file: file.stat().st_mtime)
    if not files:
        built = sorted(file.name for file in where.glob("*.so"))
        wanted = f"it was built for other versions ({', '.join(built)}), not for {prefix()[:-1]}"
        return f"{wanted}: run `{COMMAND}` again" if built else ""
    if reason := cache.why_unused(where):
        return f"{files[-1]} is not used: {reason}"
    try:
        _loaded(files[-1].resolve())
    except OSError as error:
        return f"{files[-1]} cannot be loaded: {error}"
    return PinocchioLibrary(files[-1].resolve())
