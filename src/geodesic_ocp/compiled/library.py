"""A compiled library: loaded from the cache, or made, at first quickly and then with optimization.

The library of TinyCC is made at once. When it has been used for some time, the system's compiler
starts in a process of its own, and its library takes over when it is ready. Both stay in the cache.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import casadi as ca

from geodesic_ocp.compiled import build, cache
from geodesic_ocp.compiled.compilers import (
    Compiler,
    compiler_choice,
    system_compiler,
    tiny_compiler,
)
from geodesic_ocp.compiled.source import core_text, source_text

# Use of the interpreted functions after which a library is worth its making [s].
_FIRST_WORTHWHILE = 0.2
# Use of TinyCC's library after which an optimized one is worth its making [s].
_WORTHWHILE = 0.5
# A source that another process left behind is ignored after this time [s].
_STALE = 600.0


class Library:
    """CasADi functions on R^dim and the core that calls them, as one shared library.

    Args:
        functions: gives the functions by their names, when they have to be compiled.
        fingerprint: text that changes with the functions.
        dim: of the manifold.
    """

    def __init__(
        self, functions: Callable[[], Mapping[str, ca.Function]], fingerprint: str, dim: int
    ) -> None:
        self._functions, self._dim = functions, dim
        self._fingerprint = fingerprint
        self._lock = threading.Lock()
        self._source: str | None = None
        self._loaded: ctypes.CDLL | None = None
        self._compiler: Compiler | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._next: Compiler | None = None
        self._used = 0.0
        self._has_searched = False
        self._compilers: list[Compiler] = []

    @property
    def compiler(self) -> Compiler | None:
        """The compiler of the library that is loaded."""
        return self._compiler

    def handle(self, at_once: bool) -> ctypes.CDLL | None:
        """The library; None where there is no compiler, or none that works.

        Args:
            at_once: compile if none is stored; otherwise only after some use.
        """
        if self._loaded is None or self._process is not None:
            with self._lock:
                self._advance(at_once)
        return self._loaded

    def used(self, seconds: float) -> None:
        """Report for how long the library has been computing."""
        self._used += seconds
        if self._next is not None and self._used > _WORTHWHILE and self._loaded is not None:
            with self._lock:
                if self._next is not None and self._process is None:
                    self._start(self._next)

    def _advance(self, at_once: bool) -> None:
        if self._loaded is None and self._process is None:
            if not self._has_searched:
                self._search()
            if self._loaded is None and (at_once or self._used > _FIRST_WORTHWHILE):
                self._make_first()
        elif self._process is not None and self._process.poll() is not None:
            compiler, failed = self._next, self._process.returncode != 0
            self._process = self._next = None
            if compiler is not None and not failed:
                self._load_stored(compiler)

    def _search(self) -> None:
        """Load the best library that is stored."""
        self._has_searched = True
        choice = compiler_choice()
        tiny = tiny_compiler() if choice in ("auto", "tcc") else None
        system = system_compiler() if choice in ("auto", "system") else None
        self._compilers = [compiler for compiler in (system, tiny) if compiler is not None]
        if any(self._load_stored(compiler) for compiler in self._compilers):
            self._next = system if self._compiler != system else None

    def _make_first(self) -> None:
        """Compile now where that is quick or asked for, else beside the interpreted functions."""
        compilers, self._compilers = self._compilers, []  # none is tried twice
        for compiler in reversed(compilers):
            if compiler.name == "tcc" or compiler_choice() == "system":
                if self._make(compiler):
                    self._next = compilers[0] if compilers[0] != compiler else None
                    return
            else:
                self._start(compiler)

    def _key(self, compiler: Compiler) -> str:
        versions = f"{version('geodesic_ocp')} {version('casadi')}"
        parts = (versions, core_text(), compiler.identity, self._fingerprint)
        return sha256("\0".join(parts).encode()).hexdigest()[:32]

    def _load_stored(self, compiler: Compiler) -> bool:
        for folder in {cache.usable_folder(), *_folders_of_this_process}:
            file = cache.find(folder, self._key(compiler))
            if file is not None and self._load(file, compiler):
                return True
        return False

    def _load(self, file: Path, compiler: Compiler) -> bool:
        _load_mathematics()
        try:
            self._loaded = ctypes.CDLL(str(file))
        except OSError as error:
            _warn(f"a compiled library cannot be loaded: {error}")
            return False
        self._compiler = compiler
        return True

    def _text(self) -> str:
        if self._source is None:
            self._source = source_text(self._functions(), self._dim)
        return self._source

    def _write_source(self, name: str | None = None) -> Path:
        """The source in the cache or, where that has no space left, in a temporary folder."""
        text = self._text()
        for folder in (cache.usable_folder(), cache.temporary_folder()):
            _folders_of_this_process.add(folder)
            source: Path | None = None
            try:
                if name is None:
                    handle, path = tempfile.mkstemp(".c", "build-", folder)
                    os.close(handle)
                    source = Path(path)
                    source.write_text(text)
                else:
                    source = folder / name
                    if source.exists() and time.time() - source.stat().st_mtime > _STALE:
                        source.unlink()
                    with source.open("x") as file:
                        file.write(text)
                return source
            except FileExistsError:
                raise
            except OSError as error:
                failure = error
                if source is not None:
                    source.unlink(missing_ok=True)
        raise failure

    def _make(self, compiler: Compiler) -> bool:
        """Compile now."""
        try:
            file = build.build(self._write_source(), self._key(compiler), list(compiler.command))
        except (OSError, subprocess.CalledProcessError) as error:
            reason = getattr(error, "stderr", None) or str(error)
            _warn(f"{compiler.command[0]} failed: {reason.strip().splitlines()[-1]}")
            return False
        return self._load(file, compiler)

    def _start(self, compiler: Compiler) -> None:
        """Compile in a process of its own; another one may already be at it."""
        self._next = compiler
        key = self._key(compiler)
        try:
            source = self._write_source(f"{key}.c")
            command = [sys.executable, "-I", build.__file__, str(source), key, *compiler.command]
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            # The thread holds on to the process until it ends, also if this object does not.
            threading.Thread(target=self._process.wait, daemon=True).start()
        except OSError:  # without an optimized library, all goes on as before
            self._next = None


# Where this process has put libraries: a temporary folder where the cache has no space left.
_folders_of_this_process: set[Path] = set()


@lru_cache(maxsize=1)
def _load_mathematics() -> None:
    """Make the C library's sin, cos, ... visible: libraries are linked without it."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL("libm.so.6", mode=ctypes.RTLD_GLOBAL)


def _warn(reason: str) -> None:
    warnings.warn(f"functions stay interpreted, and slower: {reason}", RuntimeWarning, stacklevel=2)
