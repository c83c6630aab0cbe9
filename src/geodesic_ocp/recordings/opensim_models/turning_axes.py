"""The axes about which coordinates turn one body relative to another, and what they are for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.opensim_models.osim_model import OsimModel
from geodesic_ocp.recordings.opensim_models.osim_poses import body_poses

_STEP = 1e-4  # of coordinates [rad]
_TURNS = 1e-3  # rad a unit of the coordinate
# Cosines between an axis of rotation and a long axis: the elbow's flexion, the forearm's rotation.
_ACROSS, _ALONG = 0.6, 0.8


def turning_axes(
    model: OsimModel, zero: Mapping[str, Array], parent: str, child: str
) -> dict[str, Array]:
    """By coordinate, the rotation vector (3,) of the child in the parent's axes per unit."""
    found = {}
    for name in model.independent(model.path(child, parent)):
        ends = []
        for step in (_STEP, -_STEP):
            poses = body_poses(model, {**zero, name: np.array([step])}, (parent, child))
            ends.append(poses[parent][0][0].T @ poses[child][0][0])
        turn = scipy.spatial.transform.Rotation.from_matrix(ends[0] @ ends[1].T).as_rotvec()
        if np.linalg.norm(turn) > 2.0 * _STEP * _TURNS:
            found[name] = turn / (2.0 * _STEP)
    return found


def _cosines(turning: Mapping[str, Array], along: Array) -> dict[str, float]:
    length = np.linalg.norm(along)
    return {
        name: float(abs(turn @ along) / (np.linalg.norm(turn) * length))
        for name, turn in turning.items()
    }


def turning_across(turning: Mapping[str, Array], along: Array) -> list[str]:
    """The coordinates that turn about axes across a long axis (3,)."""
    return [name for name, cosine in _cosines(turning, along).items() if cosine < _ACROSS]


def turning_along(turning: Mapping[str, Array], along: Array) -> str | None:
    """The coordinate that turns about the axis nearest to a long axis (3,), if one is near."""
    cosines = _cosines(turning, along)
    best = max(cosines, key=cosines.__getitem__, default=None)
    return best if best is not None and cosines[best] > _ALONG else None


def flexion_among(model: OsimModel, names: Sequence[str]) -> str | None:
    """The coordinate with "flex" in its name, or the one of the largest range."""
    named = [name for name in names if "flex" in name.lower()]
    if len(named) == 1:
        return named[0]
    ranges = {name: model.coordinates[name].range or (0.0, 0.0) for name in names}
    return max(names, key=lambda name: ranges[name][1] - ranges[name][0], default=None)


def larger_part(model: OsimModel, name: str) -> float:
    """1 or -1, the sign of the larger part of a coordinate's range."""
    limits = model.coordinates[name].range
    return -1.0 if limits is not None and limits[0] + limits[1] < 0.0 else 1.0
