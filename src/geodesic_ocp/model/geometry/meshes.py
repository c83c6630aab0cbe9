"""What the links of a model look like."""

from __future__ import annotations

import warnings
from weakref import WeakKeyDictionary

from geodesic_ocp.model.geometry.link_geometry import LinkGeometry
from geodesic_ocp.model.geometry.look.kinematic_chain import kinematic_chain
from geodesic_ocp.model.geometry.look.mesh import Colour, Indices, Mesh
from geodesic_ocp.model.geometry.look.person import person
from geodesic_ocp.model.geometry.look.simplified import simplified
from geodesic_ocp.model.geometry.look.visual_geometry import body_mesh, visual_geometry
from geodesic_ocp.model.model import Model

__all__ = ["MAX_TRIANGLES", "Colour", "Indices", "Mesh", "meshes"]

MAX_TRIANGLES = 20000  # per model, which keeps a page with four robots below a few MB
_known: WeakKeyDictionary[Model, dict[int, tuple[Mesh, ...]]] = WeakKeyDictionary()


def meshes(model: Model, max_triangles: int = MAX_TRIANGLES) -> tuple[Mesh, ...]:
    """Triangle meshes of the links of a model, for display only.

    They show the visual geometry of the URDF or MJCF file from which the model was loaded; if there
    is none, or with a warning if it cannot be read, its collision bodies. Of a person (`human_arm`,
    `human_upper_body`, also within `combine`) those are drawn as a human body in the proportions of
    the model. Moving links without either are drawn from the kinematic chain: joints along their
    axes, and struts between them. The result is deterministic, and kept as long as the model is.

    >>> import geodesic_ocp as go
    >>> from geodesic_ocp.model.geometry.meshes import meshes
    >>> sorted({mesh.link for mesh in meshes(go.human_arm("right"))})
    ['right forearm', 'right hand', 'right upper arm']

    Args:
        model: its configuration does not matter.
        max_triangles: about the number of all triangles that are left where there are more.
    """
    if max_triangles < 1:
        raise ValueError(f"max_triangles must be at least 1, got {max_triangles}")
    results = _known.setdefault(model, {})
    if max_triangles not in results:
        # Links of other models in the file, such as a robot's second arm, are not in this one.
        found = [mesh for mesh in _geometry(model) if model.pin.existFrame(mesh.link)]
        found += kinematic_chain(model, {model.joint_of(mesh.link) for mesh in found})
        moving = [model.moves(mesh.link) for mesh in found]
        results[max_triangles] = tuple(simplified(found, moving, max_triangles))
    return results[max_triangles]


def _geometry(model: Model) -> list[Mesh]:
    if isinstance(model.shapes, LinkGeometry):
        try:
            visual = list(visual_geometry(model.shapes))
        except Exception as error:  # from Pinocchio: a mesh is missing, or of an unknown type
            reason = " ".join(str(error).split())
            said = "is drawn without its visual geometry, which cannot be read"
            warnings.warn(f"{model.name} {said}: {reason}", stacklevel=2)
            visual = []
        if visual:
            return visual
    try:
        bodies = model.bodies
    except ValueError:  # the collision geometry cannot be read either
        return []
    found, replaced = person(model)
    return found + [body_mesh(each) for each in bodies if each.link and each not in replaced]
