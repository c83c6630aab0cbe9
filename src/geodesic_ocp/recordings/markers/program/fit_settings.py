"""Settings of `fit_motion`, and the constants of its objective."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Base = Literal["fixed", "free"]

# Residuals count by their integral over time, relative to `noise`. Priors weigh as much as
# observations over this time [s]: errors of the markers on the skin last, so that a short recording
# says less about offsets than its number of samples suggests.
PRIOR_TIME = 10.0
# Translations of the root per rad: expected accelerations and jerks are so much of the joints' [m].
ROOT_LEVER = 0.2
# Spread of the joints about zero, or the limit next to it [rad]: one so wide that it hardly
# matters, and that of joints which the markers do not determine.
POSTURE_SPREAD, LOOSE_SPREAD = 10.0, 1.0
# Spread of segment lengths about their proportion to body height, relative; no more than an
# assumption of moderate size.
LENGTH_SPREAD = 0.05
# Spread of a body height about that of the model, if nothing else is known of it, relative.
HEIGHT_SPREAD = 0.3


@dataclass(frozen=True)
class FitSettings:
    """See `fit_motion`, whose arguments these are."""

    base: Base = "free"
    lengths: bool = True
    offsets: bool = True
    limits: bool = True
    noise: float = 0.002
    acceleration: float = 100.0
    jerk: float = 1000.0
    outlier: float = 0.03
