"""The look of people: figures of wood, in the proportions of their models.

The forms of the parts of a person are in proportion to the lengths and radii of its capsules.
Axes are those of the joint that carries a part: x to the right, y forward, z up, with the arm
hanging and the palm towards the body. The forms of the right arm are given; those of the left are
their mirror images. The proportions within a part are an artist's, not measurements.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.look import Colour, Mesh, Surface, ellipsoid, loft, moved, strut
from geodesic_ocp.model.anthropometry import PersonArm, PersonTrunk, person_arms, person_trunks
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, Capsule

_BODY: Colour = (0.85, 0.76, 0.65)
_JOINT: Colour = (0.71, 0.60, 0.48)

# Rows of z, centre x and y, half width along x and half depth along y; see `loft`.
_Rows: TypeAlias = Sequence[tuple[float, float, float, float, float]]

# z per length, the others per radius.
_UPPER_ARM: _Rows = (
    (-1.0, 0.0, 0.00, 0.78, 0.80),
    (-0.85, 0.0, 0.02, 0.84, 0.88),
    (-0.5, 0.0, 0.08, 1.00, 1.10),
    (-0.2, 0.0, 0.03, 1.10, 1.16),
    (0.0, 0.0, 0.00, 1.08, 1.12),
)
_FOREARM: _Rows = (
    (-1.0, 0.0, 0.00, 0.60, 0.72),
    (-0.75, 0.0, 0.00, 0.72, 0.80),
    (-0.28, 0.0, 0.04, 1.10, 1.12),
    (0.0, 0.0, 0.00, 0.90, 0.92),
)
# z, x, y and depth per length, width (across the palm's plane) per radius.
_PALM: _Rows = (
    (-1.0, -0.140, 0.000, 0.30, 0.085),
    (-0.80, -0.078, 0.000, 0.44, 0.158),
    (-0.55, -0.022, 0.000, 0.56, 0.205),
    (-0.40, -0.006, 0.003, 0.62, 0.208),
    (-0.14, 0.000, 0.002, 0.76, 0.150),
    (0.0, 0.000, 0.000, 0.80, 0.130),
)
_THUMB = ((0.0, 0.09, -0.13), (-0.045, 0.235, -0.34), (-0.075, 0.285, -0.54))  # per length
_THUMB_RADII = (0.56, 0.47, 0.36)  # per radius
# z per length, widths per distance of the shoulders from the middle, depths per radius.
_THORAX: _Rows = (
    (-1.04, 0.0, -0.02, 0.58, 0.72),
    (-0.80, 0.0, 0.02, 0.66, 0.84),
    (-0.42, 0.0, 0.10, 0.79, 1.00),
    (-0.15, 0.0, 0.04, 0.83, 0.92),
    (0.0, 0.0, -0.06, 0.79, 0.70),
    (0.09, 0.0, -0.14, 0.54, 0.55),
    (0.17, 0.0, -0.18, 0.30, 0.45),
)
# z per length of the abdomen, the others per its radius.
_ABDOMEN: _Rows = (
    (-0.9, 0.0, 0.0, 0.84, 0.60),
    (0.5, 0.0, 0.02, 0.73, 0.54),
    (1.7, 0.0, 0.0, 0.80, 0.58),
)
_PELVIS: _Rows = (
    (-1.75, 0.0, -0.02, 0.70, 0.52),
    (-1.1, 0.0, -0.06, 1.08, 0.72),
    (-0.7, 0.0, -0.05, 1.10, 0.73),
    (-0.1, 0.0, -0.02, 0.98, 0.66),
    (0.35, 0.0, 0.0, 0.86, 0.60),
)
# z per height of the head, from its lower end; the others per radius.
_HEAD: _Rows = (
    (0.0, 0.0, 0.34, 0.46, 0.58),
    (0.15, 0.0, 0.20, 0.70, 0.86),
    (0.4, 0.0, 0.06, 0.90, 1.12),
    (0.65, 0.0, 0.00, 0.98, 1.22),
    (0.80, 0.0, -0.02, 0.99, 1.22),
    (1.0, 0.0, -0.03, 0.98, 1.20),
)
_NECK = ((-0.30, -0.24), (0.30, -0.02))  # z per height of the head, y per radius
_NECK_RADII = (0.66, 0.58)  # per radius of the head


def person(model: Model) -> tuple[list[Mesh], list[Body]]:
    """Get meshes of the arms and trunks of people in a model, and its bodies that these replace."""
    meshes = list[Mesh]()
    bodies = list[Body]()
    for arm in person_arms(model):
        meshes += _arm(model, arm)
        bodies += arm.bodies
    for trunk in person_trunks(model):
        meshes += _trunk(model, trunk)
        bodies += trunk.bodies
    return meshes, bodies


def _arm(model: Model, arm: PersonArm) -> Iterator[Mesh]:
    parts = zip((_upper_arm, _forearm, _hand), arm.bodies, arm.lengths, strict=True)
    for form, body, length in parts:
        # Forms are in axes of the joint that carries the link.
        frame = model.pin.frames[frame_index(model.pin, str(body.link))]
        inverse = frame.placement.inverse()
        for surfaces, colour in zip(form(length, body.radius), (_BODY, _JOINT), strict=True):
            for surface in surfaces:
                right = surface if arm.side == "right" else mirrored(surface)
                placed = moved(right, inverse.rotation, inverse.translation)
                yield Mesh(str(body.link), *placed, colour)


def _trunk(model: Model, trunk: PersonTrunk) -> Iterator[Mesh]:
    abdomen, thorax, head = trunk.bodies
    # Chest and shoulders, from the height of the shoulders down.
    height = abs(thorax.end[2] - thorax.start[2])
    wide = trunk.half_width
    rows = np.array(_THORAX) * [height, wide, thorax.radius, wide, thorax.radius]
    chest = loft(rows, (0.30 * height, 0.05 * height), roundness=2.3)
    yield Mesh(str(thorax.link), *chest, _BODY)
    # From below the lumbar joint, at the origin, into the thorax.
    length = abs(abdomen.end[2] - abdomen.start[2])
    belly = loft(_scaled(_ABDOMEN, length, abdomen.radius), (0.6 * length, 0.6 * length))
    yield Mesh(str(abdomen.link), *belly, _JOINT)
    for surface, colour in zip(_head(head), (_BODY, _JOINT), strict=True):
        yield Mesh(str(head.link), *surface, colour)
    # Below the lumbar joint, at the origin.
    rows = _scaled(_PELVIS, length, abdomen.radius)
    pelvis = loft(rows, (1.1 * length, 0.6 * length), roundness=2.2)
    place = model.pin.jointPlacements[trunk.lumbar]
    parent = model.pin.parents[trunk.lumbar]
    base = next(str(each.name) for each in model.pin.frames if each.parentJoint == parent)
    yield Mesh(base, *moved(pelvis, place.rotation, place.translation), _BODY)


def mirrored(surface: Surface) -> Surface:
    """Return the surface on the other side of the sagittal plane."""
    vertices, triangles = surface
    return vertices * [-1.0, 1.0, 1.0], triangles[:, ::-1]


def _upper_arm(length: float, radius: float) -> tuple[list[Surface], list[Surface]]:
    """Return limb, and balls at shoulder and elbow."""
    limb = loft(_scaled(_UPPER_ARM, length, radius), (0.5 * radius, 0.8 * radius))
    elbow, triangles = ellipsoid(0.86 * radius)
    return [limb], [ellipsoid(1.2 * radius), (elbow - [0.0, 0.0, length], triangles)]


def _forearm(length: float, radius: float) -> tuple[list[Surface], list[Surface]]:
    """Return limb, and a ball at the wrist."""
    limb = loft(_scaled(_FOREARM, length, radius), (0.4 * radius, 0.8 * radius))
    wrist, triangles = ellipsoid(radius * np.array([0.62, 0.72, 0.62]))
    return [limb], [(wrist - [0.0, 0.0, length], triangles)]


def _hand(length: float, radius: float) -> tuple[list[Surface], list[Surface]]:
    """Return palm with fingers, and the thumb, of a right hand."""
    rows = np.array(_PALM) * [length, length, length, radius, length]
    palm = loft(rows, (0.09 * length, 0.1 * length))
    bends = length * np.array(_THUMB)
    radii = [radius * each for each in _THUMB_RADII]
    thumb = (strut(*each) for each in zip(bends[:-1], bends[1:], pairwise(radii), strict=True))
    return [palm, *thumb], []


def _head(body: Capsule) -> tuple[Surface, Surface]:
    """Return head from chin to crown, and neck; heights [m] are above the shoulders."""
    low = body.start[2]
    height = body.end[2] - body.start[2]
    radius = body.radius
    rows = np.add(_scaled(_HEAD, height, radius), [low, 0.0, 0.0, 0.0, 0.0])
    ends = [np.array([0.0, y * radius, low + z * height]) for z, y in _NECK]
    neck = strut(ends[0], ends[1], (_NECK_RADII[0] * radius, _NECK_RADII[1] * radius))
    return loft(rows, (0.15 * height, 0.42 * height)), neck


def _scaled(rows: ArrayLike, length: float, radius: float) -> Array:
    return np.array(rows, dtype=float) * [length, radius, radius, radius, radius]
