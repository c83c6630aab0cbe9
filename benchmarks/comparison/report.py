"""The table of the benchmark in Markdown, and the machine on which it was made."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import numpy as np

from comparison.growth import Growth
from comparison.measurement import Measurement

_PACKAGES = ("geodesic_ocp", "casadi", "pin", "numpy", "scipy")
_HEADER = (
    "| route | found | median | 90 % | worst | error, median | worst | times the first |\n"
    "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
)


def machine() -> str:
    """Processor, number of cores, operating system and versions, in one sentence."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        processor = lines[0].split(":")[1].strip() if lines else processor
    versions = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    return (
        f"{processor}, {os.cpu_count()} cores, {platform.system()}, Python "
        f"{platform.python_version()}, {versions}."
    )


def table(title: str, rows: Iterable[Measurement] | str) -> str:
    """A heading and the rows of one section; a text instead of rows says why there are none."""
    if isinstance(rows, str):
        return f"## {title}\n\nNot measured: {rows}."
    rows = list(rows)
    notes = sorted({row.error for row in rows if row.error})
    about = f"Errors: {', '.join(notes)}.\n\n" if notes else ""
    return f"## {title}\n\n{about}{_HEADER}\n" + "\n".join(map(_line, rows))


def growth_table(curves: Iterable[Growth]) -> str:
    """Times against numbers of joints, with the fitted exponents."""
    parts = ["## Growth with the number of joints\n"]
    for curve in curves:
        exponent, _ = curve.fit
        arms = ""
        if curve.both_arms is not None:
            arms = f"; both human arms (14 joints) {_amount(curve.both_arms, 's')}"
        rows = {"median": curve.seconds, "first, with compilation": curve.first}
        parts += [
            f"{curve.name}: n^{exponent:.1f} from n = {curve.fitted_from}{arms}.\n",
            "| joints | " + " | ".join(f"{n:.0f}" for n in curve.joints) + " |",
            "| --- " + "| ---: " * curve.joints.size + "|",
        ]
        for name, times in rows.items():
            parts.append(f"| {name} | " + " | ".join(_amount(t, "s") for t in times) + " |")
        parts += [
            f"| found of {curve.pairs} | " + " | ".join(f"{n:.0f}" for n in curve.found) + " |\n",
        ]
    return "\n".join(parts)


def _line(row: Measurement) -> str:
    values = [np.median(row.values), np.percentile(row.values, 90.0), row.values.max()]
    runs = f"{row.solved.sum()} of {row.values.size}"
    cells = [row.name, f"{row.values.size} runs" if row.errors is None else runs]
    cells += [_amount(value, row.unit) for value in values]
    if row.errors is not None and row.solved.any():
        errors = row.errors[row.solved]
        cells += [_error(float(value), row) for value in (np.median(errors), errors.max())]
    else:
        cells += ["", ""]
    cells.append("" if np.isnan(row.ratio) else f"{row.ratio:.3g}")
    return f"| {' | '.join(cells)} |"


def _error(value: float, row: Measurement) -> str:
    return f"{100.0 * value:.1f} %" if row.error == "excess length" else f"{value:.0e}"


def _amount(value: float, unit: str) -> str:
    """A value with three digits and a readable unit."""
    if unit == "MB":
        return f"{value:.0f} MB"
    for factor, name in ((1e6, "us"), (1e3, "ms")):
        if value * factor < 999.5:
            return f"{value * factor:.3g} {name}"
    return f"{value:.3g} s"
