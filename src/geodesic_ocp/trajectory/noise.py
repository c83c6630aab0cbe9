"""The noise of a recording: its spectrum, as the filter leaves it out, and surrogates of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.filters import noise_band, noise_density
from geodesic_ocp.trajectory.motion import Motion

_SMOOTHING = 1.0  # [Hz] to both sides, over which cross-spectra are averaged


@dataclass(frozen=True, eq=False)
class RecordingNoise:
    """Gaussian noise with the spectra and cross-spectra that a recording's residuals have.

    Above the bandwidth of the filter, where it removes what was recorded, they are those of the
    residuals (recorded minus filtered). Below, motion and noise cannot be told apart: there the
    noise is white, with the floor that the filter has read (`noise_density`) and the correlations
    between joints that the residuals have in the band of the floor.

    Attributes:
        factors: matrices L(f) (m, n, n) at the frequencies of a real Fourier transform, where
            L L* is the spectral density times half the sampling rate [rad^2].
        samples: number of samples k.
    """

    factors: Array
    samples: int

    @classmethod
    def of(cls, motion: Motion) -> RecordingNoise:
        """Return the noise of a filtered motion.

        Raises:
            ValueError: the motion was not filtered, so that there are no residuals.
        """
        if motion.filter is None or motion.unfiltered is None:
            raise ValueError(
                "the noise of this motion is not known, as it was taken without a filter, whose "
                "residuals are the noise (Motion.filtered, or without --no-filter); of a fit to "
                "markers give analyse its noise, noise=fit.noise"
            )
        rate = motion.rate
        samples = len(motion)
        transform = np.fft.rfft(motion.unfiltered - motion.q, axis=0)
        frequency = np.fft.rfftfreq(samples, 1.0 / rate)
        densities = transform[:, :, None] * transform[:, None, :].conj() / samples
        half = max(1, round(_SMOOTHING / frequency[1]))
        # A real signal's spectrum is mirrored at both ends.
        half = min(half, len(frequency) - 1)
        mirrored = np.concatenate(
            [densities[half:0:-1].conj(), densities, densities[-2 : -half - 2 : -1].conj()]
        )
        sums = np.cumsum(np.concatenate([np.zeros_like(mirrored[:1]), mirrored]), axis=0)
        smooth = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
        low, high = noise_band(rate)
        floor = densities[(frequency >= low) & (frequency <= high)].mean(axis=0).real
        wanted = noise_density(rate, motion.unfiltered) * rate / 2.0
        scale = np.sqrt(wanted / np.maximum(np.diag(floor), np.finfo(float).tiny))
        smooth[frequency < motion.filter.bandwidth] = floor * np.outer(scale, scale)
        squares, vectors = np.linalg.eigh(smooth)
        return cls(vectors * np.sqrt(np.maximum(squares, 0.0))[:, None, :], samples)

    def draw(self, random: np.random.Generator) -> Array:
        """Return noise (k, n) [rad or m], another at each call."""
        count, n, _ = self.factors.shape
        real, imaginary = random.normal(scale=np.sqrt(0.5), size=(2, count, n, 1))
        transform = (self.factors @ (real + 1j * imaginary))[:, :, 0]
        result: Array = np.fft.irfft(np.sqrt(self.samples) * transform, self.samples, axis=0)
        return result


class Noise(Protocol):
    """Noise of the coordinates of a motion, of which one can draw."""

    def draw(self, random: np.random.Generator) -> Array:
        """Return noise (k, n) [rad or m], another at each call."""
        ...


def surrogate(motion: Motion, noise: Noise, random: np.random.Generator) -> Motion:
    """Return the motion with noise, filtered again as it was: with a cut-off that was chosen from
    the noise chosen anew, or with the velocities of a cubic spline if it had no filter.

    Raises:
        ValueError: the noise is of another number of samples or joints.
    """
    used = motion.filter
    drawn = noise.draw(random)
    if drawn.shape != motion.q.shape:
        raise ValueError(
            f"the noise is of {drawn.shape} samples and joints, the motion of {motion.q.shape}: "
            "was it resampled after it was fitted?"
        )
    noisy = replace(motion, q=motion.q + drawn, velocity=None, unfiltered=None, filter=None)
    if used is None:
        return replace(noisy, velocity=noisy(noisy.time, 1))
    if used.duration is not None:
        return noisy.filtered(round(used.duration * motion.rate), used.order)
    return noisy.filtered(cutoff=None if used.chosen else used.cutoff)
