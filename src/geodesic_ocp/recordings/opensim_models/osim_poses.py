"""Forward kinematics of an OpenSim model: where its bodies are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.opensim_models.osim_model import GROUND, OsimAxis, OsimJoint, OsimModel


def body_poses(
    model: OsimModel, values: Mapping[str, Array], bodies: Iterable[str]
) -> dict[str, tuple[Array, Array]]:
    """Rotations (k, 3, 3) to the ground and positions (k, 3) [m] of bodies.

    Coordinates without values follow their couplers, or have their default values.

    Args:
        model: whose bodies.
        values: by coordinate, (k,) [rad or m].
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
    """The pose of the child body from that of the parent body."""
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
