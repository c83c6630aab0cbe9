"""Checks and conversions of arguments: NumPy in, NumPy out; CasADi in, CasADi out."""

from __future__ import annotations

import operator
from collections.abc import Collection, Sequence, Sized
from dataclasses import MISSING, fields
from functools import lru_cache
from typing import Any, ClassVar, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array: TypeAlias = NDArray[np.float64]
_ORTHOGONAL = 1e-9  # largest entry of R R' - 1 of a rotation
Symbolic: TypeAlias = ca.SX | ca.MX


def is_symbolic(*values: object) -> bool:
    """Return whether any of the values is a CasADi expression."""
    return any(isinstance(value, (ca.SX, ca.MX)) for value in values)


def as_expression(name: str, value: Any) -> ca.SX:
    """Return the value as a matrix of CasADi expressions, also from a list of rows; else
    ValueError.
    """
    try:
        rows = [ca.horzcat(*row) for row in value] if isinstance(value, (list, tuple)) else []
        return ca.SX(ca.vertcat(*rows) if rows else value)
    except (NotImplementedError, TypeError, RuntimeError) as error:
        raise ValueError(
            f"{name} must be a matrix of CasADi expressions, or a list of rows, got "
            f"{type(value).__name__}"
        ) from error


def real_array(value: Any, name: str = "values") -> Array:
    """Return a new array of floats; TypeError or ValueError if the value is not made of real
    numbers.
    """
    if np.iscomplexobj(value):  # NumPy would drop the imaginary part
        raise ValueError(f"{name} must be real numbers, got complex ones")
    return np.array(value, dtype=float)


def as_vector(name: str, value: ArrayLike, size: int) -> Array:
    """Return the value as a finite 1-d array of `size` floats; ValueError names the argument
    otherwise.
    """
    try:
        array = real_array(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be {size} real numbers, got {value!r}") from None
    if array.shape != (size,):
        raise ValueError(f"{name} must have shape ({size},), got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} must be finite, got {array}")
    return array


def as_rotation(name: str, value: Any) -> Array:
    """Return the value as a rotation matrix (3, 3); ValueError names the argument otherwise."""
    try:
        matrix = real_array(value)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if (
        matrix.shape != (3, 3)
        or not np.abs(matrix @ matrix.T - np.eye(3)).max() <= _ORTHOGONAL
        or np.linalg.det(matrix) < 0.0
    ):
        raise ValueError(f"{name} must be a rotation matrix (3, 3), got {value!r}")
    return matrix


def as_number(name: str, value: object) -> float:
    """Return the value as a finite float; ValueError names the argument otherwise."""
    try:
        number = float(value) if np.ndim(value) == 0 else np.nan  # type: ignore[arg-type]
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, str) or not np.isfinite(number):
        raise ValueError(f"{name} must be a finite number, got {value!r}")
    return number


def as_positive(name: str, value: float, unit: str = "") -> float:
    """Return the value as a positive finite float; ValueError names the argument otherwise."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not np.isfinite(number) or number <= 0.0:
        raise ValueError(f"{name} must be positive{f' [{unit}]' if unit else ''}, got {value}")
    return number


def as_not_negative(name: str, value: float, unit: str = "") -> float:
    """Return the value as a finite float that is not negative; ValueError names the argument
    otherwise.
    """
    number = as_number(name, value)
    if number < 0.0:
        raise ValueError(
            f"{name} must not be negative{f' [{unit}]' if unit else ''}, got {value!r}"
        )
    return number


def as_choice(name: str, value: Any, known: Collection[Any], unless: str = "") -> Any:
    """Return the value, which is one of those known; ValueError names the argument otherwise.

    `unless` follows the list of those in the message.
    """
    if value not in (known := tuple(known)):  # as it may not be hashable
        allowed = ", ".join(map(str, known))
        raise ValueError(f"{name} must be one of {allowed}{unless}, got {value!r}")
    return value


def as_integer(name: str, value: object, least: int) -> int:
    """Get the value as an integer of at least `least`; ValueError names the argument otherwise."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if number < least:
        allowed = {0: "a non-negative integer", 1: "a positive integer"}
        what = allowed.get(least, f"an integer of at least {least}")
        raise ValueError(f"{name} must be {what}, got {value!r}")
    return number


def evaluate(function: ca.Function, *arguments: Any) -> Any:
    """Call a CasADi function with expressions or with arrays; arrays give 2-d arrays."""
    symbolic = is_symbolic(*arguments)
    found = None if symbolic else by_buffers(function, arguments)
    if found is None or found[1].ret():
        outputs: Any = function.call(list(arguments))
        outputs = outputs if symbolic else [out.full() for out in outputs]
    else:
        outputs = found[0]
    return outputs[0] if len(outputs) == 1 else tuple(outputs)


def by_buffers(function: ca.Function, arguments: Sequence[Any]) -> tuple[list[Array], Any] | None:
    """Return the outputs (m, k) for arrays as large as the inputs, and the `FunctionBuffer`, with
    `ret` and `stats`, in a third of the time of a call whose numbers CasADi copies; None for
    anything else.
    """
    shapes, results = _dense_shapes(function)
    if len(arguments) != len(shapes) or results is None:
        return None
    buffer: Any
    buffer, run = function.buffer()
    used = []  # as it knows their addresses alone
    for index, (value, shape) in enumerate(zip(arguments, shapes, strict=True)):
        allowed = shape, shape[:1] if shape[1] == 1 or not shape[0] else shape
        is_real = isinstance(value, np.ndarray) and value.dtype == float
        if not is_real or value.shape not in allowed:
            return None
        if value.size:
            used.append(memoryview(value.ravel(order="F")))
            buffer.set_arg(index, used[-1])
    outputs: list[Any] = [np.empty(shape, order="F") for shape in results]
    for index, output in enumerate(outputs):
        if output.size:
            buffer.set_res(index, memoryview(output.reshape(-1, order="F")))
    run()
    return outputs, buffer


@lru_cache(maxsize=256)
def _dense_shapes(
    function: ca.Function,
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...] | None]:
    """Return shapes of inputs and outputs; None for the outputs if any of all is sparse."""
    parts = [function.sparsity_in(k) for k in range(function.n_in())]
    found = [function.sparsity_out(k) for k in range(function.n_out())]
    dense = all(each.is_dense() for each in (*parts, *found))
    shapes, results = (tuple(each.shape for each in side) for side in (parts, found))
    return shapes, results if dense else None


def settle(record: object, /, **values: object) -> None:
    """Set fields of a frozen dataclass that is being made: in its `__post_init__`, where arguments
    become what the fields hold, or in a copy that nobody else has seen.
    """
    for name, value in values.items():
        object.__setattr__(record, name, value)


class ShortRepr:
    """Mixin of dataclasses: `repr` is the class and its fields on one line.

    Left out are fields with their default values, and the entries of long sequences and arrays.
    Dataclasses state `repr=False`.

    Attributes:
        _shown: names of the attributes that are shown; empty: all fields.
    """

    _shown: ClassVar[tuple[str, ...]] = ()

    def __repr__(self) -> str:
        defaults = {each.name: each.default for each in fields(self)}  # type: ignore[arg-type]
        shown = []
        for name in self._shown or defaults:
            entry = getattr(self, name)
            default = defaults.get(name, MISSING)
            is_empty = isinstance(entry, Sized) and len(entry) == 0
            if not (entry is default or is_empty or (np.isscalar(entry) and entry == default)):
                shown.append(f"{name}={_short(entry)}")
        return f"{type(self).__name__}({', '.join(shown)})"


def _short(entry: Any) -> str:
    if isinstance(entry, np.ndarray) or (isinstance(entry, tuple) and np.isscalar(entry[0])):
        array = np.asarray(entry)
        if array.size <= 9 and array.dtype.kind in "biuf":
            return str((array.round(3) + 0.0).tolist())
        return f"<{' x '.join(map(str, array.shape))} entries>"
    if isinstance(entry, float):
        return f"{entry:.6g}"
    if isinstance(entry, Sized) and not isinstance(entry, str) and len(repr(entry)) > 60:
        return f"<{len(entry)} entries>"
    return repr(entry)


def rotation_vector(rotation: Array) -> Array:
    """Get axis times angle (..., 3) [rad] of rotation matrices (..., 3, 3), accurate up to pi."""
    result: Array = Rotation.from_matrix(rotation).as_rotvec()
    return result
