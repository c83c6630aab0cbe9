"""Plots of the benchmark: distributions of times, and growth with the number of joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from comparison.growth import Growth
from comparison.measurement import Measurement


def save_distributions(file: Path, rows: Sequence[Measurement], title: str) -> None:
    """Fraction of the pairs that each route has found within a time."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    latest = max(float(row.values.max()) for row in rows)
    for row in rows:
        times = np.sort(row.values[row.solved])
        found = np.arange(1, times.size + 1) / row.values.size
        times, found = np.append(times, latest), np.append(found, found[-1:])
        axes.step(1e3 * times[: found.size], 100.0 * found, where="post", label=row.name)
    axes.set(xscale="log", xlabel="time [ms]", ylabel="pairs found [%]", ylim=(0.0, 101.0))
    axes.set_title(title)
    axes.grid(which="both", alpha=0.25)
    figure.legend(loc="outside right upper", frameon=False)
    _save(figure, file)


def save_growth(file: Path, curves: Sequence[Growth]) -> None:
    """Median time against the number of joints, with the fitted power."""
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for curve in curves:
        exponent, factor = curve.fit
        label = rf"{curve.name}, $n^{{{exponent:.1f}}}$"
        (line,) = axes.plot(curve.joints, 1e3 * curve.seconds, "o-", label=label, markersize=4)
        fitted = np.array([curve.fitted_from, curve.joints.max()])
        color = line.get_color()
        axes.plot(fitted, 1e3 * factor * fitted**exponent, "--", color=color, linewidth=0.8)
        if curve.both_arms is not None:
            axes.plot(14, 1e3 * curve.both_arms, "*", color=color, markersize=11)
    axes.plot([], [], "*", color="gray", markersize=11, label="both human arms")
    axes.plot([], [], "--", color="gray", linewidth=0.8, label="fitted power")
    ticks = sorted({int(n) for curve in curves for n in curve.joints})
    axes.set(xscale="log", yscale="log", xlabel="joints of a planar chain", ylabel="time [ms]")
    axes.set_xticks(ticks, [str(n) for n in ticks], minor=False)
    axes.minorticks_off()
    axes.set_title("Logarithmic map, median time")
    axes.grid(alpha=0.25)
    figure.legend(loc="outside right upper", frameon=False)
    _save(figure, file)


def _save(figure: Figure, file: Path) -> None:
    for suffix in (".png", ".pdf"):
        figure.savefig(file.with_suffix(suffix), dpi=120)
