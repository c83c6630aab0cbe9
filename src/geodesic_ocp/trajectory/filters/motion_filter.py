"""How a motion was filtered, and how noisy it was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array

# Noise bandwidth of a Savitzky-Golay filter of order 2, times its duration: its middle weight is
# 9/4 over the number of samples of its window.
_BANDWIDTH_OF_WINDOW = 9.0 / 8.0


@dataclass(frozen=True, eq=False, repr=False)
class MotionFilter:
    """The filter of a motion, and the noise that was found in the recording.

    Attributes:
        kind: "smoothing spline" or "Savitzky-Golay filter of order 2".
        cutoff: -3 dB point of the smoothing spline [Hz]; None for Savitzky-Golay.
        duration: of the window of the Savitzky-Golay filter [s]; None for the smoothing spline.
        chosen: whether the cut-off was chosen from the noise floor.
        noise: standard deviation of the noise of every joint before filtering (n,) [rad or m].
        velocity_noise: that of the velocities after filtering (n,) [rad/s or m/s].
    """

    kind: str
    cutoff: float | None
    duration: float | None
    chosen: bool
    noise: Array
    velocity_noise: Array

    @property
    def bandwidth(self) -> float:
        """Cut-off frequency, or noise bandwidth of a Savitzky-Golay filter of order 2 [Hz]."""
        if self.cutoff is not None:
            return self.cutoff
        return _BANDWIDTH_OF_WINDOW / float(self.duration or np.inf)

    def select(self, columns: list[int]) -> MotionFilter:
        """The filter of these joints."""
        noise, velocity_noise = self.noise[columns], self.velocity_noise[columns]
        return MotionFilter(
            self.kind, self.cutoff, self.duration, self.chosen, noise, velocity_noise
        )

    def __repr__(self) -> str:
        chosen = " (chosen)" if self.chosen else ""
        size = (
            f"window {self.duration:.3g} s"
            if self.cutoff is None
            else f"cut-off {self.cutoff:.1f} Hz"
        )
        return f"MotionFilter({self.kind}, {size}{chosen}, noise {self._noise})"

    def __str__(self) -> str:
        """As a sentence."""
        if self.cutoff is None:
            size = f"with a window of {self.duration:.3g} s"
        else:
            how = ", chosen from the noise floor" if self.chosen else ""
            size = f"with a cut-off frequency of {self.cutoff:.3g} Hz{how}"
        return f"Filtered by a {self.kind} {size}; noise of the joints: {self._noise}."

    @property
    def _noise(self) -> str:
        low, high = (f"{1e3 * float(end):.2g}" for end in (self.noise.min(), self.noise.max()))
        return f"{low} mrad" if low == high else f"{low} to {high} mrad"
