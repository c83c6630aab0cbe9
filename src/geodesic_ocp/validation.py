"""Known geodesics: metrics from their descriptions in a table, and checks against them.

The project's own is made by tools/known_geodesics.py, which shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import exp, sample_geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.dynamics import BACKENDS, choose_backend, why_unavailable
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import parse_json
from geodesic_ocp.tables import new_table, text

if TYPE_CHECKING:
    from pandas import DataFrame


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
        """Return the identity divided by y^2, (2, 2)."""
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
    """Return the cylinder of a radius [m]; u is the height [m]."""
    return SurfaceOfRevolution(lambda u: radius, lambda u: 1.0)


def cone(half_angle: float) -> SurfaceOfRevolution:
    """Return the cone whose sides are at half_angle [rad] to its axis; u is the distance to its
    apex.
    """
    return SurfaceOfRevolution(lambda u: u * ca.sin(half_angle), lambda u: 1.0)


def torus(major: float, minor: float) -> SurfaceOfRevolution:
    """Get the torus of radii `major` and `minor` [m]; u is the angle about the tube, 0 outside."""
    return SurfaceOfRevolution(lambda u: major + minor * ca.cos(u), lambda u: minor)


def catenoid(neck: float) -> SurfaceOfRevolution:
    """Return the catenoid r = neck cosh(z / neck) [m]; u is the height z [m]."""
    return SurfaceOfRevolution(lambda u: neck * ca.cosh(u / neck), lambda u: ca.cosh(u / neck))


def planar_arm(
    lengths: Sequence[float],
    masses: Sequence[float],
    centres: Sequence[float],
    inertias: Sequence[float],
    backend: str | None = None,
) -> Model:
    """Return links that turn about parallel axes, one after the other; the hand, "tip", is at the
    end.

    Args:
        lengths: lengths of the links [m].
        masses: masses of the links [kg].
        centres: centres of mass, from the joint along the link [m].
        inertias: about the centres of mass and the axis of turning [kg m^2].
        backend: backend of the symbolic rigid-body algorithms, see `Model`.

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
    """Return whether the metric is that of a model, so that it depends on the back end."""
    return description.get("kind") in _OF_MODELS


def check_description(description: object) -> dict[str, Any]:
    """Return the description of a metric, if its kind is known and its fields are those of the
    kind.

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
    """Return the metric of a description as in the table of known geodesics.

    Args:
        description: its kind and the kind's fields; lengths in m, masses in kg.
        backend: backend of the symbolic rigid-body algorithms, for metrics of models; see `Model`.

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


BUNDLED = Path(__file__).resolve().parent / "data" / "known_geodesics.json"
FORMAT, VERSION = "geodesic_ocp known geodesics", 1
_NEEDED = ("name", "metric", "q0", "v0", "q1", "length", "log", "tolerances", "source")
_POSSIBLE = ("points",)


@dataclass(frozen=True)
class KnownGeodesic:
    """A geodesic q(s), s in [0, 1], that is known from elsewhere.

    Attributes:
        name: name of the entry.
        metric: description of the metric, see `metric_of`.
        q0: where it starts, (n,) [rad or m].
        v0: q'(0), (n,).
        q1: Exp_q0(v0), (n,).
        length: |v0| at q0.
        log: whether the logarithm that starts from the straight line is to find v0.
        tolerances: "exp", of positions and the length, and "log", of the initial velocity.
        source: where the values come from.
        points: s and q(s) on the way.
    """

    name: str
    metric: Mapping[str, Any]
    q0: tuple[float, ...]
    v0: tuple[float, ...]
    q1: tuple[float, ...]
    length: float
    log: bool
    tolerances: Mapping[str, float]
    source: str
    points: tuple[tuple[float, tuple[float, ...]], ...] = ()


def read_known_geodesics(file: str | PathLike[str] | None = None) -> tuple[KnownGeodesic, ...]:
    """Return the known geodesics of a table in JSON, by default those that come with the package.

    Files that a metric is read from are meant in the table's folder.

    Raises:
        ValueError: the file cannot be read or an entry is not as it should be; names the file, the
            entry and the field.
    """
    path = BUNDLED if file is None else Path(file)
    try:
        record = parse_json(path.read_text(encoding="utf-8"))
    except OSError as failure:
        raise ValueError(f"{path}: cannot be read: {failure}") from None
    except (ValueError, RecursionError) as failure:
        raise ValueError(f"{path}: is not JSON: {failure}") from None
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise ValueError(f'{path}: "format" must be {FORMAT!r}')
    if record.get("version") != VERSION:
        raise ValueError(f'{path}: "version" must be {VERSION}, is {record.get("version")!r}')
    entries = record.get("entries")
    if not isinstance(entries, list) or not entries:
        raise ValueError(f'{path}: "entries" must be a list of at least one known geodesic')
    known: list[KnownGeodesic] = []
    for number, fields in enumerate(entries, start=1):
        named = isinstance(fields, dict) and isinstance(fields.get("name"), str)
        what = f"entry {number} ({fields['name']!r})" if named else f"entry {number}"
        try:
            entry = _entry(fields, path.parent)
        except ValueError as failure:
            raise ValueError(f"{path}: {what}: {failure}") from None
        if entry.name in (other.name for other in known):
            raise ValueError(f"{path}: {what}: name is that of an entry before")
        known.append(entry)
    return tuple(known)


def _entry(fields: object, folder: Path) -> KnownGeodesic:
    if not isinstance(fields, dict):
        raise ValueError(f"must be an object with the fields {', '.join(_NEEDED)}")
    for name in _NEEDED:
        if name not in fields:
            raise ValueError(f"{name} is missing")
    for name in fields:
        if name not in (*_NEEDED, *_POSSIBLE):
            raise ValueError(f"{name} is not a field; there are {', '.join(_NEEDED + _POSSIBLE)}")
    for name in ("name", "source"):
        if not isinstance(fields[name], str) or not fields[name].strip():
            raise ValueError(f"{name} must be a text, got {fields[name]!r}")
    if not isinstance(fields["log"], bool):
        raise ValueError(f"log must be true or false, got {fields['log']!r}")
    metric = check_description(fields["metric"])
    if "file" in metric:
        if not isinstance(metric["file"], str):
            raise ValueError(f"metric: file must be a text, got {metric['file']!r}")
        metric["file"] = str(folder / metric["file"])
    q0 = _vector("q0", fields["q0"])
    return KnownGeodesic(
        fields["name"],
        metric,
        q0,
        _vector("v0", fields["v0"], len(q0)),
        _vector("q1", fields["q1"], len(q0)),
        _number("length", fields["length"], as_positive),
        fields["log"],
        _tolerances(fields["tolerances"], fields["log"]),
        fields["source"],
        _points(fields.get("points", []), len(q0)),
    )


def _number(name: str, value: object, convert: Callable[[str, Any], float] = as_number) -> float:
    # JSON tells numbers from texts and from true, which float() would take as well.
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name} must be a number, got {value!r}")
    return convert(name, value)


def _vector(name: str, values: object, size: int | None = None) -> tuple[float, ...]:
    if not isinstance(values, list) or not values:
        raise ValueError(f"{name} must be a list of numbers, got {values!r}")
    if size is not None and len(values) != size:
        raise ValueError(f"{name} must have {size} numbers as q0 has, got {len(values)}")
    return tuple(_number(f"{name}[{index}]", value) for index, value in enumerate(values))


def _tolerances(given: object, log: bool) -> dict[str, float]:
    if not isinstance(given, dict) or not given.keys() <= {"exp", "log"}:
        raise ValueError(f'tolerances must be an object with "exp" and "log", got {given!r}')
    for name in ("exp", "log") if log else ("exp",):
        if name not in given:
            raise ValueError(f"tolerances: {name!r} is missing")
    return {
        name: _number(f"tolerances: {name}", value, as_positive) for name, value in given.items()
    }


def _points(given: object, size: int) -> tuple[tuple[float, tuple[float, ...]], ...]:
    if not isinstance(given, list):
        raise ValueError(f'points must be a list of objects with "s" and "q", got {given!r}')
    points: list[tuple[float, tuple[float, ...]]] = []
    for index, point in enumerate(given):
        name = f"points[{index}]"
        if not isinstance(point, dict) or point.keys() != {"s", "q"}:
            raise ValueError(f'{name} must be an object with "s" and "q", got {point!r}')
        s = _number(f"{name}: s", point["s"])
        if not (points[-1][0] if points else 0.0) < s < 1.0:
            raise ValueError(f"{name}: s must be between 0 and 1 and above those before, got {s}")
        points.append((s, _vector(f"{name}: q", point["q"], size)))
    return tuple(points)


# A failure of any of these is the verdict on an entry, not the end of the check; CasADi's own
# failures are RuntimeErrors.
_FAILURES = (GeodesicOcpError, ValueError, RuntimeError)


@dataclass(frozen=True)
class Check:
    """One quantity of a known geodesic, as computed by the package.

    Attributes:
        name: name of the known geodesic.
        quantity: "exp", "length", "path" or "log"; "metric" where there is not even that.
        backend: backend of the symbolic rigid-body algorithms; "-" where the metric needs none.
        error: largest difference of any coordinate; inf where there is no result.
        tolerance: what is allowed.
        message: why there is no result, otherwise empty.
    """

    name: str
    quantity: str
    backend: str
    error: float
    tolerance: float
    message: str = ""

    @property
    def passed(self) -> bool:
        """True if the error is within the tolerance; not a number is not."""
        return self.error <= self.tolerance


def check_geodesic(known: KnownGeodesic, backend: str | None = None) -> list[Check]:
    """Return Exponential map, length, points on the way and logarithm against one known geodesic.

    `exp` is called with the entry's tolerance for it as its own. What raises is reported as failed.

    Args:
        known: the entry.
        backend: backend of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: the back end is unknown or cannot be imported here.
    """
    used = choose_backend(backend) if has_model(known.metric) else None
    allowed = known.tolerances["exp"]
    try:
        metric = metric_of(known.metric, used)
        errors = _errors(known, metric)
    except _FAILURES as failure:
        return [Check(known.name, "metric", used or "-", np.inf, allowed, str(failure))]
    checks = []
    for quantity, error in errors.items():
        tolerance = known.tolerances["log"] if quantity == "log" else allowed
        try:
            value, message = error(), ""
        except _FAILURES as failure:
            value, message = np.inf, str(failure)
        checks.append(Check(known.name, quantity, used or "-", value, tolerance, message))
    return checks


def _errors(known: KnownGeodesic, metric: Metric) -> dict[str, Callable[[], float]]:
    """For each quantity, how to find its error."""
    tolerance = known.tolerances["exp"]

    def of_exp() -> float:
        return _apart(exp(metric, known.q0, known.v0, tolerance=tolerance), known.q1)

    def of_length() -> float:
        return _apart(metric.norm(known.q0, known.v0), known.length)

    def on_the_way() -> float:
        times = [0.0, *(s for s, _ in known.points)]
        found, _ = sample_geodesic(metric, known.q0, known.v0, times, tolerance=tolerance)
        return _apart(found[1:], [q for _, q in known.points])

    def of_log() -> float:
        return _apart(log(metric, known.q0, known.q1), known.v0)

    errors = {"exp": of_exp, "length": of_length}
    if known.points:
        errors["path"] = on_the_way
    if known.log:
        errors["log"] = of_log
    return errors


def _apart(found: ArrayLike, expected: ArrayLike) -> float:
    return float(np.abs(np.asarray(found) - np.asarray(expected)).max())


def check_known_geodesics(
    known: Iterable[KnownGeodesic], backends: Sequence[str]
) -> tuple[Check, ...]:
    """Return all checks of known geodesics; those of a model's metric once for every back end."""
    return tuple(
        check
        for entry in known
        for backend in (backends if has_model(entry.metric) else backends[:1])
        for check in check_geodesic(entry, backend)
    )


def table_of(checks: Iterable[Check]) -> DataFrame:
    """Return checks as a table."""
    return new_table(
        ("name", "quantity", "back end", "error", "tolerance", "verdict"),
        tuple(
            (
                check.name,
                check.quantity,
                check.backend,
                check.error,
                check.tolerance,
                "passed" if check.passed else "FAILED",
            )
            for check in checks
        ),
    )


def run_check(file: str | PathLike[str] | None = None, backend: str | None = None) -> bool:
    """Check the known geodesics, print a table of the results, and say whether all passed.

    Args:
        file: a table of the user's own, checked in addition to the one of the package.
        backend: the only one to check; None: all that can be imported here.

    Raises:
        ValueError: the file is malformed, or the back end is unknown or cannot be imported here.
    """
    known = read_known_geodesics()
    if file is not None:
        known += read_known_geodesics(file)
    backends = [name for name in BACKENDS if not why_unavailable(name)]
    if backend is not None:
        backends = [choose_backend(backend)]
    checks = check_known_geodesics(known, backends)
    print(text(table_of(checks)))
    print()
    failed = [check for check in checks if not check.passed]
    for check in failed:
        if check.message:
            print(f"{check.name}, {check.quantity}, {check.backend}: {check.message}")
    for name in BACKENDS:
        if backend is None and name not in backends:
            print(f"Not checked, as {name} cannot be imported here: {why_unavailable(name)}")
    print(_summary(len(known), checks, backends))
    return not failed


def _summary(geodesics: int, checks: Sequence[Check], backends: Sequence[str]) -> str:
    failed = [check for check in checks if not check.passed]
    subject = f"{geodesics} known geodesics with {' and '.join(backends)}"
    if failed:
        names = dict.fromkeys(repr(check.name) for check in failed)
        return f"{subject}: {len(failed)} of {len(checks)} checks FAILED, of {', '.join(names)}."
    worst = max(checks, key=lambda check: check.error / check.tolerance)
    return (
        f"{subject}: all {len(checks)} checks passed; nearest to its tolerance is {worst.quantity} "
        f"of {worst.name!r}, {worst.error:.1e} of {worst.tolerance:.0e}."
    )
