"""Frames written as GIF, WebP or MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from geodesic_ocp.viewer.video.frames import Frame

_FREQUENT, _RARE = 180, 75  # colours of a GIF, and one that is transparent
_COLOURS = _FREQUENT + _RARE
_SETTLED = 3  # largest change of a colour, of 255, that a GIF leaves out
_LOOKED_AT = 12  # frames from which a GIF takes its colours
HOLD = 0.5  # [s], for which the last frame stays


def write_gif(
    file: Path, pictures: Iterable[Frame], samples: list[Frame], times: list[int]
) -> None:
    """Write frames that stay for these times [ms], in colours of the samples."""
    from PIL import Image

    chosen = samples[:: max(1, len(samples) // _LOOKED_AT)]
    clear = _COLOURS
    colours = Image.new("P", (1, 1))
    palette = _palette(np.concatenate(chosen))
    colours.putpalette(palette)

    def reduced() -> Iterator[Image.Image]:
        """Frames whose pixels are transparent where they stay as they are, which saves most."""
        shown: Frame | None = None
        before = np.zeros(0)
        for picture in pictures:
            if shown is None:
                shown = picture.copy()
            moved = np.abs(picture.astype(np.int16) - shown).max(axis=2) > _SETTLED
            shown[moved] = picture[moved]
            image = Image.fromarray(shown).quantize(palette=colours, dither=Image.Dither.NONE)
            now = np.array(image)
            now[now == clear] = 0  # the same colour
            fresh = now if not before.size else np.where(now == before, clear, now)
            before = now
            made = Image.frombytes("P", image.size, fresh.astype(np.uint8).tobytes())
            made.putpalette(palette)
            yield made

    each = reduced()
    first = next(each)
    first.save(
        file,
        format="GIF",
        save_all=True,
        append_images=each,
        duration=times,
        loop=0,
        optimize=False,
        transparency=clear,
        disposal=1,
    )


def _palette(pixels: Frame) -> list[int]:
    """Red, green and blue of 256 colours: the most frequent ones, and those far from them."""
    from PIL import Image

    image, found = Image.fromarray(pixels), list[int]()
    kinds = (Image.Quantize.MEDIANCUT, _FREQUENT), (Image.Quantize.MAXCOVERAGE, _RARE)
    for method, count in kinds:
        some = image.quantize(count, method=method, dither=Image.Dither.NONE).getpalette() or []
        found += some[: 3 * count]
    # What is left, and the transparent one, are the first colour again.
    return (found + found[:3] * (_COLOURS + 1))[: 3 * (_COLOURS + 1)]


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
