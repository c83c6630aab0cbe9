"""MarkerFit: a motion that was fitted to markers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.lost_markers import LostMarker
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.frame_motion import FrameMotion
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True, eq=False, repr=False)
class MarkerFit:
    """A motion that was fitted to markers, and how well it fits.

    Attributes:
        motion: of the model's joints, with the pose of the thorax if it is known, and the subject
            with the height.
        model: with the lengths of the person.
        base: pose of the model's base in the space of the markers; None if it is fixed.
        names: of the m markers that were fitted.
        segments: that they are fixed to.
        errors: distances of markers from their fitted positions (k, m) [m]; NaN where missing.
        weights: that the markers kept, from 1 to 0 (k, m); NaN where missing.
        lost: spans of time in which markers lost their weight.
        offsets: on the segments [m], by marker, for the model's lengths.
        lengths: of segments [m] by name; "shoulder half width" is half the distance between the
            shoulders.
        height: of the person [m], or None for a model that is not of a person.
        height_from: where the height was taken from, in words.
        undetermined: joints that the markers do not determine for at least half of the time, where
            smoothness and limits choose.
        marker_set: name of the marker set.
        left_out: markers of the recording that were not used.
        seconds: that the fit took.
        iterations: of Ipopt.
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
    marker_set: str
    left_out: tuple[str, ...]
    seconds: float
    iterations: int

    def table(self) -> Table:
        """Errors of every marker, and the share of time in which it is missing or lost."""
        rows = []
        missing = np.isnan(self.errors)
        for column, name in enumerate(self.names):
            seen = self.errors[~missing[:, column], column]
            kept = self.weights[~missing[:, column], column]
            rows.append(
                (
                    name,
                    self.segments[column],
                    1e3 * float(seen.mean()),
                    1e3 * float(np.percentile(seen, 95)),
                    1e3 * float(seen.max()),
                    100.0 * float(missing[:, column].mean()),
                    100.0 * float(np.mean(kept < 0.25)),
                )
            )
        header = (
            "marker",
            "segment",
            "mean error [mm]",
            "95 % below [mm]",
            "max [mm]",
            "missing [%]",
            "lost [%]",
        )
        return Table(header, tuple(rows), self._note)

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
