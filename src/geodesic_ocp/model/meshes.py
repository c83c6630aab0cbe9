"""Meshes of a model's links, and of the rest of a person whose arms alone are a model."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.anthropometry import PersonArm, person_arms, person_trunks, shoulder_joint
from geodesic_ocp.model.human import human_arm, human_upper_body, stature
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.look import Mesh, body_mesh, kinematic_chain, visual_geometry
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.person_look import mirrored, person
from geodesic_ocp.model.simplification import simplified

MAX_TRIANGLES = 60000  # per model, which keeps a page with four robots below a few MB
_known: WeakKeyDictionary[Model, tuple[Mesh, ...]] = WeakKeyDictionary()
_TALLEST, _HEAVIEST = 3.0, 1000.0  # [m], [kg], of the models of people
_WIDTHS = (0.5, 2.0)  # of the shoulders, relative to those of the table
_LEVEL = 0.2  # least distance between shoulders along one axis, over that across it
_OPPOSITE = {"right": "left", "left": "right"}


def meshes(model: Model) -> tuple[Mesh, ...]:
    """Return triangle meshes of the links of a model, for display only.

    They show the visual geometry of the URDF or MJCF file from which the model was loaded; if there
    is none, or with a warning if it cannot be read, its collision bodies. Of a person (`human_arm`,
    `human_upper_body`, also within `combine`) those are drawn as a human body in the proportions of
    the model. Moving links without either are drawn from the kinematic chain: joints along their
    axes, and struts between them. The result is deterministic, and kept as long as the model is.

    >>> import geodesic_ocp as go
    >>> from geodesic_ocp.model.meshes import meshes
    >>> sorted({mesh.link for mesh in meshes(go.human_arm("right"))})
    ['right forearm', 'right hand', 'right upper arm']
    """
    if model not in _known:
        # Links of other models in the file, such as a robot's second arm, are not in this one.
        found = [mesh for mesh in _geometry(model) if model.pin.existFrame(mesh.link)]
        found += kinematic_chain(model, {model.joint_of(mesh.link) for mesh in found})
        moving = [model.moves(mesh.link) for mesh in found]
        _known[model] = tuple(simplified(found, moving, MAX_TRIANGLES))
    return _known[model]


def _geometry(model: Model) -> list[Mesh]:
    if isinstance(model.shapes, LinkGeometry):
        try:
            if visual := list(visual_geometry(model.shapes)):
                return visual
        except Exception as error:  # from Pinocchio: a mesh is missing, or of an unknown type
            reason = " ".join(str(error).split())
            said = "is drawn without its visual geometry, which cannot be read"
            warnings.warn(f"{model.name} {said}: {reason}", stacklevel=2)
    try:
        bodies = model.bodies
    except ValueError:  # the collision geometry cannot be read either
        return []
    found, replaced = person(model)
    return found + [body_mesh(each) for each in bodies if each.link and each not in replaced]


def person_beside(model: Model) -> tuple[tuple[Mesh, ...], Array, Array] | None:
    """Return trunk, head and, beside a single arm, the other arm, in the base frame of the model,
    at rest.

    The body height is that of `stature`, from the lengths of upper arm and forearm; the mass is
    that of a person whose upper arm has this volume. Trunk and head are those of
    `human_upper_body`, as wide as the shoulders of both arms demand; the other arm is the hanging
    mirror image of the one that the model has.

    Args:
        model: model of `human_arm`, or a right and a left one of `combine` with shoulders side by
            side.

    Returns:
        Meshes, and the rotation (3, 3) and position (3,) [m] of their common frame in the base
        frame; None for a model that is not one or both arms of a person, or that has a trunk.
    """
    arms, height = person_arms(model), stature(model)
    sides = {arm.side: arm for arm in arms}
    only_arms = model.dof == 7 * len(arms) == 7 * len(sides) and not person_trunks(model)
    if not arms or not only_arms or height is None or height > _TALLEST:
        return None
    person = _whole(height, _mass(arms[0], height))
    half_width = person_trunks(person)[0].half_width
    rest = {side: _at_rest(model, shoulder_joint(model, arm)) for side, arm in sides.items()}
    turn, width = rest[arms[0].side][0], 1.0
    if len(arms) == 2:
        (right_turn, right), (left_turn, left) = rest["right"], rest["left"]
        apart = (right - left) @ right_turn
        width = float(apart[0]) / (2.0 * half_width)
        level = np.abs(apart[1:]).max() <= _LEVEL * np.linalg.norm(apart)
        if not (np.allclose(right_turn, left_turn) and level and _WIDTHS[0] < width < _WIDTHS[1]):
            return None
        collar = (right + left) / 2.0
    else:
        outward = 1.0 if arms[0].side == "right" else -1.0
        collar = rest[arms[0].side][1] - outward * half_width * turn[:, 0]

    own = np.eye(3), _at_rest(person, "thorax")[1]
    drawn = {str(body.link) for arm in person_arms(person) for body in arm.bodies}
    parts = [_placed(mesh, person, own) for mesh in meshes(person) if mesh.link not in drawn]
    parts = [
        replace(part, vertices=part.vertices * [1.0 if part.link == "head" else width, 1.0, 1.0])
        for part in parts
    ]
    if len(arms) == 1:
        links = {str(body.link) for body in arms[0].bodies}
        there = [mesh for mesh in meshes(model) if mesh.link in links]
        parts += [_mirrored(_placed(each, model, (turn, collar)), arms[0].side) for each in there]
    return tuple(parts), turn, collar


@lru_cache(maxsize=8)
def _whole(height: float, mass: float) -> Model:
    """Return the person, whose meshes are kept as long as the model is."""
    return human_upper_body(height, mass)


def _mass(arm: PersonArm, height: float) -> float:
    """Return mass [kg] of a person of this height whose upper arm has the volume that the arm's
    has.
    """
    one = human_arm(arm.side, height, 1.0)
    volumes = [each.bodies[0].radius ** 2 * each.lengths[0] for each in (arm, *person_arms(one))]
    return min(float(volumes[0] / volumes[1]), _HEAVIEST)


def _at_rest(model: Model, frame: str) -> tuple[Array, Array]:
    """Return rotation and position of a frame at q = 0, where axes are those of the base."""
    data, index = model.pin.createData(), frame_index(model.pin, frame)
    pin.forwardKinematics(model.pin, data, np.zeros(model.dof))  # far faster than a symbolic one
    place = pin.updateFramePlacement(model.pin, data, index)
    return np.array(place.rotation), np.array(place.translation)


def _placed(mesh: Mesh, model: Model, origin: tuple[Array, Array]) -> Mesh:
    """Return the mesh at q = 0 in the axes of an origin in the base frame of the model."""
    rotation, position = _at_rest(model, mesh.link)
    points = mesh.vertices @ rotation.T + position
    return replace(mesh, vertices=(points - origin[1]) @ origin[0])


def _mirrored(mesh: Mesh, side: str) -> Mesh:
    """Return the mesh on the other side of the sagittal plane."""
    link = mesh.link.replace(side, _OPPOSITE[side]) if side in mesh.link else f"other {mesh.link}"
    return Mesh(link, *mirrored((mesh.vertices, mesh.triangles)), mesh.colour)
