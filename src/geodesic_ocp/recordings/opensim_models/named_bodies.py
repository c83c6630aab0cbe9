"""Which bodies of a model are the segments of a person."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.segment_orientations import SEGMENTS
from geodesic_ocp.recordings.opensim_models.osim_convention import BODY_NAMES, OsimConvention
from geodesic_ocp.recordings.opensim_models.osim_model import OsimModel
from geodesic_ocp.recordings.opensim_models.osim_poses import body_poses

SIDES = ("right", "left")


def named_bodies(model: OsimModel, convention: OsimConvention) -> dict[str, str]:
    """The body of each segment that the model has.

    Raises:
        RecordingError: there is no thorax or no arm, two bodies have names of one segment, or the
            convention names a body that is not there; lists the bodies.
    """
    listed = f"bodies of the model are {', '.join(model.bodies)}"
    for segment, body in convention.bodies.items():
        if body not in model.bodies:
            raise RecordingError(
                f"{model.file}: there is no body {body!r} for the {segment}; {listed}"
            )
    zero = zero_coordinates(model)
    found: dict[str, str] = {}
    for segment in SEGMENTS:
        if segment in convention.bodies:
            found[segment] = convention.bodies[segment]
            continue
        side, _, part = segment.partition(" ")
        if side not in SIDES:
            names = BODY_NAMES.get(segment, ())
        else:
            letter = side[0]
            names = tuple(
                text
                for name in BODY_NAMES[part]
                for text in (f"{name}_{letter}", f"{letter}_{name}", f"{name}_{side}")
            )
            if "thorax" in found and side == _single_side(model, found["thorax"], zero):
                names += BODY_NAMES[part]
        bodies = [body for body in model.bodies if body.lower() in names]
        if len(bodies) > 1:
            raise RecordingError(
                f"{model.file}: {' and '.join(bodies)} may be the {segment}; name one of them in "
                "an OsimConvention"
            )
        if bodies:
            found[segment] = bodies[0]
    arms = [side for side in SIDES if f"{side} upper arm" in found and f"{side} forearm" in found]
    missing = [] if "thorax" in found else ["thorax"]
    missing += [] if arms else ["upper arm with a forearm"]
    if missing:
        raise RecordingError(
            f"{model.file}: no body is recognised as {' nor as '.join(missing)}; name the bodies "
            f"of the segments in an OsimConvention; {listed}"
        )
    return found


def zero_coordinates(model: OsimModel) -> Mapping[str, Array]:
    """All independent coordinates zero, one sample."""
    return {name: np.zeros(1) for name in model.coordinates if name not in model.couplers}


def _single_side(model: OsimModel, thorax: str, zero: Mapping[str, Array]) -> str | None:
    """The side of the only upper arm if its name has none: z points right in the thorax."""
    bodies = [body for body in model.bodies if body.lower() in BODY_NAMES["upper arm"]]
    if len(bodies) != 1:
        return None
    poses = body_poses(model, zero, (thorax, bodies[0]))
    across = (poses[bodies[0]][1] - poses[thorax][1])[0] @ poses[thorax][0][0][:, 2]
    return SIDES[0] if across > 0.0 else SIDES[1]
