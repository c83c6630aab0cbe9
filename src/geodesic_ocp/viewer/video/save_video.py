"""save_video: a playback as a video, an animation or a picture."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import as_integer, as_number, as_positive
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.records import replacing
from geodesic_ocp.scenes.playback import PARAMETER, Playback
from geodesic_ocp.viewer.video.frames import Frame, frames
from geodesic_ocp.viewer.video.writers import HOLD, ffmpeg, write_gif, write_mp4, write_webp

SUFFIXES = (".mp4", ".gif", ".webp", ".png")
_SMALLEST, _LARGEST = 160, 3840  # [px], width
_PASS, _TURN = 4.0, 6.0  # [s], of a path over its parameter; of the camera around what stands still
_FASTEST = {".gif": 50.0, ".webp": 100.0, ".mp4": 240.0}  # [1 / s]; GIF: browsers show no more
_LOOKED_AT = 8  # frames that are drawn for the colours of a GIF


@shows_progress
def save_video(
    playback: Playback,
    file: str | PathLike[str],
    *,
    rate: float = 25.0,
    width: int = 960,
    speed: float = 1.0,
    at: float | None = None,
    layers: Collection[str] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Draw a playback into a video (.mp4), an animation (.gif, .webp) or a picture (.png).

    Neither a screen nor a browser is needed. A path over its parameter takes 4 s; the last frame
    stays for half a second. If nothing moves, the camera turns around once, in 6 s.

    Args:
        playback: what is drawn.
        file: path, whose folder must exist.
        rate: of the frames [1 / s]; at most 50 for .gif, 100 for .webp and 240 for .mp4.
        width: of the frames [px], from 160 to 3840; an odd one is reduced by 1.
        speed: at 2, it takes half of the time.
        at: time of a picture, in the playback's; the middle by default.
        layers: those that are shown; all but `playback.hidden` by default.
        progress: called with what is done, the number of frames drawn, and the total.

    Returns:
        Path of the file.

    Raises:
        ValueError: another suffix; rate, width, speed, time or layer out of range.
        ImportError: an .mp4 needs imageio-ffmpeg, or ffmpeg.
        OSError: the file cannot be written; what was there is left as it was.
    """
    path = Path(file)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"file: {path} must end in one of {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}")
    rate, speed = as_positive("rate", rate, "1 / s"), as_positive("speed", speed)
    if rate > _FASTEST.get(suffix, math.inf):
        raise ValueError(f"rate must be at most {_FASTEST[suffix]:g} for {suffix}, got {rate:g}")
    width = as_integer("width", width, 1)
    if not _SMALLEST <= width <= _LARGEST:
        raise ValueError(f"width must be from {_SMALLEST} to {_LARGEST} pixels, got {width}")
    even, shown = width - width % 2, _layers(playback, layers)
    report = no_progress if progress is None else progress
    if suffix == ".png":
        from PIL import Image

        with replacing(path) as temporary:
            picture = next(frames(playback, [_time(playback, at)], width=even, layers=shown))
            Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
        report("drawing frames", 1, 1)
        return path
    if at is not None:
        raise ValueError(f"at is the time of a .png, not of a {suffix}")
    if suffix == ".mp4":
        ffmpeg()  # before anything is drawn
    start, stop = playback.range
    instants, turns = frame_times(playback, rate, speed), None
    if start == stop:
        turns = [2.0 * np.pi * index / len(instants) for index in range(len(instants))]

    def drawn() -> Iterator[Frame]:
        made = frames(playback, instants, width=even, layers=shown, turns=turns)
        for done, frame in enumerate(made, start=1):
            yield frame
            report("drawing frames", done, len(instants))

    with replacing(path) as temporary:
        held = 0 if turns else round(HOLD * rate)
        if suffix == ".mp4":
            write_mp4(temporary, _held(drawn(), held), rate)
            return path
        times = _durations(len(instants), rate, 10 if suffix == ".gif" else 1)
        times[-1] += 0 if turns else round(1000.0 * HOLD)
        if suffix == ".webp":
            write_webp(temporary, drawn(), times)
        else:
            some = range(0, len(instants), max(1, len(instants) // _LOOKED_AT))
            angles = None if turns is None else [turns[index] for index in some]
            early = [instants[index] for index in some]
            samples = frames(playback, early, width=even, layers=shown, turns=angles)
            write_gif(temporary, drawn(), list(samples), times)
    return path


def frame_times(playback: Playback, rate: float, speed: float) -> list[float]:
    """Times of the frames, in the playback's; the last is its end."""
    start, stop = playback.range
    if start == stop:
        return [start] * max(2, round(_TURN * rate / speed))
    pace = speed * ((stop - start) / _PASS if playback.time_label == PARAMETER else 1.0)
    count = max(1, math.ceil((stop - start) * rate / pace - 1e-9))
    return [*(start + pace / rate * np.arange(count)).tolist(), stop]


def _durations(count: int, rate: float, step: int) -> list[int]:
    """Times [ms] for which frames stay, multiples of step, that add up to count / rate."""
    ends = np.round(np.arange(count + 1) * 1000.0 / rate / step).astype(int) * step
    durations: list[int] = np.diff(ends).tolist()
    return durations


def _held(pictures: Iterator[Frame], more: int) -> Iterator[Frame]:
    for picture in pictures:
        last = picture
        yield picture
    for _ in range(more):
        yield last


def _time(playback: Playback, at: float | None) -> float:
    start, stop = playback.range
    if at is None:
        return (start + stop) / 2.0
    instant = as_number("at", at)
    if not start <= instant <= stop:
        raise ValueError(f"at must be from {start:g} to {stop:g}, got {instant:g}")
    return instant


def _layers(playback: Playback, layers: Collection[str] | None) -> Sequence[str]:
    shown = playback if layers is None else playback.showing(layers)
    return [name for name in shown.layers if name not in shown.hidden]
