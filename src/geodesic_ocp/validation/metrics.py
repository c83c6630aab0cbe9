"""The metrics of known geodesics, from their descriptions in a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.model import Model


@dataclass(frozen=True)
class Sphere(Metric):
    """The unit sphere in colatitude t and longitude p [rad]: ds^2 = dt^2 + sin^2 t dp^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        """diag(1, sin^2 t), (2, 2)."""
        return ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))


@dataclass(frozen=True)
class HalfPlane(Metric):
    """The hyperbolic upper half-plane in (x, y): ds^2 = (dx^2 + dy^2) / y^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        """The identity divided by y^2, (2, 2)."""
        return type(q).eye(2) / q[1] ** 2


@dataclass(frozen=True)
class PolarPlane(Metric):
    """The Euclidean plane in radius r and angle p [rad]: ds^2 = dr^2 + r^2 dp^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        """diag(1, r^2), (2, 2)."""
        return ca.diag(ca.vertcat(1.0, q[0] ** 2))


@dataclass(frozen=True)
class SurfaceOfRevolution(Metric):
    """A surface of revolution in (u, p), p the angle about its axis [rad].

    ds^2 = e(u)^2 du^2 + r(u)^2 dp^2.

    Attributes:
        radius: r(u), distance from the axis [m].
        stretch: e(u), arc length of the profile per unit of u.
    """

    radius: Callable[[Any], Any]
    stretch: Callable[[Any], Any]

    dim = 2

    def matrix(self, q: Any) -> Any:
        """diag(e(u)^2, r(u)^2), (2, 2)."""
        return ca.diag(ca.vertcat(self.stretch(q[0]) ** 2, self.radius(q[0]) ** 2))


def cylinder(radius: float) -> SurfaceOfRevolution:
    """The cylinder of a radius [m]; u is the height [m]."""
    return SurfaceOfRevolution(lambda u: radius, lambda u: 1.0)


def cone(half_angle: float) -> SurfaceOfRevolution:
    """The cone whose sides are at half_angle [rad] to its axis; u is the distance to its apex."""
    return SurfaceOfRevolution(lambda u: u * ca.sin(half_angle), lambda u: 1.0)


def torus(major: float, minor: float) -> SurfaceOfRevolution:
    """The torus of radii `major` and `minor` [m]; u is the angle about the tube, 0 outside."""
    return SurfaceOfRevolution(lambda u: major + minor * ca.cos(u), lambda u: minor)


def catenoid(neck: float) -> SurfaceOfRevolution:
    """The catenoid r = neck cosh(z / neck) [m]; u is the height z [m]."""
    return SurfaceOfRevolution(lambda u: neck * ca.cosh(u / neck), lambda u: ca.cosh(u / neck))


def planar_arm(
    lengths: Sequence[float],
    masses: Sequence[float],
    centres: Sequence[float],
    inertias: Sequence[float],
    backend: str | None = None,
) -> Model:
    """Links that turn about parallel axes, one after the other; the hand, "tip", is at the end.

    Args:
        lengths: of the links [m].
        masses: of the links [kg].
        centres: of mass, from the joint along the link [m].
        inertias: about the centres of mass and the axis of turning [kg m^2].
        backend: of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: not as many figures of one sort as of the other, or they are not a body's.
    """
    if not len(lengths) == len(masses) == len(centres) == len(inertias) > 0:
        raise ValueError("lengths, masses, centres and inertias must have as many entries each")
    parts, parent, offset = ['<robot name="planar arm"><link name="base"/>'], "base", 0.0
    links = zip(lengths, masses, centres, inertias, strict=True)
    for index, (length, mass, centre, inertia) in enumerate(links, start=1):
        # Only the moment about z counts in the plane; the others make a physical body of it.
        parts.append(
            f'<link name="link{index}"><inertial><origin xyz="{centre!r} 0 0"/>'
            f'<mass value="{mass!r}"/><inertia ixx="{inertia / 2!r}" iyy="{inertia / 2!r}" '
            f'izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{index}" type="continuous"><parent link="{parent}"/>'
            f'<child link="link{index}"/><origin xyz="{offset!r} 0 0"/><axis xyz="0 0 1"/></joint>'
        )
        parent, offset = f"link{index}", length
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="{parent}"/>'
        f'<child link="tip"/><origin xyz="{offset!r} 0 0"/></joint></robot>'
    )
    return load_model("".join(parts), hand="tip", backend=backend)


_PROFILES: dict[str, tuple[tuple[str, ...], Callable[..., SurfaceOfRevolution]]] = {
    "cylinder": (("radius",), cylinder),
    "cone": (("half_angle",), cone),
    "torus": (("major", "minor"), torus),
    "catenoid": (("neck",), catenoid),
}
_WITHOUT_FIELDS: dict[str, Callable[[], Metric]] = {
    "sphere": Sphere,
    "half-plane": HalfPlane,
    "polar plane": PolarPlane,
}
_LINKS = ("lengths", "masses", "centres", "inertias")
_FIELDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {  # those it needs, those it may have
    "euclidean": (("dim",), ()),
    **dict.fromkeys(_WITHOUT_FIELDS, ((), ())),
    "surface of revolution": (("profile",), ()),
    "planar arm": (_LINKS, ()),
    "human arm": (("side", "height", "mass", "table"), ("sex",)),
    "urdf": (("file", "hand"), ("base", "joints")),
}
_OF_MODELS = ("planar arm", "human arm", "urdf")


def has_model(description: Mapping[str, Any]) -> bool:
    """Whether the metric is that of a model, so that it depends on the back end."""
    return description.get("kind") in _OF_MODELS


def check_description(description: object) -> dict[str, Any]:
    """The description of a metric, if its kind is known and its fields are those of the kind.

    Raises:
        ValueError: names what is missing, not known, or not of the kind.
    """
    if not isinstance(description, Mapping):
        raise ValueError(f"metric must be an object with a kind, got {description!r}")
    fields = dict(description)
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in _FIELDS:
        raise ValueError(f"metric: kind must be one of {_listed(_FIELDS)}, got {kind!r}")
    needed, possible = _FIELDS[kind]
    if kind == "surface of revolution":
        profile = fields.get("profile")
        if not isinstance(profile, str) or profile not in _PROFILES:
            raise ValueError(
                f"metric: profile must be one of {_listed(_PROFILES)}, got {profile!r}"
            )
        needed += _PROFILES[profile][0]
    for name in needed:
        if name not in fields:
            raise ValueError(f"metric: {kind!r} needs {name!r}")
    for name in fields:
        if name not in ("kind", *needed, *possible):
            raise ValueError(
                f"metric: {kind!r} has no {name!r}, but {_listed((*needed, *possible))}"
            )
    return fields


def metric_of(description: Mapping[str, Any], backend: str | None = None) -> Metric:
    """The metric of a description as in the table of known geodesics.

    Args:
        description: its kind and the kind's fields; lengths in m, masses in kg.
        backend: of the symbolic rigid-body algorithms, for metrics of models; see `Model`.

    Raises:
        ValueError: an unknown kind, or fields that are not the kind's.
    """
    fields = check_description(description)
    kind = fields.pop("kind")
    if kind in _WITHOUT_FIELDS:
        return _WITHOUT_FIELDS[kind]()
    if kind == "euclidean":
        return Euclidean(fields["dim"])
    if kind == "surface of revolution":
        names, profile = _PROFILES[fields["profile"]]
        return profile(**{name: as_positive(name, fields[name]) for name in names})
    if kind == "planar arm":
        figures = {name: _numbers(name, fields[name]) for name in _LINKS}
        return KineticEnergy(planar_arm(**figures, backend=backend))
    if kind == "human arm":
        return KineticEnergy(human_arm(**fields, backend=backend))
    return KineticEnergy(load_model(fields.pop("file"), **fields, backend=backend))


def _numbers(name: str, values: object) -> tuple[float, ...]:
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise ValueError(f"{name} must be a list of numbers, got {values!r}")
    return tuple(as_number(f"{name}[{index}]", value) for index, value in enumerate(values))


def _listed(names: Sequence[str] | Mapping[str, object]) -> str:
    return ", ".join(repr(name) for name in names)
