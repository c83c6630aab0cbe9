"""Known geodesics and cubics: metrics from their descriptions in a table, and checks against them.

The project's own is made by tools/known_geodesics.py, which shares no code with the package.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar

import casadi as ca
import numpy as np
from msgspec import Meta, Struct, convert
from msgspec.structs import replace
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.logarithm.cubics import cubic
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.logarithm.riemannian_spline import RiemannianSpline
from geodesic_ocp.manifold.exp import exp, sample_geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import Euclidean, KineticEnergy
from geodesic_ocp.model.dynamics import BACKENDS, choose_backend, why_unavailable
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import decoding, read_record
from geodesic_ocp.tables import new_table, text

if TYPE_CHECKING:
    from pandas import DataFrame


Pair: TypeAlias = tuple[ArrayLike, ArrayLike]  # found and expected


@dataclass(frozen=True)
class HalfPlane(Metric):
    """The hyperbolic upper half-plane in (x, y): ds^2 = (dx^2 + dy^2) / y^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        """Return the identity divided by y^2, (2, 2)."""
        return type(q).eye(2) / q[1] ** 2


@dataclass(frozen=True)
class SurfaceOfRevolution(Metric):
    """A surface of revolution in (u, p), p the angle about its axis [rad].

    ds^2 = e(u)^2 du^2 + r(u)^2 dp^2.

    Attributes:
        radius: r(u), distance from the axis [m].
        stretch: e(u), arc length of the profile per unit of u.
    """

    radius: Callable[[Any], Any]
    stretch: Callable[[Any], Any] = lambda u: 1.0

    dim = 2

    def matrix(self, q: Any) -> Any:
        """Return diag(e(u)^2, r(u)^2), (2, 2)."""
        return ca.diag(ca.vertcat(self.stretch(q[0]) ** 2, self.radius(q[0]) ** 2))


@dataclass(frozen=True)
class Rotations(Metric):
    """The rotations in angles about x, y and z, R = R_x R_y R_z: ds^2 = |omega|^2 dt^2, with the
    angular velocity omega.
    """

    dim = 3

    def matrix(self, q: Any) -> Any:
        """Return J' J, (3, 3), where J takes rates of the angles to the angular velocity."""
        sine = ca.sin(q[1])
        return ca.blockcat([[1, 0, sine], [0, 1, 0], [sine, 0, 1]])


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
    parts = ['<robot name="planar arm"><link name="base"/>']
    parent = "base"
    offset = 0.0
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
        parent = f"link{index}"
        offset = length
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="{parent}"/>'
        f'<child link="tip"/><origin xyz="{offset!r} 0 0"/></joint></robot>'
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # point masses and equal links are meant
        return load_model("".join(parts), hand="tip", backend=backend)


# Names of the fields, and the surface of their values [m, rad]. In this order, u is the height, the
# distance to the apex, the angle about the tube, 0 outside, and the height.
_PROFILES: dict[str, tuple[tuple[str, ...], Callable[..., SurfaceOfRevolution]]] = {
    "cylinder": (("radius",), lambda radius: SurfaceOfRevolution(lambda u: radius)),
    "cone": (("half_angle",), lambda angle: SurfaceOfRevolution(lambda u: u * ca.sin(angle))),
    "torus": (
        ("major", "minor"),
        lambda major, minor: SurfaceOfRevolution(
            lambda u: major + minor * ca.cos(u), lambda u: minor
        ),
    ),
    "catenoid": (
        ("neck",),
        lambda neck: SurfaceOfRevolution(
            lambda u: neck * ca.cosh(u / neck), lambda u: ca.cosh(u / neck)
        ),
    ),
}
_WITHOUT_FIELDS: dict[str, Metric] = {
    "sphere": SurfaceOfRevolution(ca.sin),
    "half-plane": HalfPlane(),
    "polar plane": SurfaceOfRevolution(lambda u: u),
    "rotations": Rotations(),
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


def has_model(description: Mapping[str, Any]) -> bool:
    """Return whether the metric is that of a model, so that it depends on the back end."""
    return description.get("kind") in ("planar arm", "human arm", "urdf")


def check_description(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return the description of a metric, if its kind is known and its fields are those of the
    kind.

    Raises:
        ValueError: names what is missing, not known, or not of the kind.
    """
    given = dict(description)
    kind = _choice(given, "kind", _FIELDS)
    needed, possible = _FIELDS[kind]
    if kind == "surface of revolution":
        needed += _PROFILES[_choice(given, "profile", _PROFILES)][0]
    for name in needed:
        if name not in given:
            raise ValueError(f"metric: {kind!r} needs {name!r}")
    for name in given:
        if name not in ("kind", *needed, *possible):
            raise ValueError(
                f"metric: {kind!r} has no {name!r}, but {_listed((*needed, *possible))}"
            )
    if not isinstance(given.get("file", ""), str):
        raise ValueError(f"metric: file must be a text, got {given['file']!r}")
    return given


def _choice(given: Mapping[str, Any], name: str, known: Mapping[str, object]) -> str:
    chosen = given.get(name)
    if not isinstance(chosen, str) or chosen not in known:
        raise ValueError(f"metric: {name} must be one of {_listed(known)}, got {chosen!r}")
    return chosen


def metric_of(description: Mapping[str, Any], backend: str | None = None) -> Metric:
    """Return the metric of a description as in the table of known geodesics.

    Args:
        description: its kind and the kind's fields; lengths in m, masses in kg.
        backend: backend of the symbolic rigid-body algorithms, for metrics of models; see `Model`.

    Raises:
        ValueError: an unknown kind, or fields that are not the kind's.
    """
    given = check_description(description)
    kind = given.pop("kind")
    if kind in _WITHOUT_FIELDS:
        return _WITHOUT_FIELDS[kind]
    if kind == "euclidean":
        return Euclidean(given["dim"])
    if kind == "surface of revolution":
        names, profile = _PROFILES[given["profile"]]
        return profile(*(as_positive(name, given[name]) for name in names))
    if kind == "planar arm":
        figures = {name: _numbers(name, given[name]) for name in _LINKS}
        return KineticEnergy(planar_arm(**figures, backend=backend))
    if kind == "human arm":
        return KineticEnergy(human_arm(**given, backend=backend))
    return KineticEnergy(load_model(given.pop("file"), **given, backend=backend))


def _numbers(name: str, values: object) -> tuple[float, ...]:
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise ValueError(f"{name} must be a list of numbers, got {values!r}")
    return tuple(as_number(f"{name}[{index}]", value) for index, value in enumerate(values))


def _listed(names: Sequence[str] | Mapping[str, object]) -> str:
    return ", ".join(repr(name) for name in names)


BUNDLED = Path(__file__).resolve().parent / "data" / "known_geodesics.json"
FORMAT = "geodesic_ocp known geodesics"
VERSION = 1


Positive: TypeAlias = Annotated[float, Meta(gt=0.0)]
Text: TypeAlias = Annotated[str, Meta(pattern=r"\S")]
Vector: TypeAlias = Annotated[tuple[float, ...], Meta(min_length=1)]


class Point(Struct, frozen=True, forbid_unknown_fields=True):
    """A point q (n,) on the way, at s in (0, 1)."""

    s: Annotated[float, Meta(gt=0.0, lt=1.0)]
    q: Vector


class KnownGeodesic(Struct, frozen=True, forbid_unknown_fields=True):
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
        points: in the order of s.
    """

    name: Text
    metric: dict[str, Any]
    q0: Vector
    v0: Vector
    q1: Vector
    length: Positive
    log: bool
    tolerances: dict[Literal["exp", "log"], Positive]
    source: Text
    points: tuple[Point, ...] = ()

    def __post_init__(self) -> None:
        _check_fit(self, v0=self.v0, q1=self.q1)
        for name in ("exp", "log") if self.log else ("exp",):
            if name not in self.tolerances:
                raise ValueError(f"tolerances: {name!r} is missing")


class KnownCubic(Struct, frozen=True, forbid_unknown_fields=True):
    """A Riemannian cubic q(t), t in [0, duration], or a cubic in tension, that is known from
    elsewhere.

    Attributes:
        name: name of the entry.
        metric: description of the metric, see `metric_of`.
        q0, q1: where it starts and ends, (n,) [rad or m].
        v0, v1: velocities there (n,) [per s].
        duration: of the motion [s].
        tension: zero for Riemannian cubics [1/s].
        action: int (|D_t q'|^2 + tension^2 |q'|^2) / 2 dt.
        tolerance: of positions, and of the action relative to it.
        source: where the values come from.
        points: in the order of s = t / duration.
    """

    name: Text
    metric: dict[str, Any]
    q0: Vector
    v0: Vector
    q1: Vector
    v1: Vector
    duration: Positive
    tension: Annotated[float, Meta(ge=0.0)]
    action: Positive
    tolerance: Positive
    source: Text
    points: tuple[Point, ...]

    def __post_init__(self) -> None:
        _check_fit(self, v0=self.v0, q1=self.q1, v1=self.v1)


Known = TypeVar("Known", KnownGeodesic, KnownCubic)


def _check_fit(known: KnownGeodesic | KnownCubic, **vectors: tuple[float, ...]) -> None:
    """Raise ValueError if the metric, the vectors or the points do not fit q0 and each other."""
    check_description(known.metric)
    vectors |= {f"points[{index}]: q": point.q for index, point in enumerate(known.points)}
    for name, numbers in vectors.items():
        if len(numbers) != len(known.q0):
            raise ValueError(
                f"{name} must have {len(known.q0)} numbers as q0 has, got {len(numbers)}"
            )
    if np.any(np.diff([point.s for point in known.points]) <= 0.0):
        raise ValueError("points: every s must be above the one before")


def read_known_geodesics(file: str | PathLike[str] | None = None) -> tuple[KnownGeodesic, ...]:
    """Return the known geodesics of a table in JSON, by default those that come with the package.

    Files that a metric is read from are meant in the table's folder.

    Raises:
        ValueError: the file cannot be read or an entry is not as it should be; names the file, the
            entry and the field.
    """
    return _read(file, "entries", KnownGeodesic)


def read_known_cubics(file: str | PathLike[str] | None = None) -> tuple[KnownCubic, ...]:
    """Return the known cubics of a table, as `read_known_geodesics`."""
    return _read(file, "cubics", KnownCubic)


def _read(file: str | PathLike[str] | None, name: str, kind: type[Known]) -> tuple[Known, ...]:
    path = BUNDLED if file is None else Path(file)
    record = read_record(path, FORMAT, VERSION, "known geodesics")
    lists = [record.get(each, []) for each in ("entries", "cubics")]
    if not all(isinstance(each, list) for each in lists) or not any(lists):
        raise ValueError(
            f'{path}: "entries" must be a list of known geodesics, "cubics" one of known cubics, '
            "and at least one of them must have one"
        )
    known: dict[str, Known] = {}
    for number, given in enumerate(record.get(name, []), start=1):
        named = isinstance(given, dict) and isinstance(given.get("name"), str)
        what = "cubic" if name == "cubics" else "entry"
        what += f" {number} ({given['name']!r})" if named else f" {number}"
        with decoding(f"{path}: {what}"):
            entry = convert(given, kind)
            if entry.name in known:
                raise ValueError("name is that of an entry before")
            if "file" in entry.metric:
                place = str(path.parent / entry.metric["file"])
                entry = replace(entry, metric={**entry.metric, "file": place})
            known[entry.name] = entry
    return tuple(known.values())


# A failure of any of these is the verdict on an entry, not the end of the check; CasADi's own
# failures are RuntimeErrors.
_FAILURES = (GeodesicOcpError, ValueError, RuntimeError)


@dataclass(frozen=True)
class Check:
    """One quantity of a known geodesic or cubic, as computed by the package.

    Attributes:
        name: name of the known geodesic or cubic.
        quantity: "exp", "length", "path" or "log" of a geodesic; "cubic", "action" or "equation" of
            a cubic; "metric" where there is not even that.
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
    start = (known.q0, known.v0)
    tolerance = known.tolerances["exp"]

    def on_the_way(metric: Metric) -> Pair:
        times = [0.0, *(each.s for each in known.points)]
        found, _ = sample_geodesic(metric, *start, times, tolerance=tolerance)
        return found[1:], [each.q for each in known.points]

    quantities: dict[str, tuple[Callable[[Metric], Pair], float]] = {
        "exp": (lambda metric: (exp(metric, *start, tolerance=tolerance), known.q1), tolerance),
        "length": (lambda metric: (metric.norm(*start), known.length), tolerance),
    }
    if known.points:
        quantities["path"] = on_the_way, tolerance
    if known.log:
        allowed = known.tolerances["log"]
        quantities["log"] = (
            (lambda metric: (log(metric, known.q0, known.q1, wrap=False), known.v0)),
            allowed,
        )
    return _checks(known, quantities, backend)


def check_cubic(known: KnownCubic, backend: str | None = None) -> list[Check]:
    """Return positions, action and equation of `cubic` between the ends of a known one.

    See `check_geodesic`; the equation is that of `RiemannianSpline.relative_residual`.
    """

    @lru_cache
    def motion(metric: Metric) -> RiemannianSpline:
        ends = known.q0, known.v0, known.q1, known.v1
        return cubic(metric, *ends, known.duration, tension=known.tension)

    times = known.duration * np.array([*(each.s for each in known.points), 1.0])
    points = [*(each.q for each in known.points), known.q1]
    tolerance = known.tolerance
    quantities: dict[str, tuple[Callable[[Metric], Pair], float]] = {
        "cubic": (lambda metric: (motion(metric)(times), points), tolerance),
        "action": (lambda metric: (motion(metric).action / known.action, 1.0), tolerance),
        "equation": (lambda metric: (motion(metric).relative_residual(times), 0.0), tolerance),
    }
    return _checks(known, quantities, backend)


def _checks(
    known: KnownGeodesic | KnownCubic,
    quantities: Mapping[str, tuple[Callable[[Metric], Pair], float]],
    backend: str | None,
) -> list[Check]:
    """Compare what is found with what is expected, each within its tolerance."""
    used = choose_backend(backend) if has_model(known.metric) else None
    tolerances = [tolerance for _, tolerance in quantities.values()]
    try:
        metric = metric_of(known.metric, used)
    except _FAILURES as failure:
        return [Check(known.name, "metric", used or "-", np.inf, tolerances[0], str(failure))]
    checks = []
    for quantity, (found, tolerance) in quantities.items():
        try:
            error = float(np.abs(np.subtract(*found(metric))).max())
            message = ""
        except _FAILURES as failure:
            error = np.inf
            message = str(failure)
        checks.append(Check(known.name, quantity, used or "-", error, tolerance, message))
    return checks


def check_known_geodesics(
    known: Iterable[KnownGeodesic | KnownCubic], backends: Sequence[str]
) -> tuple[Check, ...]:
    """Return all checks of known geodesics and cubics; those of a model's metric once for every
    back end.
    """
    checks: list[Check] = []
    for entry in known:
        for backend in backends if has_model(entry.metric) else backends[:1]:
            if isinstance(entry, KnownCubic):
                checks += check_cubic(entry, backend)
            else:
                checks += check_geodesic(entry, backend)
    return tuple(checks)


def table_of(checks: Iterable[Check]) -> DataFrame:
    """Return checks as a table."""
    header = ("name", "quantity", "back end", "error", "tolerance", "verdict")
    verdicts = {True: "passed", False: "FAILED"}
    return new_table(header, [(*astuple(each)[:5], verdicts[each.passed]) for each in checks])


def run_check(file: str | PathLike[str] | None = None, backend: str | None = None) -> bool:
    """Check what is known, print a table of the results, and say whether all passed.

    Args:
        file: a table of the user's own, checked in addition to the one of the package.
        backend: the only one to check; None: all that can be used here.

    Raises:
        ValueError: the file is malformed, or the back end is unknown or cannot be used here.
    """
    known: list[KnownGeodesic | KnownCubic] = []
    for one in [None] if file is None else [None, file]:
        known += [*read_known_geodesics(one), *read_known_cubics(one)]
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
            print(f"Not checked, as {name} cannot be used here: {why_unavailable(name)}")
    print(_summary(known, checks, backends))
    return not failed


def _summary(
    known: Sequence[KnownGeodesic | KnownCubic], checks: Sequence[Check], backends: Sequence[str]
) -> str:
    failed = [check for check in checks if not check.passed]
    cubics = sum(isinstance(each, KnownCubic) for each in known)
    subject = f"{len(known) - cubics} known geodesics{f' and {cubics} cubics' * (cubics > 0)}"
    subject += f" with {' and '.join(backends)}"
    if failed:
        names = dict.fromkeys(repr(check.name) for check in failed)
        return f"{subject}: {len(failed)} of {len(checks)} checks FAILED, of {', '.join(names)}."
    worst = max(checks, key=lambda check: check.error / check.tolerance)
    return (
        f"{subject}: all {len(checks)} checks passed; nearest to its tolerance is {worst.quantity} "
        f"of {worst.name!r}, {worst.error:.1e} of {worst.tolerance:.0e}."
    )
