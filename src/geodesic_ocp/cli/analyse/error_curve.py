"""The error against the number of synergies, on the command line."""

from __future__ import annotations

from contextlib import closing

from geodesic_ocp.cli.interrupts import ProgressBar
from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.comparison.compare_metrics import compare_metrics
from geodesic_ocp.comparison.metric_comparison import MetricComparison
from geodesic_ocp.synergies.analyse import Analysis

_SPACING, _CANDIDATES = 0.05, 70  # of possible cuts: at least [s], and about at most


def error_curve(analysis: Analysis) -> MetricComparison:
    """Compare metrics at equal numbers of synergies, each with its best cuts; print the errors."""
    spacing = max(_SPACING, analysis.motion.duration / _CANDIDATES)
    thresholds = () if analysis.threshold is None else (analysis.threshold,)
    with printed_warnings(), closing(ProgressBar()) as bar:
        comparison = compare_metrics(
            analysis.model, analysis.motion, spacing=spacing, thresholds=thresholds, progress=bar
        )
    print(
        f"\nmean errors with the cuts of least joint error for each metric, {spacing:.2f} s or "
        f"more apart\n\n{comparison.table()}"
    )
    return comparison
