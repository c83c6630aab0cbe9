"""The table of known geodesics: metrics, initial velocities and where they lead.

The project's own is made by tools/known_geodesics.py, which shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from geodesic_ocp.arrays import as_number, as_positive
from geodesic_ocp.records import parse_json
from geodesic_ocp.validation.metrics import check_description

BUNDLED = Path(__file__).resolve().parents[1] / "data" / "known_geodesics.json"
FORMAT, VERSION = "geodesic_ocp known geodesics", 1
_NEEDED = ("name", "metric", "q0", "v0", "q1", "length", "log", "tolerances", "source")
_POSSIBLE = ("points",)


@dataclass(frozen=True)
class KnownGeodesic:
    """A geodesic q(s), s in [0, 1], that is known from elsewhere.

    Attributes:
        name: of the entry.
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
    """The known geodesics of a table in JSON, by default those that come with the package.

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
