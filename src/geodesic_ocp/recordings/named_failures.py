"""Failures to read a file, as sentences that begin with its name."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from geodesic_ocp.errors import RecordingError


@contextmanager
def named_failures(file: Path) -> Iterator[None]:
    """Raise failures of the operating system, of decoding and of values as RecordingError."""
    try:
        yield
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror or failure}") from None
    except csv.Error as failure:
        raise RecordingError(f"{file}: is not a table: {failure}") from None
    except UnicodeDecodeError as failure:
        raise RecordingError(
            f"{file}: is not text in UTF-8 (byte {failure.start}); save it as UTF-8"
        ) from None
    except ValueError as failure:
        if isinstance(failure, RecordingError) and str(failure).startswith(str(file)):
            raise
        raise RecordingError(f"{file}: {failure}") from None
