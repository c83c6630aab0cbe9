"""Segments of a motion, checked."""

from __future__ import annotations

from collections.abc import Sequence

from geodesic_ocp.trajectory.motion import Motion


def as_segments(motion: Motion, segments: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The (start, stop) sample indices as integers.

    Raises:
        ValueError: they are not pairs, do not cover the motion without gaps, or one does not end
            after it starts.
    """
    try:
        segments = [(int(start), int(stop)) for start, stop in segments]
    except (TypeError, ValueError):
        raise ValueError(f"segments must be pairs (start, stop), got {segments!r}") from None
    edges = [segments[0][0], *(stop for _, stop in segments)] if segments else []
    starts = [start for start, _ in segments]
    if not edges or edges[0] != 0 or edges[-1] != len(motion) - 1 or starts != edges[:-1]:
        raise ValueError(
            f"segments must cover samples 0 to {len(motion) - 1} without gaps, got {segments}"
        )
    if any(start >= stop for start, stop in segments):
        raise ValueError(f"every segment must end after it starts, got {segments}")
    return segments
