"""Errors of several metrics against the number of synergies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.comparison.error_curves import draw_error_curves
from geodesic_ocp.figures.new_figure import new_figure, save_figure
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.scores import MotionErrors
from geodesic_ocp.synergies.segment_costs import Measure
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MEASURES: tuple[Measure, ...] = ("joint", "position", "orientation")
_SHOWN = (4, 8, 12, 16, 20, 24)  # of many numbers of segments
_HEADER = ("metric", "cuts", "segments", "joints [rad]", "hand [m]", "hand [rad]")


@dataclass(frozen=True, eq=False)
class ErrorCurve:
    """Mean errors of one metric with optimal cuts, by the number of segments.

    Attributes:
        counts: numbers of segments (k,).
        joint, position, orientation: mean errors (k,) [rad, m, rad].
        criterion: Bayesian information criterion (k,).
        segments: (start, stop) sample indices, a tuple for each number.
    """

    counts: np.ndarray
    joint: Array
    position: Array
    orientation: Array
    criterion: Array
    segments: tuple[tuple[tuple[int, int], ...], ...]

    def __repr__(self) -> str:
        return (
            f"ErrorCurve({self.counts[0]} to {self.counts[-1]} segments, joint error "
            f"{self.joint[0]:.3g} to {self.joint[-1]:.3g})"
        )


@dataclass(frozen=True)
class OnlineErrors:
    """Mean errors with the cuts of the online rule: its threshold [rad] and its segments."""

    threshold: float
    count: int
    errors: MotionErrors


@dataclass(frozen=True, eq=False, repr=False)
class MetricComparison:
    """Errors of several metrics, each with its own optimal cuts, from `compare_metrics`.

    Attributes:
        model: the arm.
        motion: observed, filtered.
        measure: that the cuts minimize.
        curves: by metric, the errors with optimal cuts.
        online: by metric, the errors with the cuts of the online rule, by threshold.
    """

    model: Model
    motion: Motion
    measure: Measure
    curves: Mapping[str, ErrorCurve]
    online: Mapping[str, tuple[OnlineErrors, ...]]

    def __repr__(self) -> str:
        names = list(self.curves)[:3]
        best = ", ".join(f"{self.best_count(name)} ({name})" for name in names)
        best += ", ..." if len(self.curves) > len(names) else ""
        return (
            f"MetricComparison({self.model.name}, {self.motion.duration:.3g} s, cuts of least "
            f"{self.measure} error,\n  synergies worth having: {best})"
        )

    def _repr_markdown_(self) -> str:
        return self.table().markdown()

    def best_count(self, name: str) -> int:
        """The number of synergies worth having: that of the least Bayesian information criterion.

        With M independent samples of each of n joints, residuals of mean square R_j and noise of
        variance sigma_j^2, the number k minimizes

            M sum_j (log s_j^2 + R_j / s_j^2) + k (n + 2) log(M n),  s_j^2 = max(R_j, sigma_j^2).

        A segment has n + 2 parameters: the configuration, the time and the speed at its end. After
        a low-pass filter with cut-off frequency f, M is 2 f times the duration (Schwarz, The Annals
        of Statistics 6, 1978).

        Raises:
            ValueError: there is no such metric.
        """
        if name not in self.curves:
            raise ValueError(f"name must be one of {', '.join(self.curves)}, got {name!r}")
        curve = self.curves[name]
        return int(curve.counts[np.argmin(curve.criterion)])

    def table(self, counts: Sequence[int] | None = None) -> Table:
        """Mean errors of every metric: optimal cuts, then those of the online rule.

        Args:
            counts: numbers of segments; None shows 4, 8, ..., 24 and the number worth having.

        Raises:
            ValueError: a number of segments that was not compared.
        """
        known = {int(count) for curve in self.curves.values() for count in curve.counts}
        if missing := sorted(set(counts or ()) - known):
            raise ValueError(f"counts {missing} are not among those compared, {sorted(known)}")
        rows: list[tuple[str | int | float, ...]] = []
        for name, curve in self.curves.items():
            best = self.best_count(name)
            few = known if len(known) <= len(_SHOWN) else {*_SHOWN, best}
            shown = few if counts is None else set(counts)
            for index, count in enumerate(curve.counts.tolist()):
                if count in shown:
                    cuts = "optimal, least BIC" if count == best else "optimal"
                    errors = [float(getattr(curve, measure)[index]) for measure in _MEASURES]
                    rows.append((name, cuts, count, *errors))
            for point in self.online[name]:
                errors = [getattr(point.errors, measure) for measure in _MEASURES]
                rows.append((name, f"online, {point.threshold:g} rad", point.count, *errors))
        return Table(_HEADER, tuple(rows))

    def draw(
        self, axes: Axes, measure: Measure | None = None, *, max_count: int | None = None
    ) -> None:
        """Draw error against number of segments into axes, with a legend.

        Curves are optimal cuts, their filled marks the numbers worth having, hollow marks the
        online rule.

        Args:
            axes: of matplotlib.
            measure: of the error; None is the one that the cuts minimize.
            max_count: largest number shown; None shows somewhat more than what is marked.

        Raises:
            ValueError: an unknown measure.
        """
        measure = self.measure if measure is None else measure
        if measure not in _MEASURES:
            raise ValueError(f"measure must be one of {', '.join(_MEASURES)}, got {measure!r}")
        best = {name: self.best_count(name) for name in self.curves}
        curves = {n: (c.counts, getattr(c, measure), best[n]) for n, c in self.curves.items()}
        points = {
            name: [(point.count, float(getattr(point.errors, measure))) for point in found]
            for name, found in self.online.items()
        }
        draw_error_curves(axes, curves, points, measure, max_count)

    def plot(self) -> Figure:
        """Error against number of segments in all three measures."""
        figure = new_figure(12.0, 4.6)
        panels = figure.subplots(1, 3)
        for axes, measure in zip(panels, _MEASURES, strict=True):
            self.draw(axes, measure)
        legends = [axes.get_legend() for axes in panels]
        labels = [text.get_text() for text in legends[0].get_texts()]
        handles = legends[0].legend_handles
        for legend in legends:  # one below all panels, where it covers no mark
            legend.remove()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
        of = {"joint": "of the joints"}.get(self.measure, f"of the hand's {self.measure}")
        figure.suptitle(
            f"{self.model.name}, {self.motion.duration:.1f} s: cuts of least mean error {of}"
        )
        return figure

    def save(self, folder: str | FilePath) -> list[FilePath]:
        """Write table.csv (all numbers of segments), table.md, figure.png and figure.pdf.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be created or written to.
        """
        return write_together(folder, self._write)

    def _write(self, folder: FilePath) -> None:
        known = {int(count) for curve in self.curves.values() for count in curve.counts}
        (folder / "table.csv").write_text(self.table(sorted(known)).csv(), encoding="utf-8")
        (folder / "table.md").write_text(self.table().markdown(), encoding="utf-8")
        save_figure(self.plot(), folder)
