"""Videos and animations of playbacks: GIF, WebP and MP4."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Collection, Iterable, Iterator
from itertools import chain
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import as_integer, as_number, as_positive
from geodesic_ocp.drawing.browser import Frame, frames
from geodesic_ocp.drawing.scene import PARAMETER, Playback
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.records import replacing

# colours of a GIF, and one that is transparent
_FREQUENT = 180
_RARE = 75
_COLOURS = _FREQUENT + _RARE
_SETTLED = 3  # largest change of a colour, of 255, that a GIF leaves out
_PAPER = 252  # least of three colours, of 255, that a GIF takes for white
_SAMPLED = 12  # frames from which a GIF takes its colours
# The Netscape application extension, which repeats the animation without end.
_FOREVER = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
HOLD = 0.5  # [s], for which the last frame stays


def write_gif(
    file: Path, pictures: Iterable[Frame], samples: list[Frame], times: list[int]
) -> None:
    """Write frames that stay for these times [ms], in colours of the samples."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata

    chosen = [sample[::2, ::2] for sample in samples[:: max(1, math.ceil(len(samples) / _SAMPLED))]]
    clear = _COLOURS
    colours = Image.new("P", (1, 1))
    palette = _palette(np.concatenate(chosen))
    colours.putpalette(palette)
    shown = np.zeros((0, 0, 3), dtype=np.uint8)
    before = np.zeros((0, 0), dtype=np.uint8)
    # Pillow's own writer of animations keeps all frames until the last one is there.
    with file.open("wb") as stream:
        for picture, time in zip(pictures, times, strict=True):
            if not shown.size:
                shown = picture.copy()
                height, width = shown.shape[:2]
                stream.write(b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0))
                stream.write(bytes(palette) + _FOREVER)
            change = np.abs(picture.astype(np.int16) - shown) > _SETTLED
            moved = change[..., 0] | change[..., 1] | change[..., 2]
            shown[moved] = picture[moved]
            now = np.array(
                Image.fromarray(shown).quantize(palette=colours, dither=Image.Dither.NONE)
            )
            now[now == clear] = clear - 1  # the same colour
            # Pillow's approximate search may take white for a tint.
            now[shown.min(axis=2) >= _PAPER] = clear - 1
            # What stays as it is, is transparent or left out, which saves most.
            differs = now != before if before.size else np.ones(now.shape, dtype=bool)
            fresh = np.where(differs, now, np.uint8(clear))
            before = now
            left, top, right, bottom = Image.fromarray(differs).getbbox() or (0, 0, 1, 1)
            part = np.ascontiguousarray(fresh[top:bottom, left:right])
            made = Image.fromarray(part, mode="P")
            stay = {"duration": time, "transparency": clear, "disposal": 1}
            for block in getdata(made, (left, top), include_color_table=False, **stay):
                stream.write(block)
        stream.write(b";")


def _palette(pixels: Frame) -> list[int]:
    """Get red, green and blue of 256 colours: the most frequent ones, and those far from them."""
    from PIL import Image

    image = Image.fromarray(pixels)
    found = list[int]()
    kinds = (Image.Quantize.MEDIANCUT, _FREQUENT), (Image.Quantize.MAXCOVERAGE, _RARE)
    for method, count in kinds:
        some = image.quantize(count, method=method, dither=Image.Dither.NONE).getpalette() or []
        found += some[: 3 * count]
    # Paper is white; what is left, and the transparent one, are that colour, too.
    found = found[: 3 * (_COLOURS - 1)]
    return found + [255] * (3 * (_COLOURS + 1) - len(found))


def write_webp(file: Path, pictures: Iterable[Frame], times: list[int]) -> None:
    """Write frames that stay for these times [ms]."""
    from PIL import Image

    images = (Image.fromarray(picture) for picture in pictures)
    first = next(images)
    look = {"quality": 80, "method": 2, "minimize_size": False}
    first.save(
        file, format="WEBP", save_all=True, append_images=images, duration=times, loop=0, **look
    )


def write_mp4(file: Path, pictures: Iterable[Frame], rate: float) -> None:
    """Write frames at this rate [1 / s] by ffmpeg, one at a time.

    Raises:
        ImportError: there is no ffmpeg.
        OSError: ffmpeg fails.
    """
    program = ffmpeg()
    frames = iter(pictures)
    first = next(frames)
    height, width = first.shape[:2]
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:.6g}"]
    made = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "23"]
    made += ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [program, "-y", "-loglevel", "error", *given, "-i", "-", "-an", *made]
    with subprocess.Popen(
        [*command, "-f", "mp4", str(file)], stdin=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            for picture in chain([first], frames):
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # ffmpeg says why
        except BaseException:
            process.kill()
            raise
        said = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise OSError(f"{file}: ffmpeg failed: {(said.splitlines() or ['no reason given'])[-1]}")


def ffmpeg() -> str:
    """Return path of the program ffmpeg.

    Raises:
        ImportError: there is none.
    """
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        found = shutil.which("ffmpeg")
    if found is None:
        raise ImportError("An .mp4 needs ffmpeg: pip install 'geodesic_ocp[show]'")
    return found


SUFFIXES = (".mp4", ".gif", ".webp", ".png")
_SMALLEST = 160  # [px], width
_LARGEST = 3840  # [px], width
_PASS = 4.0  # [s], of a path over its parameter
_TURN = 6.0  # [s], of the camera around what stands still
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

    A headless Chromium shoots them, without a screen or a network. A path over its parameter takes
    4 s; the last frame stays for half a second. If nothing moves, the camera turns around once, in
    6 s.

    Args:
        file: path, whose folder must exist.
        rate: rate of the frames [1 / s]; at most 50 for .gif, 100 for .webp and 240 for .mp4.
        width: width of the frames [px], from 160 to 3840; an odd one is reduced by 1.
        speed: at 2, it takes half of the time.
        at: time of a picture, in the playback's; the middle by default.
        layers: those that are shown; all but `playback.hidden` by default.
        progress: called with what is done, the number of frames drawn, and the total.

    Returns:
        Path of the file.

    Raises:
        ValueError: another suffix; rate, width, speed, time or layer out of range.
        ImportError: there is no playwright or no Chromium, or, for an .mp4, neither imageio-ffmpeg
            nor ffmpeg.
        OSError: the file cannot be written; what was there is left as it was.
    """
    path = Path(file)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"file: {path} must end in one of {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}")
    rate = as_positive("rate", rate, "1 / s")
    speed = as_positive("speed", speed)
    if rate > _FASTEST.get(suffix, math.inf):
        raise ValueError(f"rate must be at most {_FASTEST[suffix]:g} for {suffix}, got {rate:g}")
    width = as_integer("width", width, 1)
    if not _SMALLEST <= width <= _LARGEST:
        raise ValueError(f"width must be from {_SMALLEST} to {_LARGEST} pixels, got {width}")
    even = width - width % 2
    shown = playback if layers is None else playback.showing(layers)
    report = no_progress if progress is None else progress
    if suffix == ".png":
        from PIL import Image

        with replacing(path) as temporary:
            (picture,) = frames(shown, [_time(playback, at)], width=even)
            Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
        report("drawing frames", 1, 1)
        return path
    if at is not None:
        raise ValueError(f"at is the time of a .png, not of a {suffix}")
    if suffix == ".mp4":
        ffmpeg()  # before anything is drawn
    start, stop = playback.range
    instants = frame_times(playback, rate, speed)
    turns = None
    if start == stop:
        turns = [2.0 * np.pi * index / len(instants) for index in range(len(instants))]

    def drawn() -> Iterator[Frame]:
        made = frames(shown, instants, width=even, turns=turns)
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
            samples = frames(shown, early, width=even, turns=angles)
            write_gif(temporary, drawn(), list(samples), times)
    return path


def frame_times(playback: Playback, rate: float, speed: float) -> list[float]:
    """Return times of the frames, in the playback's; the last is its end."""
    start, stop = playback.range
    if start == stop:
        return [start] * max(2, round(_TURN * rate / speed))
    pace = speed * ((stop - start) / _PASS if playback.time_label == PARAMETER else 1.0)
    count = max(1, math.ceil((stop - start) * rate / pace - 1e-9))
    return [*(start + pace / rate * np.arange(count)).tolist(), stop]


def _durations(count: int, rate: float, step: int) -> list[int]:
    """Return times [ms] for which frames stay, multiples of step, that add up to count / rate."""
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
