"""OsimModel: the bodies, joints and coordinates of an OpenSim model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias
from xml.etree import ElementTree

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.mmm import xml_root

#: A function of n coordinates at k samples: (n, k) to (k,).
OsimFunction: TypeAlias = Callable[[Array], Array]

GROUND = "ground"
_COUPLED = 100  # coordinates one after the other


@dataclass(frozen=True, eq=False, repr=False)
class OffsetFrame:
    """A frame at a fixed pose in a body: rotation (3, 3) to the body's axes, position (3,) [m]."""

    body: str
    rotation: Array
    position: Array

    def __repr__(self) -> str:
        return f"OffsetFrame(in {self.body!r} at {self.position.tolist()})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimAxis:
    """A rotation about an axis (3,), or a translation along it, by a function of coordinates."""

    axis: Array
    coordinates: tuple[str, ...]
    function: OsimFunction

    def __repr__(self) -> str:
        return f"OsimAxis({self.axis.tolist()} of {', '.join(self.coordinates) or 'nothing'})"


@dataclass(frozen=True)
class OsimCoordinate:
    """A coordinate: its default value, its range [rad or m] if it has one, and whether locked."""

    name: str
    default: float = 0.0
    range: tuple[float, float] | None = None
    locked: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class OsimJoint:
    """A joint: where its child frame is in its parent frame.

    The rotation is the product of the rotations about the axes, each turned by those before it; the
    position is the sum of the translations along axes of the parent frame.

    Attributes:
        name: name of the joint.
        parent: frame in the parent body.
        child: frame in the child body.
        rotations: in their order.
        translations: in any order.
        refusal: why the joint's motion cannot be computed, if it cannot.
    """

    name: str
    parent: OffsetFrame
    child: OffsetFrame
    rotations: tuple[OsimAxis, ...] = ()
    translations: tuple[OsimAxis, ...] = ()
    refusal: str = ""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates that the joint moves with."""
        axes = (*self.rotations, *self.translations)
        return tuple(dict.fromkeys(name for axis in axes for name in axis.coordinates))

    def __repr__(self) -> str:
        return f"OsimJoint({self.name!r}: {self.parent.body} to {self.child.body})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimCoupler:
    """A coordinate that is a function of others."""

    independent: tuple[str, ...]
    function: OsimFunction

    def __repr__(self) -> str:
        return f"OsimCoupler(of {', '.join(self.independent)})"


@dataclass(frozen=True, eq=False, repr=False)
class OsimModel:
    """A model's tree of bodies.

    Attributes:
        file: file that it is from, for messages.
        bodies: names, without the ground.
        joints: joints by the body that they carry.
        coordinates: coordinates by name.
        couplers: couplers by dependent coordinate.
        gravity: (3,) [m/s^2] in axes of the ground.
    """

    file: Path
    bodies: tuple[str, ...]
    joints: Mapping[str, OsimJoint]
    coordinates: Mapping[str, OsimCoordinate]
    couplers: Mapping[str, OsimCoupler] = field(default_factory=dict)
    gravity: Array = field(default_factory=lambda: np.zeros(3))

    def path(self, body: str, start: str = GROUND) -> tuple[OsimJoint, ...]:
        """Return the joints from a body that carries another one (or the ground) to that other one.

        Raises:
            RecordingError: there is no such way, or one of its joints cannot be computed.
        """
        way: list[OsimJoint] = []
        at = body
        while at != start:
            joint = self.joints.get(at)
            if joint is None or len(way) > len(self.joints):
                raise RecordingError(
                    f"{self.file}: no joints lead from the body {start!r} to the body {body!r}"
                )
            if joint.refusal:
                raise RecordingError(f"{self.file}: joint {joint.name!r}: {joint.refusal}")
            way.append(joint)
            at = joint.parent.body
        return tuple(reversed(way))

    def independent(self, joints: tuple[OsimJoint, ...]) -> tuple[str, ...]:
        """Return the coordinates that move these joints; in place of coupled ones, those that move
        them.

        Raises:
            RecordingError: couplers depend on one another in a circle, or a coordinate is missing.
        """
        found: dict[str, None] = {}
        followed: set[str] = set()

        def follow(name: str, behind: tuple[str, ...]) -> None:
            if name in behind or len(behind) > _COUPLED:
                raise RecordingError(f"{self.file}: the coordinate {name!r} is coupled to itself")
            if name in followed:
                return
            if name in self.couplers:
                for other in self.couplers[name].independent:
                    follow(other, (*behind, name))
            elif name not in self.coordinates:
                raise RecordingError(f"{self.file}: there is no coordinate {name!r}")
            else:
                found[name] = None
            followed.add(name)

        for joint in joints:
            for name in joint.coordinates:
                follow(name, ())
        return tuple(found)

    @property
    def rotations(self) -> tuple[str, ...]:
        """Coordinates that rotate."""
        axes = [axis for joint in self.joints.values() for axis in joint.rotations]
        return tuple(dict.fromkeys(name for axis in axes for name in axis.coordinates))

    @property
    def translations(self) -> tuple[str, ...]:
        """Coordinates that translate and do not rotate."""
        axes = [axis for joint in self.joints.values() for axis in joint.translations]
        moving = dict.fromkeys(name for axis in axes for name in axis.coordinates)
        return tuple(name for name in moving if name not in self.rotations)

    def __repr__(self) -> str:
        return (
            f"OsimModel({self.file.name!r}: {len(self.bodies)} bodies, "
            f"{len(self.coordinates)} coordinates)"
        )


_BEYOND = 0.01  # of the spline's width


def simm_spline(x: Array, y: Array) -> OsimFunction:
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
    count, step, slope = len(x), np.diff(x), np.diff(y) / np.diff(x)
    matrix, right = np.zeros((count, count)), np.zeros(count)  # of the second derivatives
    for i in range(1, count - 1):
        matrix[i, i - 1 : i + 2] = step[i - 1], 2.0 * (step[i - 1] + step[i]), step[i]
        right[i] = 6.0 * (slope[i] - slope[i - 1])
    for end, inner, width, four in (
        (0, 1, step[0], slice(0, 4)),
        (-1, -2, -step[-1], slice(-4, None)),
    ):
        matrix[end, [end, inner]] = -1.0, 1.0
        right[end] = width * _third_derivative(x[four], y[four]) if count > 3 else 0.0
    second = np.zeros(2) if count == 2 else np.linalg.solve(matrix, right)
    slopes = np.append(
        slope - step * (2.0 * second[:-1] + second[1:]) / 6.0,
        slope[-1] + step[-1] * (second[-2] + 2.0 * second[-1]) / 6.0,
    )
    spline = scipy.interpolate.CubicHermiteSpline(x, y, slopes)

    def evaluate(values: Array) -> Array:
        at = values[0]
        inside = np.clip(at, x[0], x[-1])
        worst = int(np.argmax(np.abs(at - inside)))
        if abs(at[worst] - inside[worst]) > _BEYOND * (x[-1] - x[0]):
            raise RecordingError(
                f"a SimmSpline of the model has points from {x[0]:.4g} to {x[-1]:.4g}, but its "
                f"coordinate is {at[worst]:.4g}"
            )
        beyond = np.where(at < x[0], slopes[0], slopes[-1])
        result: Array = spline(inside) + beyond * (at - inside)
        return result

    return evaluate


def _third_derivative(x: Array, y: Array) -> float:
    """Return the third derivative of the cubic through four points."""
    return float(
        6.0 * sum(y[i] / np.prod([x[i] - x[j] for j in range(4) if j != i]) for i in range(4))
    )


_LARGEST = 1e6  # of any length [m], angle [rad] or coefficient
_NARROWEST = 1e-9  # between two points of a spline


def model_element(file: Path) -> ElementTree.Element:
    """Return the element Model of the file.

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
    """Return text of a child element without blanks around it; "" without such a child."""
    return (element.findtext(tag) or "").strip()


def flag(element: ElementTree.Element, tag: str, default: bool = False) -> bool:
    """Return whether a child element says true."""
    text = text_of(element, tag).lower()
    return text in ("true", "1") if text else default


def numbers(
    element: ElementTree.Element, tag: str, size: int | None = None, default: Array | None = None
) -> Array:
    """Return the numbers of a child element; without it the default.

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
    """Return the function of `count` coordinates in an element such as LinearFunction.

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
_SHORTEST_AXIS = 1e-6


def joint_of_body(body: str, element: ElementTree.Element) -> OsimJoint:
    """Return the joint within the element Body of this name, as in OpenSim 3.

    Raises:
        RecordingError: an element is missing or malformed; names it.
    """
    parent = text_of(element, "parent_body").rpartition("/")[2]
    if not parent:
        raise RecordingError("<parent_body> is missing")
    return _joint(
        element,
        _offset(parent, element, "location_in_parent", "orientation_in_parent"),
        _offset(body, element, "location", "orientation"),
        _children(element, "CoordinateSet/objects"),
    )


def joint_of_set(
    element: ElementTree.Element, others: Mapping[str, ElementTree.Element]
) -> OsimJoint:
    """Return a joint of the JointSet, as in OpenSim 4.

    Args:
        element: element of the joint.
        others: elements PhysicalOffsetFrame by name, outside of joints.

    Raises:
        RecordingError: an element is missing or malformed; names it.
    """
    frames = {each.get("name", ""): each for each in element.findall("frames/PhysicalOffsetFrame")}
    ends = [_frame(element, f"socket_{end}_frame", frames, others) for end in ("parent", "child")]
    return _joint(element, ends[0], ends[1], _children(element, "coordinates"))


def _children(element: ElementTree.Element, path: str) -> list[ElementTree.Element]:
    return element.findall(f"{path}/Coordinate")


def coordinates_of(element: ElementTree.Element) -> list[OsimCoordinate]:
    """Return the coordinates of a joint in either layout; a malformed range counts as none."""
    found = []
    for each in (*_children(element, "CoordinateSet/objects"), *_children(element, "coordinates")):
        try:
            lower, upper = numbers(each, "range", 2)
            limits = (float(lower), float(upper)) if upper > lower else None
        except RecordingError:
            limits = None
        default = float(numbers(each, "default_value", 1, np.zeros(1))[0])
        name = each.get("name", "")
        found.append(OsimCoordinate(name, default, limits, flag(each, "locked")))
    return found


def _offset(
    body: str, element: ElementTree.Element, location: str, orientation: str
) -> OffsetFrame:
    angles = numbers(element, orientation, 3, np.zeros(3))
    rotation = scipy.spatial.transform.Rotation.from_euler("XYZ", angles).as_matrix()
    return OffsetFrame(body, rotation, numbers(element, location, 3, np.zeros(3)))


def _frame(
    element: ElementTree.Element,
    socket: str,
    frames: Mapping[str, ElementTree.Element],
    others: Mapping[str, ElementTree.Element],
) -> OffsetFrame:
    """Return the pose in its body of the frame to which the socket is connected."""
    path = _socket(element, socket)
    rotation, position = np.eye(3), np.zeros(3)
    for _ in range(len(frames) + len(others) + 1):
        holder, _, name = path.rpartition("/")
        is_body = holder.endswith("bodyset") or name == GROUND
        offset = None if is_body else frames.get(name, others.get(name))
        if offset is None:
            return OffsetFrame(name, rotation, position)
        inner = _offset("", offset, "translation", "orientation")
        position = inner.position + inner.rotation @ position
        rotation = inner.rotation @ rotation
        path = _socket(offset, "socket_parent")
    raise RecordingError(f"<{socket}>: the frame {name!r} is in no body")


def _socket(element: ElementTree.Element, tag: str) -> str:
    path = text_of(element, tag) or text_of(element, f"{tag}_connectee_name")
    if not path:
        raise RecordingError(f"<{tag}> of <{element.tag}> is missing")
    return path


def _joint(
    element: ElementTree.Element,
    parent: OffsetFrame,
    child: OffsetFrame,
    coordinates: list[ElementTree.Element],
) -> OsimJoint:
    name = element.get("name", "")
    if child.body == GROUND:
        raise RecordingError("its child frame is in the ground")
    try:
        if flag(element, "reverse"):
            raise RecordingError("it is reversed (from child to parent), which is not read")
        if element.tag == "CustomJoint":
            rotations, translations = _spatial_transform(element)
        else:
            names = [each.get("name", "") for each in coordinates]
            rotations, translations = _simple(element.tag, names)
    except RecordingError as failure:
        return OsimJoint(name, parent, child, refusal=str(failure))
    return OsimJoint(name, parent, child, rotations, translations)


def _simple(kind: str, names: list[str]) -> tuple[tuple[OsimAxis, ...], tuple[OsimAxis, ...]]:
    if kind not in _JOINTS:
        raise RecordingError(f"{kind} is not read; known are CustomJoint, {', '.join(_JOINTS)}")
    motions = _JOINTS[kind]
    if len(names) != len(motions):
        raise RecordingError(f"{kind} must have {len(motions)} coordinates, has {len(names)}")
    axes = {
        motion: OsimAxis(np.eye(3)["xyz".index(motion[1])], (name,), _identity)
        for motion, name in zip(motions, names, strict=True)
    }
    return (
        tuple(axis for motion, axis in axes.items() if motion[0] == "r"),
        tuple(axis for motion, axis in axes.items() if motion[0] == "t"),
    )


def _identity(values: Array) -> Array:
    first: Array = values[0]
    return first


def _spatial_transform(
    element: ElementTree.Element,
) -> tuple[tuple[OsimAxis, ...], tuple[OsimAxis, ...]]:
    transform = element.find("SpatialTransform")
    if transform is None:
        raise RecordingError("<SpatialTransform> is missing")
    rotations: list[OsimAxis] = []
    translations: list[OsimAxis] = []
    for each in transform.findall("TransformAxis"):
        names = tuple(text_of(each, "coordinates").split())
        where = each.get("name", "")
        functions = [child for child in each if child.tag not in ("coordinates", "axis")]
        if len(functions) == 1 and functions[0].tag == "function":  # OpenSim 3
            functions = list(functions[0])
        if not functions and not names:
            continue
        if len(functions) != 1:
            raise RecordingError(f"<TransformAxis name={where!r}> must have one function")
        try:
            axis = numbers(each, "axis", 3)
            function = read_function(functions[0], len(names))
        except RecordingError as failure:
            raise RecordingError(f"<TransformAxis name={where!r}>: {failure}") from None
        length = float(np.linalg.norm(axis))
        if length < _SHORTEST_AXIS:
            raise RecordingError(f"<TransformAxis name={where!r}> has the axis 0 0 0")
        axes = rotations if where.startswith("rotation") else translations
        axes.append(OsimAxis(axis / length, names, function))
    return tuple(rotations), tuple(translations)


def body_poses(
    model: OsimModel, values: Mapping[str, Array], bodies: Iterable[str]
) -> dict[str, tuple[Array, Array]]:
    """Return rotations (k, 3, 3) to the ground and positions (k, 3) [m] of bodies.

    Coordinates without values follow their couplers, or have their default values.

    Args:
        model: model of the bodies.
        values: values by coordinate, (k,) [rad or m].
        bodies: names.

    Raises:
        RecordingError: a body is not connected to the ground, or a joint on the way cannot be
            computed.
    """
    count = max((len(each) for each in values.values()), default=1)
    complete = dict(values)
    still = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    poses: dict[str, tuple[Array, Array]] = {GROUND: still}
    for body in bodies:
        way = model.path(body)
        model.independent(way)  # refuses couplers in circles
        for joint in way:
            if joint.child.body not in poses:
                for name in joint.coordinates:
                    _complete(model, name, complete, count)
                poses[joint.child.body] = _moved(joint, complete, *poses[joint.parent.body])
    return {body: poses[body] for body in bodies}


def _complete(model: OsimModel, name: str, values: dict[str, Array], count: int) -> None:
    """Add the values of a coordinate, after those that it depends on."""
    if name in values:
        return
    if name in model.couplers:
        coupler = model.couplers[name]
        for other in coupler.independent:
            _complete(model, other, values, count)
        values[name] = coupler.function(np.stack([values[each] for each in coupler.independent]))
    else:
        values[name] = np.full(count, model.coordinates[name].default)


def _moved(
    joint: OsimJoint, values: Mapping[str, Array], rotation: Array, position: Array
) -> tuple[Array, Array]:
    """Return the pose of the child body from that of the parent body."""
    count = len(position)

    def amount(axis: OsimAxis) -> Array:
        arguments = [values[name] for name in axis.coordinates]
        return axis.function(np.array(arguments).reshape(len(arguments), count))

    position = position + rotation @ joint.parent.position
    rotation = rotation @ joint.parent.rotation
    for axis in joint.translations:
        position = position + (rotation @ axis.axis) * amount(axis)[:, None]
    for axis in joint.rotations:
        turn = scipy.spatial.transform.Rotation.from_rotvec(amount(axis)[:, None] * axis.axis)
        rotation = rotation @ turn.as_matrix()
    rotation = rotation @ joint.child.rotation.T
    return rotation, position - rotation @ joint.child.position
