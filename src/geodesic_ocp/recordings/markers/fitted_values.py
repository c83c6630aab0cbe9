"""The values of a fit, from the variables of its program."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.lost_markers import lost_markers
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.markers.program.body import factors_by_name
from geodesic_ocp.recordings.markers.program.chosen_markers import ChosenMarkers
from geodesic_ocp.recordings.markers.program.constant_errors import constant_errors
from geodesic_ocp.recordings.markers.program.fit_problem import ROOT, FitProblem
from geodesic_ocp.recordings.markers.program.known_height import KnownHeight
from geodesic_ocp.recordings.markers.program.solve_fit import FittedVariables
from geodesic_ocp.trajectory.motion import FrameMotion, Motion


def as_marker_fit(
    fitted: FittedVariables,
    positions: Markers,
    chosen: ChosenMarkers,
    known: KnownHeight,
    seconds: float,
) -> MarkerFit:
    """The motion, lengths, errors and lost markers from the variables of the program."""
    problem, body = fitted.problem, fitted.problem.body
    lengths, offsets = problem.shared_values(fitted.shared)
    model = body.scaled(lengths)
    q = fitted.z[:, problem.first_joint :]
    observed = positions.positions[:, chosen.columns]
    errors = np.linalg.norm(fitted.predicted - observed, axis=2)
    weights = 1.0 / (1.0 + (errors / problem.settings.outlier) ** 2) ** 2
    height = None if body.height is None else body.height * float(lengths[0])
    root, thorax = _poses(fitted, model, q)
    base = root
    if root is not None and body.lone_side:
        across = body.to_base * lengths[body.lengths.index("shoulder half width")]
        base = FrameMotion(root.rotations, root.positions + root.rotations @ across)
    subject = replace(positions.subject, height=height or positions.subject.height)
    motion = Motion(positions.time, q, model.joint_names, subject=subject, trunk=thorax)
    return MarkerFit(
        motion=motion,
        model=model,
        base=base,
        names=chosen.names,
        segments=chosen.segments,
        errors=errors,
        weights=weights,
        lost=lost_markers(positions.time, chosen.names, observed, fitted.predicted, weights),
        offsets=_scaled_offsets(problem, lengths, offsets, chosen.names),
        lengths=factors_by_name(body, lengths),
        height=height,
        height_from=known.origin,
        undetermined=tuple(model.joint_names[index] for index in np.flatnonzero(fitted.loose)),
        marker_set=chosen.set_name,
        constant_errors=np.where(
            fitted.loose,
            np.nan,
            constant_errors(problem, positions.time, fitted.z, fitted.shared, weights),
        ),
        left_out=chosen.left_out,
        seconds=seconds,
        iterations=fitted.iterations,
    )


def _poses(
    fitted: FittedVariables, model: Model, q: Array
) -> tuple[FrameMotion | None, FrameMotion | None]:
    """Poses of the root and of the thorax, as far as they are known."""
    problem = fitted.problem
    if not problem.moves:
        return None, None
    angles = ca.SX.sym("angles", 3)
    rotation = ca.Function("rotation", [angles], [ca.densify(problem.root_rotation(angles))])
    stacked = rotation.map(len(q))(fitted.z[:, 3:ROOT].T).full()
    rotations = stacked.reshape(3, -1, 3).transpose(1, 0, 2)
    root = FrameMotion(rotations, fitted.z[:, :3])
    if problem.body.lone_side:
        return root, root
    if not model.pin.existFrame("thorax"):
        return root, None
    turned, moved = model.frame_pose("thorax", q)
    there = root.positions + np.einsum("kij,kj->ki", rotations, moved)
    return root, FrameMotion(rotations @ turned, there)


def _scaled_offsets(
    problem: FitProblem, lengths: Array, offsets: Array, names: tuple[str, ...]
) -> dict[str, Array]:
    """Offsets [m] on the segments of the scaled model, by marker."""
    found = {}
    for name, segment, offset in zip(names, problem.segments, offsets, strict=True):
        length = problem.body.attachment(segment).length
        common = lengths[0] if lengths.size else 1.0
        along = common if length is None else lengths[length]
        found[name] = offset * np.array([common, common, along])
    return found
