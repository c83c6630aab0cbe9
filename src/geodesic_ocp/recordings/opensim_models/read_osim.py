"""read_osim: an OpenSim model from its file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.opensim_models.osim_joints import (
    coordinates_of,
    joint_of_body,
    joint_of_set,
)
from geodesic_ocp.recordings.opensim_models.osim_model import (
    OsimCoordinate,
    OsimCoupler,
    OsimFunction,
    OsimJoint,
    OsimModel,
)
from geodesic_ocp.recordings.opensim_models.osim_xml import (
    flag,
    model_element,
    numbers,
    read_function,
    text_of,
)

_METRES = ("", "meters", "meter", "metres", "metre", "m")


def read_osim(file: Path) -> OsimModel:
    """Read the bodies, joints, coordinates and couplers of a model (.osim).

    Joints of unknown kinds, or with unknown functions, matter only where a motion needs them.

    Raises:
        RecordingError: the file is missing or malformed, or lengths are not in metres; names the
            element and the reason.
    """
    model = model_element(file)
    try:
        return _model(file, model)
    except RecordingError as failure:
        if str(failure).startswith(str(file)):
            raise
        raise RecordingError(f"{file}: {failure}") from None


def _model(file: Path, model: ElementTree.Element) -> OsimModel:
    unit = text_of(model, "length_units").lower()
    if unit not in _METRES:
        raise RecordingError(f"<length_units> must be meters, is {unit!r}")
    elements = model.findall("BodySet/objects/Body") + model.findall("components/Body")
    bodies = [each.get("name", "") for each in elements]
    joints: dict[str, OsimJoint] = {}
    coordinates: dict[str, OsimCoordinate] = {}
    frames = {
        each.get("name", ""): each
        for path in ("components", "BodySet/objects/Body/components", "Ground/components")
        for each in model.findall(f"{path}/PhysicalOffsetFrame")
    }
    nested = [
        (body.get("name", ""), joint) for body in elements for joint in body.findall("Joint/*")
    ]
    listed = [
        (None, joint)
        for path in ("JointSet/objects", "components")
        for joint in model.findall(f"{path}/*")
        if joint.tag.endswith("Joint")
    ]
    for body, element in nested + listed:
        name = element.get("name", "")
        try:
            joint = joint_of_set(element, frames) if body is None else joint_of_body(body, element)
            found = coordinates_of(element)
        except RecordingError as failure:
            raise RecordingError(f"joint {name!r}: {failure}") from None
        if joint.child.body in joints:
            reason = f"two joints carry the body {joint.child.body!r}"
            joint = OsimJoint(name, joint.parent, joint.child, refusal=reason)
        joints[joint.child.body] = joint
        for coordinate in found:
            if coordinate.name in coordinates:
                raise RecordingError(f"there are two coordinates {coordinate.name!r}")
            coordinates[coordinate.name] = coordinate
    if not joints:
        raise RecordingError("there are no joints in <BodySet> nor in <JointSet>")
    gravity = numbers(model, "gravity", 3, np.zeros(3))
    return OsimModel(file, tuple(bodies), joints, coordinates, _couplers(model), gravity)


def _couplers(model: ElementTree.Element) -> dict[str, OsimCoupler]:
    couplers = {}
    for element in model.findall("ConstraintSet/objects/CoordinateCouplerConstraint"):
        if flag(element, "isDisabled") or not flag(element, "isEnforced", True):
            continue
        dependent = text_of(element, "dependent_coordinate_name")
        independent = tuple(text_of(element, "independent_coordinate_names").split())
        scale = float(numbers(element, "scale_factor", 1, np.ones(1))[0])
        holder = element.find("coupled_coordinates_function")
        try:
            if holder is None or len(holder) != 1 or not independent or not dependent:
                raise RecordingError("needs two names of coordinates and a function")
            function = read_function(holder[0], len(independent))
        except RecordingError as failure:
            raise RecordingError(
                f"CoordinateCouplerConstraint {element.get('name', '')!r}: {failure}"
            ) from None
        couplers[dependent] = OsimCoupler(independent, _scaled(function, scale))
    return couplers


def _scaled(function: OsimFunction, scale: float) -> OsimFunction:
    return lambda values: scale * function(values)
