"""fit_markers: joint angles from markers, frame after frame and then for all samples."""

from __future__ import annotations

import time as clock
import warnings
from collections.abc import Collection
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, get_args

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.body import MarkedBody, on_trunk
from geodesic_ocp.recordings.markers.chosen_markers import (
    Base,
    FitSettings,
    check_trunk,
    choose_markers,
    is_in_line,
    known_height,
    rigid_poses,
    without_stray,
)
from geodesic_ocp.recordings.markers.fit_program import (
    LOOSE_SPREAD,
    LOST,
    ROOT,
    FitProblem,
    kept_weights,
)
from geodesic_ocp.recordings.markers.fit_uncertainty import (
    constant_errors,
    fit_noise,
    undetermined_joints,
)
from geodesic_ocp.recordings.markers.frame_search import FrameSearch
from geodesic_ocp.recordings.markers.marker_fit import DOUBTFUL, MarkerFit, check_fit, lost_markers
from geodesic_ocp.recordings.markers.marker_set import MarkerSet, as_marker_set
from geodesic_ocp.recordings.markers.markers import Axis, Markers, check_plausible_size, with_z_up
from geodesic_ocp.recordings.markers.people import of_person
from geodesic_ocp.trajectory.files.text_lines import check_seconds
from geodesic_ocp.trajectory.motion import FrameMotion, Motion

_COARSE_STEP = 0.05  # [s]
_WIDE = 0.2  # outlier size of the first solution, to which few markers are lost [m]
# tolerances
_ROUGHLY = 1e-5
_CLOSELY = 1e-6
_STEEP = 0.8  # sine of the root's angle in the middle, above which other axes are chosen


@dataclass(frozen=True, eq=False)
class FittedVariables:
    """Values of a fit's variables."""

    problem: FitProblem  # problem that they solve
    z: Array  # variables of the frames (k, nz)
    shared: Array  # (ns,)
    loose: NDArray[np.bool_]  # joints that the markers do not determine (n,)
    iterations: int  # iterations of Ipopt, in all


def solve_fit(problem: FitProblem, time: Array, ipopt: dict[str, Any] | None) -> FittedVariables:
    """Return the solution for the observed positions of the chosen markers.

    Frames are first fitted one after the other, every 0.05 s; then at these times together, with a
    wide loss and with the one that is asked for, and at last at all times.

    Raises:
        ValueError: the root moves and has too few markers, or markers determine none of the joints.
        NotConverged: Ipopt did not find a solution.
    """
    observed = problem.chosen.observed
    narrow = problem.settings.outlier
    rows = _coarse(time)
    everything = np.arange(time.size)
    wide = max(_WIDE, narrow)
    problem, start = _root_start(problem, time)
    z = FrameSearch(problem, wide).along(start[rows], observed[rows])
    shared = np.zeros(problem.ns)
    seen = ~np.isnan(observed[rows, :, 0])
    loose = undetermined_joints(problem, z, shared, seen)
    if loose.all():
        unseen = float(np.mean(~seen.any(axis=1)))
        gaps = f"; for {unseen:.0%} of the time no marker is seen" if unseen > 0.0 else ""
        left_out = problem.chosen.left_out
        others = f"; not on it, by their names, are {', '.join(left_out)}" if left_out else ""
        raise ValueError(
            f"the markers, on {', '.join(sorted(set(problem.chosen.segments)))}, determine none of "
            f"the joints of {problem.body.model.name!r} for half of the time or more{gaps}{others}"
        )
    stages = [(rows, wide, _ROUGHLY), (rows, narrow, _ROUGHLY), (everything, narrow, _CLOSELY)]
    if rows.size == time.size:
        del stages[1]
    iterations = 0
    for next_rows, outlier, tolerance in stages:
        if next_rows.size != rows.size:
            z = scipy.interpolate.make_interp_spline(time[rows], z, k=1)(time[next_rows])
            rows = next_rows
        program = problem.program(time[rows], observed[rows], loose)
        outcome = program.solve(np.concatenate([z.ravel(), shared]), outlier, tolerance, ipopt)
        iterations += outcome.iterations
        z, shared = outcome.x[: z.size].reshape(z.shape), outcome.x[z.size :]
        # A marker that lost its weight says nothing of the joints that carry it.
        kept = kept_weights(problem.errors(z, shared, observed[rows]), narrow) >= LOST
        loose = undetermined_joints(problem, z, shared, kept)
    if not outcome.success:
        raise NotConverged(f"no motion was fitted to the markers: {outcome.status}", outcome)
    return FittedVariables(problem, z, shared, loose, iterations)


def _coarse(time: Array) -> NDArray[np.int64]:
    """Return indices of samples about 0.05 s apart, the first and the last among them."""
    wanted = np.linspace(time[0], time[-1], int((time[-1] - time[0]) / _COARSE_STEP) + 2)
    found = np.unique(np.clip(np.searchsorted(time, wanted), 0, time.size - 1))
    return found if 4 <= found.size < 0.6 * time.size else np.arange(time.size)


def _root_start(problem: FitProblem, time: Array) -> tuple[FitProblem, Array]:
    """Return first values of the variables, and the problem with axes that suit the root's
    rotation.
    """
    z = np.tile(problem.neutral, (time.size, 1))
    if not problem.moves:
        return problem, z
    segments = problem.chosen.segments
    observed = problem.chosen.observed
    carried = [problem.body.attachment(segment).joint <= 0 for segment in segments]
    (places,) = problem.positions(problem.neutral[None], np.zeros(problem.ns))
    columns = np.flatnonzero(carried)
    # Parts of a person that hardly move in the root.
    trunk = np.flatnonzero([on_trunk(segment) for segment in segments])
    if trunk.size > columns.size and (columns.size < 3 or is_in_line(places[columns])):
        columns = trunk
    columns = columns[without_stray(places[columns], observed[:, columns])]
    rotations, z[:, :3] = rigid_poses(places[columns], observed[:, columns], time)
    # The angle in the middle of three must stay away from 90 deg: its sine is the component of the
    # root's x axis along the axis of the first angle, which is z if that will do.
    sines = np.abs(rotations[:, :, 0]).max(axis=0)[[2, 0, 1]]
    axis = 0 if sines[0] < _STEEP else int(np.argmin(sines))
    problem = replace(problem, axes=np.roll(np.eye(3), axis, axis=1).T)
    z[:, 3:ROOT] = problem.root_angles(rotations)
    return problem, z


_ESTIMATES = ("lengths", "offsets")
_CLOSEST = 0.05  # least step between samples, relative to their median


def fit_markers(
    model: Model,
    positions: Markers,
    *,
    marker_set: MarkerSet | str | PathLike[str] | None = None,
    base: Base = "free",
    estimate: Collection[str] = _ESTIMATES,
    height: float | None = None,
    limits: bool = True,
    noise: float = 0.002,
    acceleration: float = 100.0,
    jerk: float = 1000.0,
    outlier: float = 0.03,
    up: Axis | None = None,
    ipopt: dict[str, Any] | None = None,
) -> MarkerFit:
    """Return joint angles whose markers are near the recorded ones, of the whole recording at once.

    They minimize, over the motion of joints and base, lengths of segments and offsets of markers,
    the mean over time of

        sum_m rho(|r_m| / noise) + sum_i (q_i'' / acceleration)^2 + (q_i''' / jerk)^2

    with the distance r_m of marker m from its fitted place and the loss rho of Geman and McClure
    (1987), in which markers that are more than `outlier` away, such as swapped ones, lose their
    weight. Gaps are bridged by smoothness. Coordinates of the base's position count per 0.2 m. The
    result does not depend on the sampling rate; samples may be unevenly spaced.

    >>> arm, time = go.human_arm("right", height=1.8), np.arange(50) / 50.0
    >>> q = 0.3 * np.sin(np.outer(time, [1, 2, 3, 4, 3, 2, 1])) + [0.4, 0, -0.6, 1, 0, -0.1, 0]
    >>> rotation, wrist = arm.frame_pose("right hand", q)
    >>> points = [arm.frame_pose("REx_joint", q)[1], *(wrist + 0.1 * rotation.transpose(2, 0, 1))]
    >>> hand = {name: ("right hand", 0.1 * np.eye(3)[i]) for i, name in enumerate("xyz")}
    >>> places = {"elbow": ("REx_joint", (0, 0, 0))} | hand
    >>> used = go.recordings.MarkerSet("elbow and hand", places, unit="m")
    >>> markers = go.recordings.Markers(time, tuple(used.places), np.stack(points, axis=1))
    >>> fit = go.recordings.fit_markers(arm, markers, marker_set=used, base="fixed", estimate=())
    >>> bool(np.nanmax(fit.errors) < 1e-3)
    True

    Args:
        model: `human_arm`, `human_upper_body`, or any model with points on its frames.
        positions: positions of markers or joints, in a space with z up (see `up`), or for
            base="fixed" in the axes and from the origin of the model's base; of several people
            (names with prefixes, as in "Ann:RSHO"), those of the first are taken.
        marker_set: where the markers are: a set, a JSON or TOML file with its attributes, or the
            name of a known one ("Master Motor Map", "Plug-in Gait", "Rajagopal", "IOR", "OpenCap",
            "HALPE_26", "BODY_25", "COCO-17", "MediaPipe" or "joint centres", as in "right elbow").
            None: of these and the frames of the model by name, the one with most markers on the
            arms.
        base: "free" if the thorax (the pelvis of `human_upper_body`, the base of another model)
            moves, which takes three markers on it, such as both shoulders and the neck or a hip,
            or "fixed".
        estimate: any of "lengths" (of upper arm, forearm and shoulders, and the body height if it
            is not known) and "offsets" (of markers from their places), which stay near those of
            model and marker set.
        height: height of the person [m], to which the model is scaled; None: that of the
            recording's subject, if it is known; else, if lengths are estimated, from markers of
            head and feet of a person who stands (names of the Master Motor Map and Plug-in Gait),
            or from the lengths of the segments; else that of the model.
        limits: whether joints keep their limits.
        noise: expected error of the markers [m].
        acceleration, jerk: expected root mean squares [rad/s^2], [rad/s^3].
        outlier: distance at which a marker has a quarter of its weight [m].
        up: axis of the positions that points upwards, such as "y", which becomes z; None: z, and
            the trunk's markers must say so, too. Give "z" for a person who lies.
        ipopt: options of Ipopt by name.

    Raises:
        ValueError: a wrong argument, positions that are not in metres or not with z up, right and
            left exchanged, markers that the model does not know, too few of them, or none that are
            near their places: a typical error above 40 mm, more than 75 % lost, or an estimated
            height outside 0.8 to 2.4 m.
        NotConverged: Ipopt did not find a solution.

    Warns:
        RuntimeWarning: the fit is doubtful, see `MarkerFit.doubts`.
    """
    begin = clock.perf_counter()
    if base not in get_args(Base):
        raise ValueError(f"base must be 'fixed' or 'free', got {base!r}")
    asked = (estimate,) if isinstance(estimate, str) else tuple(estimate)
    for each in asked:
        if each not in _ESTIMATES:
            raise ValueError(f"estimate takes any of {', '.join(_ESTIMATES)}, got {each!r}")
    settings = FitSettings(
        base,
        "lengths" in asked,
        "offsets" in asked,
        bool(limits),
        as_positive("noise", noise, "m"),
        as_positive("acceleration", acceleration, "rad/s^2"),
        as_positive("jerk", jerk, "rad/s^3"),
        as_positive("outlier", outlier, "m"),
    )
    if not isinstance(positions, Markers):
        raise TypeError(
            f"positions must be Markers, got {type(positions).__name__}; give "
            "go.recordings.Markers(time, names, positions) of shape (samples, markers, 3), in m"
        )
    positions = of_person(positions, None)
    check_plausible_size(positions)
    if up is not None:
        positions = with_z_up(positions, up)
    body = MarkedBody(model)
    known = known_height(body, positions, height, settings)
    chosen = choose_markers(
        body,
        positions,
        as_marker_set(marker_set),
        height_factor=known.factor,
        outlier=settings.outlier,
    )
    _check_times(positions.time)
    if base == "free" and body.height is not None:
        check_trunk(body, chosen, ask_up=up is None)
    fitted = solve_fit(FitProblem(body, chosen, known, settings), positions.time, ipopt)
    fit = _marker_fit(fitted, positions, clock.perf_counter() - begin)
    check_fit(fit)
    fit = replace(fit, motion=replace(fit.motion, doubts=fit.doubts))
    if fit.doubts:
        warnings.warn(DOUBTFUL + "; ".join(fit.doubts), RuntimeWarning, stacklevel=2)
    return fit


def _check_times(time: Array) -> None:
    check_seconds(time)
    steps = np.diff(time)
    row = int(np.argmin(steps))
    if steps[row] < _CLOSEST * float(np.median(steps)):
        raise ValueError(
            f"positions: samples {row} and {row + 1} are {steps[row]:.3g} s apart, half of all "
            f"samples {np.median(steps):.3g} s or more: too close for differences; leave one out"
        )


def _marker_fit(fitted: FittedVariables, positions: Markers, seconds: float) -> MarkerFit:
    """Return the motion, lengths, errors and lost markers from the variables of the program."""
    problem = fitted.problem
    body = fitted.problem.body
    chosen = fitted.problem.chosen
    found, offsets = (ca.DM(each).full() for each in problem.shared_values(ca.DM(fitted.shared)))
    lengths = found[:, 0]
    time = positions.time
    q = fitted.z[:, problem.first_joint :]
    model = body.scaled(lengths)
    predicted = problem.positions(fitted.z, fitted.shared)
    errors = np.linalg.norm(predicted - chosen.observed, axis=2)
    weights = kept_weights(errors, problem.settings.outlier)
    constant = constant_errors(problem, time, fitted.z, fitted.shared, weights)
    # Uncertain places of markers may give a lever to a joint of which they say nothing.
    loose = fitted.loose | (constant > LOOSE_SPREAD)
    noise = fit_noise(
        problem,
        time,
        z=fitted.z,
        shared=fitted.shared,
        residuals=predicted - chosen.observed,
        weights=weights,
        loose=fitted.loose,
    )
    height = None if body.height is None else body.height * float(lengths[0])
    root = base = thorax = None
    if problem.moves:
        rotations = problem.root_rotations(fitted.z[:, 3:ROOT])
        root = base = FrameMotion(rotations, fitted.z[:, :3])
        if body.lone_side:
            thorax = root
            base = FrameMotion(rotations, root.positions + rotations @ body.base(lengths))
        elif model.pin.existFrame("thorax"):
            turned, moved = model.frame_pose("thorax", q)
            there = root.positions + np.einsum("kij,kj->ki", rotations, moved)
            thorax = FrameMotion(rotations @ turned, there)
    subject = replace(positions.subject, height=height or positions.subject.height)
    stretches = (body.stretch(body.attachment(each), lengths) for each in chosen.segments)
    named = zip(body.lengths[1:], (body.nominal * lengths).tolist()[1:], strict=True)
    return MarkerFit(
        motion=Motion(time, q, model.joint_names, subject=subject, trunk=thorax),
        model=model,
        base=base,
        names=chosen.names,
        segments=chosen.segments,
        errors=errors,
        weights=weights,
        lost=lost_markers(time, chosen.names, chosen.observed, predicted, weights),
        offsets={
            name: np.array(stretch) * offset
            for name, stretch, offset in zip(chosen.names, stretches, offsets.T, strict=True)
        },
        lengths=dict(named),
        height=height,
        height_from=problem.known.origin,
        height_estimated=problem.known.estimated,
        undetermined=tuple(model.joint_names[index] for index in np.flatnonzero(loose)),
        marker_set=chosen.set_name,
        constant_errors=np.where(loose, np.nan, constant),
        noise=noise,
        left_out=chosen.left_out,
        frozen=chosen.frozen,
        seconds=seconds,
        iterations=fitted.iterations,
    )
