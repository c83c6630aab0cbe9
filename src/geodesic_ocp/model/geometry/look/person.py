"""What people look like: calm figures of wood, in the proportions of their models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from geodesic_ocp.model.geometry.look import person_forms as forms
from geodesic_ocp.model.geometry.look.mesh import Colour, Mesh
from geodesic_ocp.model.geometry.look.surfaces import Surface, moved
from geodesic_ocp.model.human.person_segments import (
    PersonArm,
    PersonTrunk,
    person_arms,
    person_trunks,
)
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body

_BODY: Colour = (0.85, 0.76, 0.65)
_JOINT: Colour = (0.71, 0.60, 0.48)


def person(model: Model) -> tuple[list[Mesh], list[Body]]:
    """Meshes of the arms and trunks of people in a model, and its bodies that these replace."""
    arms, trunks = person_arms(model), person_trunks(model)
    meshes = [mesh for arm in arms for mesh in _arm(model, arm)]
    meshes += [mesh for trunk in trunks for mesh in _trunk(model, trunk)]
    return meshes, [
        body
        for bodies in (*(arm.bodies for arm in arms), *(each.bodies for each in trunks))
        for body in bodies
    ]


def _arm(model: Model, arm: PersonArm) -> Iterator[Mesh]:
    parts = zip((forms.upper_arm, forms.forearm, forms.hand), arm.bodies, arm.lengths, strict=True)
    for form, body, length in parts:
        for surfaces, colour in zip(form(length, body.radius), (_BODY, _JOINT), strict=True):
            right = surfaces if arm.side == "right" else map(_mirrored, surfaces)
            yield from _on_joint(model, str(body.link), right, colour)


def _trunk(model: Model, trunk: PersonTrunk) -> Iterator[Mesh]:
    abdomen, thorax, head = trunk.bodies
    lengths = [abs(body.end[2] - body.start[2]) for body in (abdomen, thorax)]
    chest = forms.thorax(lengths[1], thorax.radius, trunk.half_width)
    belly = forms.abdomen(lengths[0], abdomen.radius)
    yield Mesh(str(thorax.link), *chest, _BODY)
    yield Mesh(str(abdomen.link), *belly, _JOINT)
    skull, neck = forms.head(head.start[2], head.end[2], head.radius)
    for surfaces, colour in ((skull, _BODY), (neck, _JOINT)):
        yield from (Mesh(str(head.link), *surface, colour) for surface in surfaces)
    place = model.pin.jointPlacements[trunk.lumbar]
    pelvis = moved(forms.pelvis(lengths[0], abdomen.radius), place.rotation, place.translation)
    parent = model.pin.parents[trunk.lumbar]
    base = next(str(each.name) for each in model.pin.frames if each.parentJoint == parent)
    yield Mesh(base, *pelvis, _BODY)


def _mirrored(surface: Surface) -> Surface:
    vertices, triangles = surface
    return vertices * [-1.0, 1.0, 1.0], triangles[:, ::-1]


def _on_joint(
    model: Model, link: str, surfaces: Iterable[Surface], colour: Colour
) -> Iterator[Mesh]:
    """Surfaces in axes of the joint that carries a link, as meshes in those of the link."""
    inverse = model.pin.frames[frame_index(model.pin, link)].placement.inverse()
    for surface in surfaces:
        vertices, triangles = moved(surface, inverse.rotation, inverse.translation)
        yield Mesh(link, np.asarray(vertices), triangles, colour)
