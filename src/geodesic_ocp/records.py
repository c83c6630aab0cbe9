"""JSON files with a format name and a version, records that users state, NumPy archives, and
writing of several files.
"""

from __future__ import annotations

import json
import lzma
import math
import os
import secrets
import struct
import tempfile
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import as_choice
from geodesic_ocp.errors import RecordingError

# What zipfile, its decompressors and NumPy raise of a damaged archive of arrays.
_UNREADABLE_ARCHIVE = (
    *(OSError, ValueError, EOFError, KeyError, TypeError, SyntaxError, MemoryError, OverflowError),
    *(AttributeError, NotImplementedError, RuntimeError, struct.error, tokenize.TokenError),
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError),
)
# What constructors raise of values of the right type that make no sense.
SENSELESS = (ArithmeticError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError)
TEMPORARY = ".writing-"  # start of the names of files that are being written


Converted = TypeVar("Converted")


def read_record(file: str | PathLike[str], name: str, version: int, what: str) -> dict[str, Any]:
    """Read the object in a JSON file of format `name`; messages call its content `what`.

    Raises:
        RecordingError: the file is missing, cannot be read, or is of another format or version.
    """
    path = Path(file)
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    try:
        record = parse_json(path.read_text(encoding="utf-8"), _finite)
    except OSError as failure:
        raise RecordingError(f"{path}: cannot be read: {failure}") from None
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{path}: is not JSON: {failure}") from None
    if not isinstance(record, dict) or record.get("format") != name:
        raise RecordingError(f"{path}: is not a file of {what}")
    if record.get("version") != version:
        raise RecordingError(f"{path}: has version {record.get('version')}, expected {version}")
    return record


def read_structured(file: Path, what: str, hint: str = "") -> Any:
    """Read the content of a JSON, TOML (.toml) or YAML file (.yaml, .yml), not checked yet.

    Args:
        what: what the content should be, for messages, such as "convention".
        hint: text that follows the message when the file cannot be opened.

    Raises:
        RecordingError: the file is missing or malformed.
        ImportError: YAML without PyYAML.
    """
    yaml = file.suffix.lower() in (".yaml", ".yml")
    try:
        text = file.read_text(encoding="utf-8-sig")
        if yaml:
            return msgspec.yaml.decode(text)
        if file.suffix.lower() != ".toml":
            return parse_json(text)
        import tomllib  # from Python 3.11 on

        return tomllib.loads(text)
    except FileNotFoundError:
        raise RecordingError(f"{file}: cannot be read: there is no such file{hint}") from None
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror}{hint}") from None
    except ImportError:
        if yaml:
            raise ImportError("YAML needs PyYAML: pip install 'geodesic_ocp[people]'") from None
        raise RecordingError(
            f"{file}: TOML needs Python 3.11 or later; write the {what} as JSON"
        ) from None
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{file}: is not a {what} in JSON, TOML or YAML: {failure}") from None


def parse_json(text: str, not_finite: Callable[[str], Any] = float) -> Any:
    """Return the value of a JSON text.

    Args:
        not_finite: called with the constants Infinity, -Infinity and NaN.

    Raises:
        ValueError: it is no JSON, or has digits beyond the range of floating-point numbers.
        RecursionError: it is nested too deeply.
    """
    return json.loads(text, parse_int=_integer, parse_float=_finite, parse_constant=not_finite)


def _integer(digits: str) -> int:
    _finite(digits)
    return int(digits)


def _finite(digits: str) -> float:
    if not math.isfinite(number := float(digits)):
        raise ValueError(f"the number {digits:.20} is not finite")
    return number


def convert(record: object, kind: type[Converted], file: str | PathLike[str]) -> Converted:
    """Return a dataclass, with the types of its annotations, from the value of a JSON text.

    Numbers that are not finite are the texts "inf", "-inf" and "nan"; unknown fields are ignored.

    Raises:
        RecordingError: a field is missing, of another type, or refused by a dataclass; names the
            file and the field.
    """
    with decoding(file):
        return msgspec.convert(record, kind, strict=False, dec_hook=_array_from_lists)


@contextmanager
def decoding(file: str | PathLike[str]) -> Iterator[None]:
    """Yield errors by what a file holds become a RecordingError that names it.

    Raises:
        RecordingError: any such error.
    """
    try:
        yield
    except RecordingError:
        raise
    except (ValueError, *SENSELESS) as failure:
        raise RecordingError(f"{file}: {str(failure) or type(failure).__name__}") from None


@contextmanager
def naming(**files: object) -> Iterator[None]:
    """Yield errors by values end with the files that were used, but for those that they name.

    What a file says may be wrong for what it is used with, such as a column that another file does
    not have.

    Args:
        files: paths by what they are, such as `columns`; what is no file does not count.

    Raises:
        ValueError: the same error, with another message.
    """
    try:
        yield
    except ValueError as failure:
        used = {what: file for what, file in files.items() if isinstance(file, (str, PathLike))}
        ending = ", ".join(
            f"{what.replace('_', ' ')} {file}"
            for what, file in used.items()
            if str(file) not in str(failure) and Path(file).is_file()
        )
        if ending and failure.args == (str(failure),):  # not those of decoding, say
            failure.args = (f"{failure} (with {ending})",)
        raise


_Numbers = float | list[float | list[float | list[float]]]


def _array_from_lists(kind: Any, value: object) -> NDArray[Any]:
    """Return an array, whose annotation is NDArray."""
    try:
        entries = msgspec.convert(value, _Numbers, strict=False)
    except msgspec.ValidationError as failure:  # the place in the array is not that in the file
        raise ValueError(str(failure).partition(" - at")[0]) from None
    try:
        return np.array(entries, dtype=float)
    except ValueError:
        raise ValueError("rows must have one length") from None


def read_arrays(
    file: Path, choose: Callable[[list[str]], Iterable[str]] = iter
) -> dict[str, NDArray[Any]]:
    """Return arrays in a NumPy archive (.npz), without Python objects.

    Args:
        choose: from the names of all arrays, those that are to be read; all by default.

    Raises:
        RecordingError: the file is no such archive, or an array in it cannot be read.
        OSError: the file cannot be opened.
    """
    with file.open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # headers written by Python 2
        with _opened(file, stream) as archive:
            return {name: _array(file, archive, name) for name in choose(archive.files)}


def _opened(file: Path, stream: BinaryIO) -> Any:
    try:
        archive = np.load(stream, allow_pickle=False)
    except _UNREADABLE_ARCHIVE as failure:
        raise RecordingError(f"{file}: is no archive of NumPy arrays: {_line(failure)}") from None
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise RecordingError(f"{file}: is a single array, not an archive of arrays (.npz)")
    return archive


def _array(file: Path, archive: Any, name: str) -> NDArray[Any]:
    try:
        array = archive[name]
    except _UNREADABLE_ARCHIVE as failure:
        pickled = "it holds Python objects, which are not loaded from files"
        reason = pickled if "allow_pickle" in str(failure) else _line(failure)
        raise RecordingError(f"{file}: {name!r} cannot be read: {reason}") from None
    if not isinstance(array, np.ndarray):
        raise RecordingError(f"{file}: {name!r} is not a NumPy array")
    return array


def _line(failure: BaseException) -> str:
    return (str(failure).splitlines() or [type(failure).__name__])[0][:120]


def write_together(folder: str | Path, write: Callable[[Path], object]) -> list[Path]:
    """Write files to a temporary folder, move them to `folder` together, and return their paths.

    Raises:
        OSError: the folder cannot be created or written to.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target, prefix=TEMPORARY) as temporary:
        write(Path(temporary))
        return sorted(file.replace(target / file.name) for file in Path(temporary).iterdir())


def write_file(file: str | PathLike[str], text: str, *, lasting: bool = False) -> Path:
    """Write a text file all at once, see `replacing`.

    Raises:
        OSError: the file cannot be written.
    """
    target = Path(file)
    with replacing(target, lasting=lasting) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return target


def write_record(file: str | PathLike[str], record: Mapping[str, Any]) -> Path:
    """Write a JSON file that `read_record` reads, all at once; arrays become lists.

    Raises:
        OSError: the file cannot be written.
    """
    return write_file(file, json.dumps(as_json(record), indent=1, allow_nan=False) + "\n")


def as_json(value: Any) -> Any:
    """Return nested lists and numbers; numbers that are not finite by name."""
    if isinstance(value, Mapping):
        return {key: as_json(each) for key, each in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [as_json(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


@contextmanager
def replacing(target: Path, *, lasting: bool = False) -> Iterator[Path]:
    """Yield a path in the same folder, whose file becomes the target; a failure leaves that as it
    was.

    The file has the permissions of any new one. If lasting, it is on the disk when this ends.

    Raises:
        OSError: the file cannot be written.
    """
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target}: there is no folder {target.parent}")
    temporary = target.with_name(f"{TEMPORARY}{secrets.token_hex(8)}")
    try:
        yield temporary
        if lasting:
            _to_disk(temporary)
        temporary.replace(target)
    except BaseException as failure:
        temporary.unlink(missing_ok=True)
        if isinstance(failure, OSError) and str(failure.filename) == str(temporary):
            failure.filename = str(target)  # the one that the user knows
            del failure.filename2
        raise
    if lasting:
        _to_disk(target.parent)


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


Stated = TypeVar("Stated", bound=Any)


def as_stated(
    kind: type[Stated],
    given: Stated | str | Path | None,
    argument: str,
    what: str,
    known: Sequence[Stated] = (),
) -> Stated | None:
    """Return the record itself, or the one in a JSON or TOML file with its attributes as keys.

    Args:
        kind: dataclass; the file's name stands in for its attribute `name`.
        given: a value of this dataclass or a file.
        argument: name of the argument, for messages.
        what: the record is, for messages, such as "a convention".
        known: records that a file may name by "extends", whose attributes are then its defaults.

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a record nor a path.
    """
    if given is None or isinstance(given, kind):
        return given
    if not isinstance(given, (str, Path)):
        raise ValueError(f"{argument} must be a {kind.__name__} or a file, got {given!r}")
    file = Path(given)
    record = read_structured(file, what.removeprefix("a "))
    with decoding(file):
        defaults = {"name": file.stem}
        if known and isinstance(record, dict) and "extends" in record:
            bases = {each.name: each for each in known}
            base = record.pop("extends")
            known_base = bases[as_choice("extends", base, bases)]
            inherited = {each.name: getattr(known_base, each.name) for each in fields(kind)}
            defaults = inherited | defaults
        return from_record(kind, what, record, defaults)


def from_record(
    kind: type[Stated],
    what: str,
    record: Any,
    defaults: dict[str, Any] | None = None,
    **parts: Callable[[list[Any]], Any],
) -> Stated:
    """Return the dataclass of this kind whose attributes are the keys of a record.

    Args:
        kind: dataclass.
        what: it is, for messages, such as "a convention".
        record: object of a JSON or TOML file.
        defaults: values of attributes that the record may leave out.
        parts: from the list that an attribute must be to its value, by attribute.

    Raises:
        ValueError: a key that is unknown or missing, a part that is no list, or what the dataclass
            refuses.
    """
    values: dict[str, Any] = dict(defaults or {})
    known = fields(kind)
    required = [
        each.name
        for each in known
        if each.default is each.default_factory is MISSING and each.name not in values
    ]
    keys = f"{what} has the keys {', '.join(each.name for each in known)}"
    if required:
        keys += f", of which {' and '.join(map(repr, required))} is required"
    if not isinstance(record, dict):
        raise ValueError(f"{keys}, got {str(record)[:80]}")
    if unknown := sorted(set(record) - {each.name for each in known}):
        raise ValueError(f"{keys}, not {unknown[0]!r}")
    if not set(required) <= set(record):
        raise ValueError(f"{keys}, got {str(record)[:80]}")
    values |= record
    for name, read in parts.items():
        if name in record:
            if not isinstance(record[name], list):
                raise ValueError(f"{name} must be a list, got {record[name]!r}")
            values[name] = read(record[name])
    stated: Stated = kind(**values)
    return stated
