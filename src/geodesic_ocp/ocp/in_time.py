"""A path in time: the motion that a time law makes of it."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.timing import TimeLaw, time_law
from geodesic_ocp.sampled import Motion

_SAME = 1e-6  # of lengths, relative


def moved_along(path: Path, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
    """The path at instants of a time law, or from rest to rest in a duration [s].

    Raises:
        ValueError: a duration or rate that is not positive, a path of no length, or a time law of
            another length.
    """
    rate, length = as_positive("rate", rate, "Hz"), path.length
    if not length > 0.0:
        raise ValueError("the path has no length, along which there is no motion")
    if isinstance(timing, TimeLaw):
        law = timing
        if abs(law.length - length) > _SAME * length:
            raise ValueError(
                f"the time law covers a length of {law.length:.6g}, the path has {length:.6g}"
            )
    else:
        law = time_law(length, as_positive("duration", timing, "s"), 0.0, 0.0)
    count = max(1, round(law.duration * rate))
    time = np.linspace(0.0, law.duration, count + 1)
    covered = law(time)
    if np.any(covered < -_SAME * length) or np.any(covered > (1.0 + _SAME) * length):
        raise ValueError("the time law leaves the path: it runs back beyond an end")
    s = path.at_length(np.clip(covered, 0.0, length))
    q, slope = path(s), path(s, 1)
    speeds = np.array([path.metric.norm(*each) for each in zip(q, slope, strict=True)])
    share = np.divide(law(time, 1), speeds, out=np.zeros_like(speeds), where=speeds > 0.0)
    names = path.metric.joint_names or tuple(f"q[{index}]" for index in range(path.metric.dim))
    return Motion(time, q, names, slope * share[:, None])
