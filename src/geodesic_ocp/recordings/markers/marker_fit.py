"""MarkerFit: a motion that was fitted to markers, how far it is to be trusted, and its errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.fit_program import LOOSE_SPREAD, PRIOR_TIME, FitProblem
from geodesic_ocp.recordings.markers.markers import evenly
from geodesic_ocp.tables import new_table
from geodesic_ocp.trajectory.motion import FrameMotion, Motion

if TYPE_CHECKING:
    from pandas import DataFrame

_HELD = 1e8  # stiffness of a joint at its limit, relative to that of the markers [1/rad^2]
_AT_LIMIT = 1e-4  # [rad or m]


@dataclass(frozen=True, eq=False, repr=False)
class FitNoise(ShortRepr):
    """Errors of fitted angles, of which each marker makes its share.

    The distances of a marker from its fitted places, r_m(t) without their mean, are skin that moves
    and noise of the cameras, with their own course in time. In the fit the pulls of all markers
    cancel. With other signs they do not: to first order, the fit to the fitted places plus s_m r_m,
    s_m = +1 or -1, differs by sum_m s_m times the response of the angles to r_m, as smooth as the
    fit is (wild bootstrap; Wu, The Annals of Statistics 14, 1986).

    Attributes:
        responses: of the angles to the errors of each marker (k, n, m) [rad or m].
    """

    responses: Array

    def draw(self, random: np.random.Generator) -> Array:
        """Return errors of the angles (k, n), others at each call."""
        result: Array = self.responses @ random.choice([-1.0, 1.0], self.responses.shape[2])
        return result


def fit_noise(
    problem: FitProblem,
    time: Array,
    z: Array,
    shared: Array,
    residuals: Array,
    weights: Array,
    loose: NDArray[np.bool_],
) -> FitNoise:
    """Return the errors of the angles that residuals stand for, the shared variables as they are.

    Args:
        time: (k,) [s].
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        residuals: fitted minus observed positions (k, m, 3) [m], NaN where missing.
        weights: that the markers kept (k, m); NaN where missing.
        loose: joints that the markers do not determine (n,).
    """
    count, markers = weights.shape
    changing = np.nan_to_num(residuals - np.nanmean(residuals, axis=0))
    # Least squares leave less than there was, by the degrees of freedom.
    seen = 3.0 * float(np.sum(np.nan_to_num(weights))) / count
    changing *= np.sqrt(seen / max(seen - problem.nz, 0.1 * seen))
    shares = np.convolve(np.diff(time), [0.5, 0.5])
    weighted = np.nan_to_num(weights) * shares[:, None] / problem.settings.noise**2
    blocks = np.empty((count, problem.nz, problem.nz))
    pulls = np.empty((count, problem.nz, markers))
    for k in range(count):
        slopes = problem.slopes(z[k], shared)[1].full().reshape(markers, 3, problem.nz)
        blocks[k] = np.einsum("m,mdi,mdj->ij", weighted[k], slopes, slopes)
        pulls[k] = np.einsum("m,mdi,md->im", weighted[k], slopes, changing[k])
    lower, upper = problem.limits
    if problem.settings.limits:
        at_limit = (z < lower + _AT_LIMIT) | (z > upper - _AT_LIMIT)
        blocks += at_limit[:, :, None] * np.eye(problem.nz) * _HELD * shares[:, None, None]
    matrix = scipy.sparse.block_diag(blocks) + problem.stiffness(time, loose)[0]
    moved = scipy.sparse.linalg.splu(matrix.tocsc()).solve(pulls.reshape(-1, markers))
    return FitNoise(moved.reshape(count, problem.nz, markers)[:, problem.first_joint :])


#: How the warning of a fit that is doubtful begins.
DOUBTFUL = "the fit of the markers is doubtful: "
# A typical error that is usual at most [m]: skin moves, and places of markers are assumed.
_USUAL = 0.02
_MANY = 0.25  # share of the samples of markers that are lost
_SHORT = 1.0  # [s]
_TRUNK = ("thorax", "abdomen", "pelvis")
_LOST = 0.25  # weight below which a marker counts as lost: it is farther away than `outlier`
_NEAR = 0.5  # distance from another marker's place, relative to that from its own
# Bounds of this project's choice, see `MarkerFit.typical_error`: a recording by the Master Motor
# Map's set is fitted within 7 mm, without estimated offsets within 30 mm, one that is mirrored
# within 70 mm.
_NO_FIT = 0.04  # [m]
_MOST = 0.75  # share of the samples of markers that are lost
_SHORTEST, _TALLEST = 0.8, 2.4  # body heights that are believed if they are estimated [m]


@dataclass(frozen=True)
class LostMarker:
    """A marker that lost its weight.

    Attributes:
        marker: its name.
        start, end: first and last such sample [s].
        distance: median from its place [m].
        near: marker near whose place it is instead, with which it may be swapped; or None.
    """

    marker: str
    start: float
    end: float
    distance: float
    near: str | None = None

    def __str__(self) -> str:
        instead = f", where {self.near} should be" if self.near else ""
        return (
            f"{self.marker} is {1e3 * self.distance:.0f} mm away from {self.start:.2f} to "
            f"{self.end:.2f} s{instead}"
        )


def lost_markers(
    time: Array, names: tuple[str, ...], observed: Array, predicted: Array, weights: Array
) -> tuple[LostMarker, ...]:
    """Return all spans of all markers; observed and predicted (k, m, 3) [m], weights (k, m)."""
    found = []
    for column, name in enumerate(names):
        seen = np.flatnonzero(~np.isnan(weights[:, column]))
        lost = weights[seen, column] < _LOST
        edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            rows = seen[first:last]
            away = np.linalg.norm(observed[rows, column, None] - predicted[rows], axis=2)
            distances = np.median(away, axis=0)
            nearest = int(np.argmin(distances))
            near = names[nearest] if distances[nearest] < _NEAR * distances[column] else None
            start, end, distance = map(float, (*time[rows[[0, -1]]], distances[column]))
            found.append(LostMarker(name, start, end, distance, near))
    return tuple(found)


@dataclass(frozen=True, eq=False, repr=False)
class MarkerFit:
    """A motion that was fitted to markers, and how well it fits.

    Attributes:
        motion: motion of the model's joints, with the pose of the thorax if it is known, and the
            subject with the height.
        model: model with the lengths of the person.
        base: pose of the model's base in the space of the markers; None if it is fixed.
        names: names of the m markers that were fitted.
        segments: segments that they are fixed to.
        errors: distances of markers from their fitted positions (k, m) [m]; NaN where missing.
        weights: weights that the markers kept, from 1 to 0 (k, m); NaN where missing.
        lost: spans of time in which markers lost their weight.
        offsets: on the segments [m], by marker, for the model's lengths.
        lengths: lengths of segments [m] by name; "shoulder half width" is half the distance between
            the shoulders.
        height: height of the person [m], or None for a model that is not of a person.
        height_from: where the height was taken from, in words.
        undetermined: joints that the markers do not determine for at least half of the time, where
            smoothness and limits choose.
        constant_errors: standard deviations of the constant errors of the joints' angles (n,)
            [rad] that uncertain places of the markers on their segments leave; NaN for joints that
            are not determined.
        noise: errors of the angles over time that the markers' errors make, from which
            `Analysis.uncertainty` draws.
        marker_set: name of the marker set.
        left_out: markers of the recording that were not used.
        seconds: seconds that the fit took.
        iterations: iterations of Ipopt.
    """

    motion: Motion
    model: Model
    base: FrameMotion | None
    names: tuple[str, ...]
    segments: tuple[str, ...]
    errors: Array
    weights: Array
    lost: tuple[LostMarker, ...]
    offsets: Mapping[str, Array]
    lengths: Mapping[str, float]
    height: float | None
    height_from: str
    undetermined: tuple[str, ...]
    constant_errors: Array
    noise: FitNoise
    marker_set: str
    left_out: tuple[str, ...]
    seconds: float
    iterations: int

    def table(self) -> DataFrame:
        """Return errors of every marker, and the share of time in which it is missing or lost."""
        missing = np.isnan(self.errors)
        lost = np.where(missing, np.nan, self.weights < _LOST)
        columns = {
            "mean error [mm]": 1e3 * np.nanmean(self.errors, axis=0),
            "95 % below [mm]": 1e3 * np.nanpercentile(self.errors, 95, axis=0),
            "max [mm]": 1e3 * np.nanmax(self.errors, axis=0),
            "missing [%]": 100.0 * missing.mean(axis=0),
            "lost [%]": 100.0 * np.nanmean(lost, axis=0),
        }
        numbers = (each.tolist() for each in columns.values())
        rows = tuple(zip(self.names, self.segments, *numbers, strict=True))
        return new_table(("marker", "segment", *columns), rows, self._note)

    @property
    def typical_error(self) -> float:
        """Median over markers of their mean errors [m], which no single marker can change.

        Of the markers of the trunk or of all others, whichever is greater.
        """
        on_trunk = np.isin(self.segments, _TRUNK)
        seen = ~np.isnan(self.errors).all(axis=0)
        groups = [each for each in (seen & on_trunk, seen & ~on_trunk) if each.any()]
        means = [np.nanmean(self.errors[:, each], axis=0) for each in groups]
        return max(float(np.median(each)) for each in means)

    @property
    def lost_share(self) -> float:
        """Share of the positions that were recorded in which markers lost their weight."""
        return float(np.mean(self.weights[~np.isnan(self.weights)] < _LOST))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the motion may not be what was recorded, as phrases; empty for a good fit."""
        found = []
        if self.typical_error > _USUAL:
            seconds = float(np.ptp(self.motion.time))
            short = f" (a recording of {seconds:.2g} s says little about their places)"
            found.append(self._distance + (short if seconds < _SHORT else ""))
        if self.lost_share > _MANY:
            found.append(self._share)
        if self.undetermined:
            found.append(f"the markers do not determine {', '.join(self.undetermined)}")
        return tuple(found)

    @property
    def _distance(self) -> str:
        return f"markers are typically {1e3 * self.typical_error:.0f} mm from their places"

    @property
    def _share(self) -> str:
        return f"the markers are far from their places for {self.lost_share:.0%} of the time"

    @property
    def _note(self) -> str:
        lines = []
        if self.height is not None:
            lines.append(f"Body height {self.height:.3f} m, {self.height_from}.")
        if self.lengths:
            shown = ", ".join(f"{name} {value:.3f} m" for name, value in self.lengths.items())
            lines.append(f"Lengths: {shown}.")
        if self.undetermined:
            lines.append(f"Not determined by the markers: {', '.join(self.undetermined)}.")
        if np.nansum(self.constant_errors) > 0.0:
            sizes = {"rad": (np.rad2deg(1.0), "deg"), "m": (1e3, "mm")}
            scales = (sizes[unit] for unit in self.model.units)
            errors = zip(self.model.joint_names, self.constant_errors, scales, strict=True)
            shown = ", ".join(
                f"{name.removesuffix('_joint')} {scale * error:.1f} {unit}"
                for name, error, (scale, unit) in errors
                if not np.isnan(error)
            )
            lines.append(
                "Constant errors of the angles are possible, as places of markers on the segments "
                f"are assumed (standard deviations): {shown}."
            )
        lines += [f"{each}." for each in self.lost[:20]]
        if len(self.lost) > 20:
            lines.append(f"{len(self.lost) - 20} more spans of lost markers.")
        return "\n".join(lines)

    def __repr__(self) -> str:
        height = "" if self.height is None else f", body height {self.height:.2f} m"
        return (
            f"MarkerFit({len(self.motion)} samples, {len(self.names)} markers, mean error "
            f"{1e3 * float(np.nanmean(self.errors)):.1f} mm, {len(self.lost)} spans of lost "
            f"markers{height}, {self.seconds:.1f} s)"
        )


def check_fit(fit: MarkerFit, estimated: bool) -> None:
    """Refuse a fit that is none; `estimated` says whether the height was.

    Raises:
        ValueError: the typical error is above 40 mm, markers are lost for three quarters of the
            time, or the body height is outside 0.8 to 2.4 m; names likely causes.
    """
    if fit.typical_error > _NO_FIT:
        usual = f"{1e3 * _USUAL:.0f} mm at most are usual"
        found = f"{fit._distance} on {fit.model.name!r}, {usual}"
    elif fit.lost_share > _MOST:
        found = fit._share
    elif fit.height is not None and estimated and not _SHORTEST < fit.height < _TALLEST:
        found = f"the body height would be {fit.height:.2f} m, {fit.height_from}"
    else:
        return
    causes = [
        "the unit (Markers must be in m)",
        "right and left exchanged, or axes that are left-handed",
        f"names that mean other places than in the marker set {fit.marker_set!r}",
    ]
    if fit.base is None:
        causes.insert(
            0,
            "base='fixed' (which takes positions in the axes and from the origin of the model's "
            "base, the shoulder of an arm; for positions in a room give base='free' and markers of "
            "the thorax)",
        )
    if fit.height is not None:
        causes.append("another height of the person (give height=...)")
    raise ValueError(f"the markers are not fitted: {found}. Check {', '.join(causes)}")


_FRAMES = 50  # that are considered
_LEVER = 0.004  # [m/rad]: what moves no marker by more is not determined
_PART = 0.3  # of a joint in such a motion of unit length


def undetermined_joints(
    problem: FitProblem, z: Array, shared: Array, seen: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which joints (n,) can move, alone or with others, without moving the markers.

    Joints that do so in at least half of the frames, of which up to 50 are considered.

    Args:
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        seen: which markers are (k, m).
    """
    rows = evenly(len(z), _FRAMES)
    votes = np.zeros(problem.body.model.dof)
    for row in rows:
        jacobian = problem.slopes(z[row], shared)[1].full()[np.repeat(seen[row], 3)]
        moves, vectors = np.linalg.eigh(jacobian.T @ jacobian)
        free = vectors[problem.first_joint :, moves < _LEVER**2]
        votes += np.linalg.norm(free, axis=1) > _PART
    return np.asarray(votes >= rows.size / 2)


def constant_errors(
    problem: FitProblem, time: Array, z: Array, shared: Array, weights: Array
) -> Array:
    """Return standard deviations [rad] of the mean over time of the joints' errors (n,).

    They follow, to first order, from the uncertainty of the places of markers in the marker set:
    as it is where offsets are not estimated, else as the fit leaves it. Up to 50 frames are
    considered.

    Args:
        time: (k,) [s].
        z: variables of the frames (k, nz).
        shared: variables of all frames (ns,).
        weights: weights of the markers (k, m); NaN where missing.
    """
    noise, estimated = problem.settings.noise, problem.settings.offsets
    if not estimated:
        problem = replace(problem, settings=replace(problem.settings, offsets=True))
        shared = np.concatenate([shared, np.zeros(problem.ns - shared.size)])
    if not problem.ns:
        return np.zeros(problem.body.model.dof)
    *symbols, points = problem.frame
    slopes = [ca.densify(ca.jacobian(ca.vec(points), each)) for each in symbols]
    at = ca.Function("slopes", symbols, [ca.cse(each) for each in slopes])
    weak = np.full(problem.nz, (noise / LOOSE_SPREAD) ** 2)
    weak[: problem.first_joint] = 1e-12
    carried, told = np.zeros((problem.nz, problem.ns)), np.zeros((problem.ns, problem.ns))
    rows = evenly(len(z), _FRAMES)
    for row in rows:
        by_z, by_shared = (each.full() for each in at(z[row], shared))
        weight = np.repeat(np.nan_to_num(weights[row]), 3)[:, None]
        normal = by_z.T @ (weight * by_z) + np.diag(weak)
        # The angles follow a change of the shared variables so that markers stay where they are.
        follow = np.linalg.solve(normal, by_z.T @ (weight * by_shared))
        carried += follow / rows.size
        told += by_shared.T @ (weight * (by_shared - by_z @ follow)) / rows.size
    information = problem.priors
    if estimated:
        scale = float(time[-1] - time[0]) / PRIOR_TIME / noise**2
        information = information + scale * (told + told.T) / 2.0
    variance = np.einsum("is,si->i", carried, np.linalg.solve(information, carried.T))
    return np.asarray(np.sqrt(variance[problem.first_joint :]))
