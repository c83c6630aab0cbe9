"""Figures of metrics that are compared: error against the number of segments."""

from __future__ import annotations

from itertools import chain, cycle
from typing import TYPE_CHECKING, Any

from geodesic_ocp.arrays import as_choice
from geodesic_ocp.drawing.styles import COMPARED, line_styles, new_figure
from geodesic_ocp.studies.compare_metrics import MEASURES, MetricComparison
from geodesic_ocp.synergies.segment_costs import Measure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LABELS = {
    "joint": "mean joint error [rad]",
    "position": "mean error of the hand's position [m]",
    "orientation": "mean error of the hand's orientation [rad]",
}
_MARKS = "os^DvPXph*<>"
# numbers of segments, and a factor beyond the largest mark
_LEAST_SHOWN = 24
_BEYOND = 1.25


def _styles(count: int) -> list[dict[str, Any]]:
    if count <= len(COMPARED):
        return list(COMPARED[:count])
    return [
        {**style, "marker": mark}
        for style, mark in zip(line_styles(count), cycle(_MARKS), strict=False)
    ]


def draw_curves(axes: Axes, comparison: MetricComparison, measure: Measure | None = None) -> None:
    """Draw error against number of segments into axes, with a legend.

    >>> from matplotlib.figure import Figure
    >>> recording = go.trajectory.bundled_recording()
    >>> metrics = {"straight lines": go.Euclidean(7)}
    >>> part = recording.motion.part(0, 89)
    >>> comparison = go.studies.compare_metrics(recording.model, part, metrics, spacing=0.1)
    >>> axes = Figure().add_subplot()
    >>> go.drawing.draw_curves(axes, comparison)
    >>> axes.get_xlabel()
    'number of segments'

    Curves are optimal cuts, their filled marks the numbers worth having, hollow marks the
    rules.

    Args:
        axes: axes of matplotlib.
        comparison: the metrics, with their curves.
        measure: measure of the error; None is the one that the cuts minimize.

    Raises:
        ValueError: an unknown measure.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    measure = as_choice("measure", comparison.measure if measure is None else measure, MEASURES)
    best = {name: comparison.best_count(name) for name in comparison.curves}
    marked = [*best.values(), *(int(n) for t in comparison.by_rule.values() for n in t["segments"])]
    rules = dict.fromkeys(chain(*(table.index for table in comparison.by_rule.values())))
    shapes = dict(zip(rules, cycle("os^v"), strict=False))
    largest = max(int(curve.index[-1]) for curve in comparison.curves.values())
    shown = min(largest, max(_LEAST_SHOWN, int(_BEYOND * max(marked))))
    visible: list[float] = []
    for (name, curve), style in zip(comparison.curves.items(), _styles(len(best)), strict=True):
        errors = curve[measure]
        points = comparison.by_rule[name]
        few = {"markersize": 4.0} if len(errors) <= 12 else {"marker": "none"}
        axes.plot(errors, **{**style, **few}, label=name)
        at = {**style, "linestyle": "none", "zorder": 4}
        axes.plot([best[name]], [errors[best[name]]], **at, markersize=8.0)
        for rule, count, error in points[["segments", measure]].itertuples():
            hollow = at | {"marker": shapes[rule], "markersize": 6.5, "fillstyle": "none"}
            axes.plot([count], [error], **hollow)
        visible += [*errors[errors.index <= shown], *points[measure]]
    grey: dict[str, Any] = {"color": "0.35", "linestyle": "none"}
    axes.plot([], [], **grey, marker="o", markersize=8.0, label="least BIC")
    for rule, shape in shapes.items():
        hollow = {"marker": shape, "markersize": 6.5, "fillstyle": "none"}
        axes.plot([], [], **grey, **hollow, label=f"{rule} cuts")
    axes.legend(fontsize="small", frameon=True, framealpha=0.9)
    axes.set_yscale("log")
    if positive := [error for error in visible if error > 0.0]:
        axes.set_ylim(0.85 * min(positive), 1.15 * max(positive))
    axes.set_xlim(0.0, shown + 1.0)
    axes.set_xlabel("number of segments")
    axes.set_ylabel(_LABELS[measure])
    axes.grid(which="both", color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    # Numbers such as 0.02 instead of powers of ten.
    axes.yaxis.set_major_locator(LogLocator(base=10.0, subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def comparison_figure(comparison: MetricComparison) -> Figure:
    """Return error against number of segments in all three measures."""
    figure = new_figure(12.0, 4.6)
    panels = figure.subplots(1, 3)
    for axes, measure in zip(panels, MEASURES, strict=True):
        draw_curves(axes, comparison, measure)
    legends = [axes.get_legend() for axes in panels]
    labels = [text.get_text() for text in legends[0].get_texts()]
    handles = legends[0].legend_handles
    for legend in legends:  # one below all panels, where it covers no mark
        legend.remove()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    of = {"joint": "of the joints"}.get(comparison.measure, f"of the hand's {comparison.measure}")
    shown = f"{comparison.model.name}, {comparison.motion.duration:.1f} s"
    figure.suptitle(f"{shown}: cuts of least mean error {of}")
    return figure
