"""The elements of an .osim file: numbers, names, and functions of coordinates."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.xml_root import xml_root
from geodesic_ocp.recordings.opensim_models.osim_model import OsimFunction
from geodesic_ocp.recordings.opensim_models.simm_spline import simm_spline

_LARGEST = 1e6  # of any length [m], angle [rad] or coefficient
_NARROWEST = 1e-9  # between two points of a spline


def model_element(file: Path) -> ElementTree.Element:
    """The element Model of the file.

    Raises:
        RecordingError: the file is missing, is no XML, defines entities, or is not an OpenSim model
            of version 2 or later.
    """
    try:
        root = xml_root(file)
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror or failure}") from None
    model = root.find("Model") if root.tag == "OpenSimDocument" else None
    if model is None:
        raise RecordingError(
            f"{file}: expected <OpenSimDocument> with a <Model>, found <{root.tag}>: not a "
            "model of OpenSim 2 or later"
        )
    return model


def text_of(element: ElementTree.Element, tag: str) -> str:
    """Text of a child element without blanks around it; "" without such a child."""
    return (element.findtext(tag) or "").strip()


def flag(element: ElementTree.Element, tag: str, default: bool = False) -> bool:
    """Whether a child element says true."""
    text = text_of(element, tag).lower()
    return text in ("true", "1") if text else default


def numbers(
    element: ElementTree.Element, tag: str, size: int | None = None, default: Array | None = None
) -> Array:
    """The numbers of a child element; without it the default.

    Raises:
        RecordingError: it is missing without a default, or does not have `size` usable numbers.
    """
    child = element.find(tag)
    where = f"<{tag}> of <{element.tag}>"
    if child is None or child.text is None or not child.text.strip():
        if default is None:
            raise RecordingError(f"{where} is missing")
        return default
    try:
        values = np.array(child.text.split(), dtype=float)
    except ValueError:
        raise RecordingError(f"{where} must be numbers, is {child.text.strip()[:40]!r}") from None
    if size is not None and len(values) != size:
        raise RecordingError(f"{where} must be {size} numbers, is {child.text.strip()[:40]!r}")
    if not np.all(np.abs(values) <= _LARGEST):
        raise RecordingError(f"{where} is not finite or too large: {child.text.strip()[:40]!r}")
    return values


def read_function(element: ElementTree.Element, count: int) -> OsimFunction:
    """The function of `count` coordinates in an element such as LinearFunction.

    Raises:
        RecordingError: a function that is not known, or numbers that it cannot have.
    """
    factor = 1.0
    while element.tag == "MultiplierFunction":
        factor *= float(numbers(element, "scale", 1, np.ones(1))[0])
        inner = element.find("function")
        if inner is None or len(inner) != 1:
            raise RecordingError("<MultiplierFunction> must have a function")
        element = inner[0]
    function = _plain_function(element, count)
    return function if factor == 1.0 else lambda values: factor * function(values)


def _plain_function(element: ElementTree.Element, count: int) -> OsimFunction:
    kind = element.tag
    if kind == "Constant":
        value = float(numbers(element, "value", 1, np.zeros(1))[0])
        return lambda values: np.full(values.shape[1], value)
    if kind == "LinearFunction":
        slopes = numbers(element, "coefficients", count + 1)  # the constant is the last one
        return lambda values: np.asarray(slopes[:-1] @ values + slopes[-1])
    if kind not in ("PolynomialFunction", "SimmSpline", "NaturalCubicSpline"):
        raise RecordingError(
            f"the function {kind} is not read; known are Constant, LinearFunction, "
            "PolynomialFunction, SimmSpline and MultiplierFunction"
        )
    if count != 1:
        raise RecordingError(f"the function {kind} must be of one coordinate, is of {count}")
    if kind == "PolynomialFunction":
        powers = numbers(element, "coefficients")  # the highest power is the first one
        return lambda values: np.asarray(np.polyval(powers, values[0]))
    x, y = numbers(element, "x"), numbers(element, "y")
    if len(x) != len(y) or len(x) < 2 or not np.all(np.diff(x) > _NARROWEST):
        raise RecordingError(
            f"<{kind}> must have as many y as x, at least two, and x must increase"
        )
    return simm_spline(x, y)
