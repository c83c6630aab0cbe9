"""The bandwidth of what a filter has left in a motion."""

from __future__ import annotations

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.trajectory.motion import Motion


def bandwidth(motion: Motion, cutoff: float | None = None) -> float:
    """Frequency [Hz] up to which a motion varies: as given, of its filter, or of its sampling.

    A motion without frequencies above f has 2 f T independent values in the time T. Of a motion
    whose filter is not known, `Motion.filter` being None, f is half the sampling rate: every sample
    counts as independent, as in unfiltered data. If such a motion was filtered elsewhere, give the
    cut-off frequency.

    Raises:
        ValueError: the cut-off frequency is not positive.
    """
    frequency = motion.rate / 2.0
    if cutoff is not None:
        return min(as_positive("cutoff", cutoff, "Hz"), frequency)
    return frequency if motion.filter is None else min(motion.filter.bandwidth, frequency)
