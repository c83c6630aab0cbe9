"""Pinocchio's reader of URDF, whose parser in C++ says on the standard error stream alone what is
wrong.
"""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")
# An error and the line of the parser's source that follows it.
_MESSAGE = re.compile(r"^Error:\s*(.*)\n(?:\s+at line .*\n?)?", re.MULTILINE)
_STREAM = threading.Lock()  # the standard error stream is the process's


@dataclass(frozen=True)
class Parsed(Generic[T]):
    """What was read, and errors of the parser, which leaves out elements that it cannot read."""

    value: T
    messages: tuple[str, ...]


def parsed(build: Callable[[], T]) -> Parsed[T]:
    """Return what a function of Pinocchio reads from a URDF, with the messages of its parser.

    Meanwhile the standard error stream of the process goes to a file; what is not of the parser is
    written to the stream afterwards.

    Raises:
        ValueError: Pinocchio cannot read it; gives the messages.
    """
    with _STREAM, tempfile.TemporaryFile() as sink:
        stderr = os.dup(2)
        os.dup2(sink.fileno(), 2)
        failure: Exception | None = None
        try:
            value = build()
        except Exception as error:
            failure = error
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        sink.seek(0)
        written = sink.read().decode(errors="replace")
    if others := _MESSAGE.sub("", written):
        os.write(2, others.encode())
    messages = tuple(dict.fromkeys(_MESSAGE.findall(written)))
    if failure is not None:
        raise ValueError("; ".join(messages) or str(failure))
    return Parsed(value, messages)
