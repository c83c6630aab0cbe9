"""Synthetic motions of an arm, and what markers on it would record."""

from __future__ import annotations

import numpy as np
import scipy

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.marker_set import MarkerSet, marker_sets
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.trajectory.motion import FrameMotion

HEIGHT = 1.8
# The height of the shoulders above the pelvis, of a person who stands [m].
PELVIS = float(go.human_upper_body(HEIGHT).frame_pose("thorax", np.zeros(20))[1][2])
MMM_MARKERS = marker_sets()["Master Motor Map"]
PLUG_IN_GAIT_MARKERS = marker_sets()["Plug-in Gait"]
JOINT_CENTRES = marker_sets()["joint centres"]
FRAMES = {
    "shoulder": "{letter}Sx_joint",
    "upper arm": "{side} upper arm",
    "elbow": "{letter}Ex_joint",
    "forearm": "{side} forearm",
    "hand": "{side} hand",
}


def angles(model: go.Model, time: Array, seed: int = 0) -> Array:
    """Smooth angles well within the limits, up to 1.2 Hz."""
    random = np.random.default_rng(seed)
    low, high = np.maximum(model.lower, -1.2), np.minimum(model.upper, 1.6)
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    q = np.tile(middle, (time.size, 1))
    for frequency in (0.3, 0.7, 1.2):
        phase = random.uniform(0.0, 2.0 * np.pi, model.dof)
        q += 0.25 * half * np.sin(2.0 * np.pi * frequency * time[:, None] + phase)
    return q


def walk(time: Array) -> FrameMotion:
    """A thorax that turns by more than a revolution, leans and moves."""
    turn = np.stack([2.2 * time, 0.2 * np.sin(2.0 * time), 0.3 * np.cos(1.5 * time)], axis=1)
    positions = np.stack([0.4 * time, np.sin(time), 1.4 + 0.05 * np.sin(6.0 * time)], axis=1)
    rotations = scipy.spatial.transform.Rotation.from_euler("ZYX", turn).as_matrix()
    return FrameMotion(rotations, positions)


def placed(
    model: go.Model,
    q: Array,
    places: dict[str, tuple[str, Array]],
    thorax: FrameMotion | None = None,
    across: float = 0.0,
) -> Array:
    """Positions (k, m, 3) of points on an arm whose base is `across` to the right of the thorax."""
    result = []
    for segment, offset in places.values():
        side, _, part = segment.partition(" ")
        letter = side[0].upper()
        if segment in ("thorax", "trunk"):
            down = PELVIS if segment == "trunk" else 0.0
            own = np.tile(offset - [across, 0.0, down], (len(q), 1))
        elif part == "shoulder" and f"{letter}Sx_joint" not in model.joint_names:
            own = np.tile([-2.0 * across, 0.0, 0.0], (len(q), 1))
        else:
            frame = FRAMES[part].format(side=side, letter=letter)
            rotations, positions = model.frame_pose(frame, q)
            own = positions + rotations @ offset
        result.append(own)
    points = np.stack(result, axis=1)
    if thorax is None:
        return points
    points = points + np.array([across, 0.0, 0.0])
    turned = np.einsum("kij,kmj->kmi", thorax.rotations, points)
    return turned + thorax.positions[:, None]


def marked(
    model: go.Model, q: Array, time: Array, used: MarkerSet, *, noise: float = 0.0, seed: int = 1
) -> Markers:
    """What a set's markers would record of an arm on a thorax that walks."""
    side = "right" if "RSx_joint" in model.joint_names else "left"
    places = {
        name: (segment, HEIGHT * np.array(offset))
        for name, (segment, offset) in used.places.items()
        if segment in ("thorax", "trunk") or side in segment or "shoulder" in segment
    }
    across = 0.110 * HEIGHT * (1.0 if side == "right" else -1.0)
    positions = placed(model, q, places, walk(time), across)
    positions += noise * np.random.default_rng(seed).normal(size=positions.shape)
    return Markers(time, tuple(places), positions)
