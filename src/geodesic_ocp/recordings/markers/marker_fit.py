"""MarkerFit: a motion that was fitted to markers, how far it is to be trusted, and its errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.body import on_trunk
from geodesic_ocp.recordings.markers.fit_program import LOST
from geodesic_ocp.recordings.markers.fit_uncertainty import FitNoise
from geodesic_ocp.tables import new_table
from geodesic_ocp.trajectory.motion import FrameMotion, Motion

if TYPE_CHECKING:
    from pandas import DataFrame

#: How the warning of a fit that is doubtful begins.
DOUBTFUL = "the fit of the markers is doubtful: "
# A typical error that is usual at most [m]: skin moves, and places of markers are assumed.
_USUAL = 0.02
_MANY = 0.25  # share of the samples of markers that are lost
# Bounds of this project's choice, see `MarkerFit.typical_error`: a recording by the Master Motor
# Map's set is fitted within 7 mm, without estimated offsets within 30 mm, one that is mirrored
# within 70 mm.
_NO_FIT = 0.04  # [m]
_MOST = 0.75  # share of the samples of markers that are lost
# body heights that are believed if they are estimated [m]
_SHORTEST = 0.8
_TALLEST = 2.4
# Adults: three standard deviations (0.065 and 0.07 m) below the mean of the women and above that of
# the men of the nations where they are shortest and tallest, 1.49 and 1.825 m (NCD Risk Factor
# Collaboration, "A century of trends in adult human height", eLife 5, 2016).
_SHORT_ADULT = 1.30  # [m]
_TALL_ADULT = 2.04  # [m]


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
        lost = weights[seen, column] < LOST
        edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
        for first, last in edges.reshape(-1, 2):
            rows = seen[first:last]
            away = np.linalg.norm(observed[rows, column, None] - predicted[rows], axis=2)
            distances = np.median(away, axis=0)
            nearest = int(np.argmin(distances))
            # Much nearer to another marker's place than to its own.
            near = names[nearest] if distances[nearest] < distances[column] / 2 else None
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
        height_estimated: whether it was taken from the markers.
        undetermined: joints that the markers which kept their weight do not determine for at least
            half of the time, or but for an error of more than 1 rad; smoothness and limits choose.
        constant_errors: standard deviations of the constant errors of the joints' angles (n,)
            [rad] that uncertain places of the markers on their segments leave; NaN for joints that
            are not determined.
        noise: errors of the angles over time that the markers' errors make, from which
            `Analysis.uncertainty` draws.
        marker_set: name of the marker set.
        left_out: markers of the recording that were not used.
        frozen: share of the samples in which a marker repeats a position although its neighbours
            move, by marker; they count as missing.
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
    height_estimated: bool
    undetermined: tuple[str, ...]
    constant_errors: Array
    noise: FitNoise
    marker_set: str
    left_out: tuple[str, ...]
    frozen: Mapping[str, float]
    seconds: float
    iterations: int

    def table(self) -> DataFrame:
        """Return errors of every marker, and the share of time in which it is missing or lost."""
        missing = np.isnan(self.errors)
        lost = np.where(missing, np.nan, self.weights < LOST)
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
        trunk = np.array([on_trunk(each) for each in self.segments])
        seen = ~np.isnan(self.errors).all(axis=0)
        groups = [each for each in (seen & trunk, seen & ~trunk) if each.any()]
        means = [np.nanmean(self.errors[:, each], axis=0) for each in groups]
        return max(float(np.median(each)) for each in means)

    @property
    def lost_share(self) -> float:
        """Share of the positions that were recorded in which markers lost their weight."""
        return float(np.mean(self.weights[~np.isnan(self.weights)] < LOST))

    @property
    def mean_error(self) -> float:
        """Mean distance of all markers from their places over time [m], of lost ones as well."""
        return float(np.nanmean(self.errors))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the motion may not be what was recorded, as phrases; empty for a good fit."""
        found = []
        if self.typical_error > _USUAL:
            seconds = float(np.ptp(self.motion.time))
            short = f" (a recording of {seconds:.2g} s says little about their places)"
            found.append(self._distance + (short if seconds < 1.0 else ""))
        if self.mean_error > _NO_FIT:
            found.append(f"markers are {1e3 * self.mean_error:.0f} mm from their places on average")
        if self.lost_share > _MANY:
            found.append(self._share)
        found += self._rejected
        found += [
            f"{name} repeats one position for {share:.0%} of the time while its neighbours move"
            for name, share in self.frozen.items()
            if share > _MANY
        ]
        if self.undetermined:
            found.append(f"the markers do not determine {', '.join(self.undetermined)}")
        if self.height_estimated and self._is_no_adult:
            found.append(f"the body height would be {self.height:.2f} m, {self.height_from}")
        return tuple(found)

    @property
    def _rejected(self) -> list[str]:
        """Phrases on the markers that are lost most of the time."""
        found = []
        for column, name in enumerate(self.names):
            seen = ~np.isnan(self.weights[:, column])
            lost = seen & (self.weights[:, column] < LOST)
            if 2 * lost.sum() > seen.sum():  # as joints are undetermined for half of the time
                away = 1e3 * float(np.median(self.errors[lost, column]))
                share = lost.sum() / seen.sum()
                found.append(f"{name} is {away:.0f} mm from its place for {share:.0%} of the time")
        return found

    @property
    def _is_no_adult(self) -> bool:
        return self.height is not None and not _SHORT_ADULT < self.height < _TALL_ADULT

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
        lines += [
            f"{name} repeats one position for {share:.0%} of the time while its neighbours move; "
            "these samples count as missing."
            for name, share in self.frozen.items()
        ]
        lines += [f"{each}." for each in self.lost[:20]]
        if len(self.lost) > 20:
            lines.append(f"{len(self.lost) - 20} more spans of lost markers.")
        return "\n".join(lines)

    def __repr__(self) -> str:
        height = "" if self.height is None else f", body height {self.height:.2f} m"
        return (
            f"MarkerFit({len(self.motion)} samples, {len(self.names)} markers, mean error "
            f"{1e3 * self.mean_error:.1f} mm, {len(self.lost)} spans of lost "
            f"markers{height}, {self.seconds:.1f} s)"
        )


def check_fit(fit: MarkerFit) -> None:
    """Refuse a fit that is none.

    Raises:
        ValueError: the typical error is above 40 mm, markers are lost for three quarters of the
            time, the others determine no joint, or the estimated body height is outside 0.8 to
            2.4 m; names likely causes.
    """
    if fit.typical_error > _NO_FIT:
        usual = f"{1e3 * _USUAL:.0f} mm at most are usual"
        found = f"{fit._distance} on {fit.model.name!r}, {usual}"
    elif fit.lost_share > _MOST:
        found = fit._share
    elif set(fit.undetermined) == set(fit.model.joint_names):
        found = "those that are near their places determine none of the joints"
    elif fit.height_estimated and not _SHORTEST < (fit.height or 0.0) < _TALLEST:
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
