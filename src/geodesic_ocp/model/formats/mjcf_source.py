"""MuJoCo's compiler of MJCF, where it is installed, and what it compiles."""

from __future__ import annotations

import importlib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array


def installed_mujoco() -> Any:
    """Return the module mujoco; None if it is not installed."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        return None


class Compiled(NamedTuple):
    """MuJoCo's compiled model (mjModel), and its warnings."""

    native: Any
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class MjcfSource:
    """An MJCF in a file or a text.

    Attributes:
        text: text of the file, without a declaration.
        name: name of the file, for messages.
        folder: folder of the file; None for a text.
    """

    text: str
    name: str
    folder: Path | None

    def compiled(self, *, with_meshes: bool) -> Compiled:
        """Return MuJoCo's compiled model, in which no body is merged into another.

        Args:
            with_meshes: whether all geoms are needed; otherwise meshes are left out, and their
                files not read, where the body's inertia is stated.

        Raises:
            ValueError: MuJoCo refuses the model; in its own words.
        """
        mujoco = installed_mujoco()
        self._check_encoding()
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            try:
                if self.folder is None:
                    spec = mujoco.MjSpec.from_string(self.text)
                else:
                    spec = mujoco.MjSpec.from_file(str(self.folder / self.name))
                spec.compiler.fusestatic = False
                if not with_meshes:
                    _leave_out_meshes(spec, mujoco)
                native = spec.compile()
            except (ValueError, mujoco.FatalError) as error:
                reason = " ".join(str(error).split())
                what = "is not an MJCF that MuJoCo can read"
                raise ValueError(f"{self.name} {what}: {reason}") from None
        messages = dict.fromkeys(" ".join(str(note.message).split()) for note in notes)
        return Compiled(native, tuple(f"{self.name}: {message}" for message in messages))

    def _check_encoding(self) -> None:
        if self.folder is None:
            return
        try:
            (self.folder / self.name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            advice = "the encoding that MuJoCo reads: save it in UTF-8"
            raise ValueError(f"{self.name} is not in UTF-8, {advice}") from None


def _leave_out_meshes(spec: Any, mujoco: Any) -> None:
    """Delete what does not change the dynamics and refers to files: meshes, height fields, looks.

    A mesh stays where it gives its body the inertia.
    """
    for kind in ("pairs", "sensors", "keys", "tuples", "skins"):
        for element in list(getattr(spec, kind)):
            spec.delete(element)
    for element in (*spec.geoms, *spec.sites, *spec.tendons, *spec.flexes):
        element.material = ""
    for element in (*spec.materials, *spec.textures):
        spec.delete(element)
    inferred = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    for geom in list(spec.geoms):
        body = geom.parent
        is_stated = body.name == "world" or (body.explicitinertial and not inferred)
        if is_stated and (geom.meshname or geom.hfieldname):
            spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms} | {geom.hfieldname for geom in spec.geoms}
    for asset in (*spec.meshes, *spec.hfields):
        if asset.name not in used:
            spec.delete(asset)


def placement(position: Array, quaternion: Array) -> pin.SE3:
    """Return a placement from a position (3,) [m] and a quaternion (w, x, y, z)."""
    rotation = pin.Quaternion(*np.array(quaternion).tolist()).matrix()
    return pin.SE3(rotation, np.array(position))


def name_of(element: Any) -> str:
    """Return the name of a body or joint of MuJoCo; its kind and number if it has none."""
    kind = "joint" if "Joint" in type(element).__name__ else "body"
    return str(element.name) or f"{kind} {element.id}"
