"""Frames written as GIF, WebP or MP4."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.viewer.video.frames import Frame

_FREQUENT, _RARE = 180, 75  # colours of a GIF, and one that is transparent
_COLOURS = _FREQUENT + _RARE
_SETTLED = 3  # largest change of a colour, of 255, that a GIF leaves out
_PAPER = 252  # least of three colours, of 255, that a GIF takes for white
_LOOKED_AT = 12  # frames from which a GIF takes its colours
# The Netscape application extension, which repeats the animation without end.
_FOREVER = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
HOLD = 0.5  # [s], for which the last frame stays


def write_gif(
    file: Path, pictures: Iterable[Frame], samples: list[Frame], times: list[int]
) -> None:
    """Write frames that stay for these times [ms], in colours of the samples."""
    from PIL import Image
    from PIL.GifImagePlugin import getdata

    chosen = [
        sample[::2, ::2] for sample in samples[:: max(1, math.ceil(len(samples) / _LOOKED_AT))]
    ]
    clear = _COLOURS
    colours = Image.new("P", (1, 1))
    palette = _palette(np.concatenate(chosen))
    colours.putpalette(palette)
    shown, before = np.zeros((0, 0, 3), dtype=np.uint8), np.zeros((0, 0), dtype=np.uint8)
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
            pale = shown >= _PAPER  # which Pillow's approximate search may take for a tint
            now[pale[..., 0] & pale[..., 1] & pale[..., 2]] = clear - 1
            # What stays as it is, is transparent or left out, which saves most.
            differs = now != before if before.size else np.ones(now.shape, dtype=bool)
            fresh = np.where(differs, now, np.uint8(clear))
            before = now
            (top, bottom), (left, right) = (
                _extent(np.asarray(differs.any(axis=axis))) for axis in (1, 0)
            )
            made = Image.fromarray(np.ascontiguousarray(fresh[top:bottom, left:right]), mode="P")
            stay = {"duration": time, "transparency": clear, "disposal": 1}
            for block in getdata(made, (left, top), include_color_table=False, **stay):
                stream.write(block)
        stream.write(b";")


def _extent(there: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last place, plus one, that is there; one place if there is none."""
    found = np.flatnonzero(there)
    return (int(found[0]), int(found[-1]) + 1) if len(found) else (0, 1)


def _palette(pixels: Frame) -> list[int]:
    """Red, green and blue of 256 colours: the most frequent ones, and those far from them."""
    from PIL import Image

    image, found = Image.fromarray(pixels), list[int]()
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
    made = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "23", "-movflags", "+faststart"]
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
    """Path of the program ffmpeg.

    Raises:
        ImportError: there is none.
    """
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        found = shutil.which("ffmpeg")
    if found is None:
        raise ImportError("An .mp4 needs ffmpeg: pip install 'geodesic_ocp[viewer]'")
    return found
