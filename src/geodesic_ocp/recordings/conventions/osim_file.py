"""Model files of OpenSim (.osim), in the layouts of OpenSim 2 to 4; messages name the element."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.continuous_angles import direction
from geodesic_ocp.recordings.conventions.osim_model import (
    GROUND,
    OffsetFrame,
    OsimAxis,
    OsimCoordinate,
    OsimFunction,
    OsimJoint,
    OsimModel,
)
from geodesic_ocp.trajectory.files.mmm import xml_root
from geodesic_ocp.trajectory.files.text_lines import named_failures

_BEYOND = 0.01  # of the spline's width
_METRES = ("", "meters", "meter", "metres", "metre", "m")
_LARGEST = 1e6  # of any length [m], angle [rad] or coefficient
_NARROWEST = 1e-9  # between two points of a spline
_SHORTEST_AXIS = 1e-6
# Rotations about (r) and translations along (t) axes of the joint, in the order of the coordinates.
# Source: the classes' documentation in OpenSim's API, https://simtk.org/api_docs/opensim/api_docs/
_JOINTS = {
    "WeldJoint": (),
    "PinJoint": ("rz",),
    "SliderJoint": ("tx",),
    "UniversalJoint": ("rx", "ry"),
    "BallJoint": ("rx", "ry", "rz"),
    "GimbalJoint": ("rx", "ry", "rz"),
    "FreeJoint": ("rx", "ry", "rz", "tx", "ty", "tz"),
    "PlanarJoint": ("rz", "tx", "ty"),
}


def read_osim(file: Path) -> OsimModel:
    """Read the bodies, joints, coordinates and couplers of a model (.osim).

    Joints of unknown kinds, or with unknown functions, matter only where a motion needs them.

    Raises:
        RecordingError: the file is missing or malformed, is not of OpenSim 2 or later, or lengths
            are not in metres; names the element and the reason.
    """
    with named_failures(file):
        root = xml_root(file)
        model = root.find("Model") if root.tag == "OpenSimDocument" else None
        if model is None:
            raise RecordingError(
                f"expected <OpenSimDocument> with a <Model>, found <{root.tag}>: not a model of "
                "OpenSim 2 or later"
            )
        unit = _text(model, "length_units").lower()
        if unit not in _METRES:
            raise RecordingError(f"<length_units> must be meters, is {unit!r}")
        bodies = model.findall("BodySet/objects/Body") + model.findall("components/Body")
        joints, coordinates = _joints(model, bodies)
        return OsimModel(
            file,
            tuple(body.get("name", "") for body in bodies),
            joints,
            coordinates,
            _couplers(model),
            _numbers(model, "gravity", 3, np.zeros(3)),
        )


def _joints(
    model: ElementTree.Element, bodies: list[ElementTree.Element]
) -> tuple[dict[str, OsimJoint], dict[str, OsimCoordinate]]:
    """Return the joints by the body that they carry, and their coordinates by name."""
    joints: dict[str, OsimJoint] = {}
    coordinates: dict[str, OsimCoordinate] = {}
    frames = {
        each.get("name", ""): each
        for path in ("components", "BodySet/objects/Body/components", "Ground/components")
        for each in model.findall(f"{path}/PhysicalOffsetFrame")
    }
    nested = [(body.get("name", ""), joint) for body in bodies for joint in body.findall("Joint/*")]
    listed = [
        (None, joint)
        for path in ("JointSet/objects", "components")
        for joint in model.findall(f"{path}/*")
        if joint.tag.endswith("Joint")
    ]
    for body, element in nested + listed:
        name = element.get("name", "")
        try:
            ends = _ends_in_set(element, frames) if body is None else _ends_in_body(element, body)
            joint = _joint(element, *ends)
            found = [_coordinate(each) for each in _coordinate_elements(element)]
        except RecordingError as failure:
            raise RecordingError(f"joint {name!r}: {failure}") from None
        if joint.child.body in joints:
            reason = f"two joints carry the body {joint.child.body!r}"
            joint = OsimJoint(name, *ends, refusal=reason)
        joints[joint.child.body] = joint
        for coordinate in found:
            if coordinate.name in coordinates:
                raise RecordingError(f"there are two coordinates {coordinate.name!r}")
            coordinates[coordinate.name] = coordinate
    if not joints:
        raise RecordingError("there are no joints in <BodySet> nor in <JointSet>")
    return joints, coordinates


def _couplers(model: ElementTree.Element) -> dict[str, OsimFunction]:
    couplers = {}
    for element in model.findall("ConstraintSet/objects/CoordinateCouplerConstraint"):
        if _flag(element, "isDisabled") or not _flag(element, "isEnforced", True):
            continue
        dependent = _text(element, "dependent_coordinate_name")
        independent = tuple(_text(element, "independent_coordinate_names").split())
        scale = _number(element, "scale_factor", 1.0)
        holder = element.find("coupled_coordinates_function")
        try:
            if holder is None or len(holder) != 1 or not independent or not dependent:
                raise RecordingError("needs two names of coordinates and a function")
            couplers[dependent] = _function(holder[0], independent, scale)
        except RecordingError as failure:
            raise RecordingError(
                f"CoordinateCouplerConstraint {element.get('name', '')!r}: {failure}"
            ) from None
    return couplers


def _text(element: ElementTree.Element, tag: str) -> str:
    """Return text of a child element without blanks around it; "" without such a child."""
    return (element.findtext(tag) or "").strip()


def _flag(element: ElementTree.Element, tag: str, default: bool = False) -> bool:
    """Return whether a child element says true."""
    text = _text(element, tag).lower()
    return text in ("true", "1") if text else default


def _numbers(
    element: ElementTree.Element, tag: str, size: int | None = None, default: Array | None = None
) -> Array:
    """Return the numbers of a child element; without it the default.

    Raises:
        RecordingError: it is missing without a default, or does not have `size` usable numbers.
    """
    text = _text(element, tag)
    where = f"<{tag}> of <{element.tag}>"
    if not text:
        if default is None:
            raise RecordingError(f"{where} is missing")
        return default
    try:
        values = np.array(text.split(), dtype=float)
    except ValueError:
        raise RecordingError(f"{where} must be numbers, is {text[:40]!r}") from None
    if size is not None and len(values) != size:
        raise RecordingError(f"{where} must be {size} numbers, is {text[:40]!r}")
    if not np.all(np.abs(values) <= _LARGEST):
        raise RecordingError(f"{where} is not finite or too large: {text[:40]!r}")
    return values


def _number(element: ElementTree.Element, tag: str, default: float) -> float:
    return float(_numbers(element, tag, 1, np.array([default]))[0])


def _function(
    element: ElementTree.Element, coordinates: tuple[str, ...], factor: float = 1.0
) -> OsimFunction:
    """Return a factor times the function in an element such as LinearFunction.

    Raises:
        RecordingError: a function that is not known, or numbers that it cannot have.
    """
    while element.tag == "MultiplierFunction":
        factor *= _number(element, "scale", 1.0)
        inner = element.find("function")
        if inner is None or len(inner) != 1:
            raise RecordingError("<MultiplierFunction> must have a function")
        element = inner[0]
    plain = _plain_function(element, len(coordinates))
    return OsimFunction(coordinates, lambda values: factor * plain(values))


def _plain_function(element: ElementTree.Element, count: int) -> Callable[[Array], Array]:
    kind = element.tag
    if kind == "Constant":
        value = _number(element, "value", 0.0)
        return lambda values: np.full(values.shape[1], value)
    if kind == "LinearFunction":
        slopes = _numbers(element, "coefficients", count + 1)  # the constant is the last one
        return lambda values: np.asarray(slopes[:-1] @ values + slopes[-1])
    if kind not in ("PolynomialFunction", "SimmSpline", "NaturalCubicSpline"):
        raise RecordingError(
            f"the function {kind} is not read; known are Constant, LinearFunction, "
            "PolynomialFunction, SimmSpline and MultiplierFunction"
        )
    if count != 1:
        raise RecordingError(f"the function {kind} must be of one coordinate, is of {count}")
    if kind == "PolynomialFunction":
        powers = _numbers(element, "coefficients")  # the highest power is the first one
        return lambda values: np.asarray(np.polyval(powers, values[0]))
    x = _numbers(element, "x")
    y = _numbers(element, "y")
    if len(x) != len(y) or len(x) < 2 or not np.all(np.diff(x) > _NARROWEST):
        raise RecordingError(
            f"<{kind}> must have as many y as x, at least two, and x must increase"
        )
    return simm_spline(x, y)


def simm_spline(x: Array, y: Array) -> Callable[[Array], Array]:
    """Return the interpolating cubic spline through (x, y).

    It is not the natural spline: at either end its third derivative is that of the cubic through
    the four points there (Forsythe, Malcolm and Moler, Computer Methods for Mathematical
    Computations, 1977, section 4.4). With three points the third derivatives at the ends are zero.

    Args:
        x: increasing (n,), n at least 2.
        y: (n,).

    Returns:
        A function that raises RecordingError beyond the ends by more than a hundredth of the
        spline's width, as programs differ there. Up to that it is linear.
    """
    degree = min(len(x) - 1, 3)
    ends = None
    if len(x) > 3:
        ends = tuple([(3, _third_derivative(x[k], y[k]))] for k in (slice(4), slice(-4, None)))
    spline = scipy.interpolate.make_interp_spline(x, y, degree, bc_type=ends)
    slopes = spline(x[[0, -1]], 1)

    def evaluate(values: Array) -> Array:
        at = values[0]
        inside = np.clip(at, x[0], x[-1])
        worst = int(np.argmax(np.abs(at - inside)))
        if abs(at[worst] - inside[worst]) > _BEYOND * (x[-1] - x[0]):
            raise RecordingError(
                f"a SimmSpline of the model has points from {x[0]:.4g} to {x[-1]:.4g}, but its "
                f"coordinate is {at[worst]:.4g}"
            )
        result: Array = spline(inside) + np.where(at < x[0], *slopes) * (at - inside)
        return result

    return evaluate


def _third_derivative(x: Array, y: Array) -> float:
    """Return the third derivative of the cubic through four points."""
    return float(
        6.0 * sum(y[i] / np.prod([x[i] - x[j] for j in range(4) if j != i]) for i in range(4))
    )


def _coordinate_elements(joint: ElementTree.Element) -> list[ElementTree.Element]:
    """Return the coordinates of a joint in either layout."""
    return joint.findall("CoordinateSet/objects/Coordinate") + joint.findall(
        "coordinates/Coordinate"
    )


def _coordinate(element: ElementTree.Element) -> OsimCoordinate:
    """Return a coordinate; a malformed range counts as none."""
    try:
        lower, upper = _numbers(element, "range", 2).tolist()
        limits = (lower, upper) if upper > lower else None
    except RecordingError:
        limits = None
    default = _number(element, "default_value", 0.0)
    return OsimCoordinate(element.get("name", ""), default, limits, _flag(element, "locked"))


def _offset(
    body: str, element: ElementTree.Element, location: str, orientation: str
) -> OffsetFrame:
    angles = _numbers(element, orientation, 3, np.zeros(3))
    rotation = scipy.spatial.transform.Rotation.from_euler("XYZ", angles).as_matrix()
    return OffsetFrame(body, rotation, _numbers(element, location, 3, np.zeros(3)))


def _ends_in_body(element: ElementTree.Element, body: str) -> tuple[OffsetFrame, OffsetFrame]:
    """Return parent and child frame of a joint within the element Body, as in OpenSim 3."""
    parent = _text(element, "parent_body").rpartition("/")[2]
    if not parent:
        raise RecordingError("<parent_body> is missing")
    return (
        _offset(parent, element, "location_in_parent", "orientation_in_parent"),
        _offset(body, element, "location", "orientation"),
    )


def _ends_in_set(
    element: ElementTree.Element, others: Mapping[str, ElementTree.Element]
) -> tuple[OffsetFrame, OffsetFrame]:
    """Return parent and child frame of a joint of the JointSet, as in OpenSim 4.

    Args:
        element: element of the joint.
        others: elements PhysicalOffsetFrame by name, outside of joints.
    """
    own = {each.get("name", ""): each for each in element.findall("frames/PhysicalOffsetFrame")}
    frames = {**others, **own}
    return (
        _frame(element, "socket_parent_frame", frames),
        _frame(element, "socket_child_frame", frames),
    )


def _frame(
    element: ElementTree.Element, socket: str, frames: Mapping[str, ElementTree.Element]
) -> OffsetFrame:
    """Return the pose in its body of the frame to which the socket is connected."""
    path = _socket(element, socket)
    rotation = np.eye(3)
    position = np.zeros(3)
    for _ in range(len(frames) + 1):
        holder, _, name = path.rpartition("/")
        if holder.endswith("bodyset") or name == GROUND or name not in frames:
            return OffsetFrame(name, rotation, position)
        inner = _offset("", frames[name], "translation", "orientation")
        position = inner.position + inner.rotation @ position
        rotation = inner.rotation @ rotation
        path = _socket(frames[name], "socket_parent")
    raise RecordingError(f"<{socket}>: the frame {name!r} is in no body")


def _socket(element: ElementTree.Element, tag: str) -> str:
    path = _text(element, tag) or _text(element, f"{tag}_connectee_name")
    if not path:
        raise RecordingError(f"<{tag}> of <{element.tag}> is missing")
    return path


def _joint(element: ElementTree.Element, parent: OffsetFrame, child: OffsetFrame) -> OsimJoint:
    name = element.get("name", "")
    if child.body == GROUND:
        raise RecordingError("its child frame is in the ground")
    try:
        if _flag(element, "reverse"):
            raise RecordingError("it is reversed (from child to parent), which is not read")
        axes = _spatial_axes(element) if element.tag == "CustomJoint" else _simple_axes(element)
    except RecordingError as failure:
        return OsimJoint(name, parent, child, refusal=str(failure))
    rotations, translations = (
        tuple(axis for kind, axis in axes if kind.startswith(first)) for first in "rt"
    )
    return OsimJoint(name, parent, child, rotations, translations)


def _simple_axes(element: ElementTree.Element) -> list[tuple[str, OsimAxis]]:
    """Return the axes of a joint with one coordinate an axis, by "rx", "tx", ..."""
    if element.tag not in _JOINTS:
        raise RecordingError(
            f"{element.tag} is not read; known are CustomJoint, {', '.join(_JOINTS)}"
        )
    motions = _JOINTS[element.tag]
    names = [each.get("name", "") for each in _coordinate_elements(element)]
    if len(names) != len(motions):
        raise RecordingError(
            f"{element.tag} must have {len(motions)} coordinates, has {len(names)}"
        )
    return [
        (motion, OsimAxis(direction(motion[1]), OsimFunction((name,), lambda values: values[0])))
        for motion, name in zip(motions, names, strict=True)
    ]


def _spatial_axes(element: ElementTree.Element) -> list[tuple[str, OsimAxis]]:
    """Return the axes of a CustomJoint by their names, "rotation1", "translation1", ..."""
    transform = element.find("SpatialTransform")
    if transform is None:
        raise RecordingError("<SpatialTransform> is missing")
    axes = []
    for each in transform.findall("TransformAxis"):
        names = tuple(_text(each, "coordinates").split())
        where = each.get("name", "")
        functions = [child for child in each if child.tag not in ("coordinates", "axis")]
        if len(functions) == 1 and functions[0].tag == "function":  # OpenSim 3
            functions = list(functions[0])
        if not functions and not names:
            continue
        if len(functions) != 1:
            raise RecordingError(f"<TransformAxis name={where!r}> must have one function")
        try:
            axis = _numbers(each, "axis", 3)
            function = _function(functions[0], names)
        except RecordingError as failure:
            raise RecordingError(f"<TransformAxis name={where!r}>: {failure}") from None
        length = float(np.linalg.norm(axis))
        if length < _SHORTEST_AXIS:
            raise RecordingError(f"<TransformAxis name={where!r}> has the axis 0 0 0")
        kind = where if where.startswith("rotation") else "translation"
        axes.append((kind, OsimAxis(axis / length, function)))
    return axes
