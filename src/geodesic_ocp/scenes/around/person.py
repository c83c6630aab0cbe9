"""The rest of a person, beside the model of one arm or of both."""

from __future__ import annotations

from geodesic_ocp.model.meshes import person_beside
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.actor import Actor

LAYER = "rest of the person"


def rest_of_person(model: Model) -> Actor | None:
    """Trunk, head and, beside a single arm, the other arm, in the base frame of the model, at rest.

    See `person_beside`.

    Args:
        model: of `human_arm`, or a right and a left one of `combine` with shoulders side by side.

    Returns:
        None for a model that is not one or both arms of a person, or that has a trunk.
    """
    found = person_beside(model)
    if found is None:
        return None
    parts, rotation, position = found
    places = dict.fromkeys(part.link for part in parts)
    return Actor(
        "rest of the person",
        parts,
        dict.fromkeys(places, rotation[None]),
        dict.fromkeys(places, position[None]),
        layer=LAYER,
    )
