"""Fits of single recordings or subjects, from the fit of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from geodesic_ocp.fitting.metric_fit import MetricFit
from geodesic_ocp.fitting.solve_program import solve_program
from geodesic_ocp.progress import Progress


def separate_fits(
    fit: MetricFit,
    by: str = "recording",
    *,
    progress: Progress | None = None,
) -> dict[str, MetricFit]:
    """A fit of every recording, or of every subject with all recordings, on the same segments.

    By the name of the recording or the subject.

    Raises:
        ValueError: by is neither "recording" nor "subject".
        NotConverged: Ipopt did not find a solution.
    """
    labels = units_of(fit, by)
    found: dict[str, MetricFit] = {}
    units = list(dict.fromkeys(labels))
    for number, unit in enumerate(units):
        if progress is not None:
            progress(f"fitting each {by}", number, len(units))
        chosen = [k for k, label in enumerate(labels) if label == unit]
        found[unit] = refit(fit, chosen)
    return found


def units_of(fit: MetricFit, by: str) -> list[str]:
    """For each recording its own label, or that of its subject.

    Raises:
        ValueError: by is neither "recording" nor "subject".
    """
    if by == "subject":
        return [each.subject for each in fit.recordings]
    if by != "recording":
        raise ValueError(f"by must be 'recording' or 'subject', got {by!r}")
    names = [each.name or "recording" for each in fit.recordings]
    return [
        f"{name} ({number + 1})" if names.count(name) > 1 else name
        for number, name in enumerate(names)
    ]


def refit(fit: MetricFit, chosen: Sequence[int]) -> MetricFit:
    """The fit of some of its recordings, by index, on the same segments.

    Raises:
        NotConverged: Ipopt did not find a solution.
    """
    parts = tuple(fit.program.parts[index] for index in chosen)
    program = replace(fit.program, parts=parts)
    near = fit.program.start_of(chosen, fit.outcome)
    return solve_program(program, fit.parameters, fit.family, near)
