"""The build of pinocchio.casadi: everything around the half hour in which compilers run."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pinocchio_casadi
import pytest
from casadi_bindings import build, cache, checks, install, progress, target
from casadi_bindings.errors import CannotBuild
from casadi_bindings.target import MODULE, Target

NEW_ABI = b"\0_ZN6casadi8FunctionC1ERKNSt7__cxx1112basic_stringIcE\0"
OLD_ABI = b"\0_ZN6casadi8FunctionC1ERKSsRKSt6vectorINS\0"
VERSIONS = {"pin": "4.1.0", "libpinocchio": "4.1.0", "casadi": "3.8.2", "numpy": "2.4.0"}


@pytest.fixture
def wheels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Target:
    """Folders like those of an environment, and a cache that is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    site = tmp_path / "site-packages"
    pinocchio = site / "cmeel.prefix" / "lib" / "python3" / "site-packages" / "pinocchio"
    pinocchio.mkdir(parents=True)
    (pinocchio / "__init__.py").write_text("import one\n")
    casadi = site / "casadi"
    (casadi / "include" / "casadi").mkdir(parents=True)
    (casadi / "include" / "casadi" / "casadi.hpp").touch()
    (casadi / "cmake").mkdir()
    (casadi / "libcasadi.so").write_bytes(NEW_ABI)
    return Target(VERSIONS, pinocchio, casadi)


@pytest.fixture
def works(monkeypatch: pytest.MonkeyPatch) -> None:
    """The import, which cannot be tried with folders that are made up, succeeds."""
    monkeypatch.setattr(install, "import_error", lambda: "")


def files(folder: Path) -> list[str]:
    return sorted(str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file())


def built(wheels: Target, content: bytes = b"machine code") -> Path:
    """A finished build in the cache."""
    made = wheels.casadi.parent / "made"
    made.mkdir(exist_ok=True)
    (made / MODULE).write_bytes(content)
    (made / "__init__.py").write_text("answer = 42\n")
    cache.cache_folder().mkdir(parents=True, exist_ok=True)
    return cache.store(wheels, made / MODULE, made / "__init__.py", 1700.0)


# What it is built for


def test_builds_differ_by_everything_that_they_are_linked_with(wheels: Target) -> None:
    def key(**changes: str) -> str:
        return Target(VERSIONS | changes, wheels.pinocchio, wheels.casadi).key

    assert wheels.key.startswith("pin-4.1.0_casadi-3.8.2_")
    assert key() == key(numpy="2.5.0") == wheels.key
    others = [key(casadi="3.9.0"), key(pin="4.2.0"), key(libpinocchio="4.1.1"), key(coal="3")]
    assert len({wheels.key, *others}) == 5
    elsewhere = Target(VERSIONS, wheels.pinocchio, wheels.casadi.parent / "other" / "casadi")
    assert elsewhere.key != wheels.key


def test_libraries_are_found_relative_to_the_module(wheels: Target) -> None:
    folders = [
        Path(entry.replace("$ORIGIN", str(wheels.pinocchio))).resolve()
        for entry in wheels.runpath.split(":")
    ]
    prefix = wheels.casadi.parent / "cmeel.prefix"
    assert folders == [(prefix / "lib").resolve(), wheels.casadi.resolve()]


def test_packages_not_installed_by_pip_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "casadi" / "__init__.py"
    other.parent.mkdir()
    other.touch()
    found = type("Found", (), {"origin": str(other)})
    monkeypatch.setattr(target.importlib.util, "find_spec", lambda name: found)
    with pytest.raises(CannotBuild, match=f"takes {other}, which is not pip's: is PYTHONPATH set"):
        target._imported_from(target.metadata.distribution("casadi"), "casadi")


def test_missing_wheels_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def distribution(name: str) -> None:
        raise target.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(target.metadata, "distribution", distribution)
    with pytest.raises(CannotBuild, match=r"pin is not installed for .*-m pip install 'pin"):
        target.installed_target()


def test_versions_of_this_environment_are_found() -> None:
    """The real wheels: versions of all that pin and casadi require."""
    try:
        found = target.installed_target()
    except CannotBuild as reason:
        pytest.skip(f"not an environment of pip's wheels: {reason}")
    if "cmeel" not in found.versions:
        pytest.skip("not an environment of pip's wheels")
    assert {"pin", "libpinocchio", "eigenpy", "coal", "cmeel-boost", "casadi"} <= set(found.linked)
    assert (found.pinocchio / "__init__.py").is_file()
    runpath = found.runpath.split(":")[0].replace("$ORIGIN", str(found.pinocchio))
    assert list(Path(runpath).glob("libpinocchio_default.so*"))


# Whether it can be built


def test_platforms_without_a_recipe_are_referred_to_conda(
    wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks.sys, "platform", "darwin")
    with pytest.raises(CannotBuild, match=r"Linux only, this is darwin.*environment\.yml"):
        checks.check_recipe(wheels)


@pytest.mark.parametrize(
    ("versions", "message"),
    [
        ({"pin": "3.9.0", "libpinocchio": "3.9.0"}, "for pin 4.1 and later 4.x, pin 3.9.0 is inst"),
        ({"pin": "4.0.0", "libpinocchio": "4.0.0"}, "pin 4.0.0 is installed .4.0 does not compile"),
        ({"pin": "5.0.0", "libpinocchio": "5.0.0"}, "pin 5.0.0 is installed"),
        ({"pin": "4.1.0", "libpinocchio": "4.0.0"}, "pin is 4.1.0, but libpinocchio 4.0.0"),
        ({"pin": "4.1.0"}, "libpinocchio missing"),
    ],
)
def test_versions_without_a_recipe_are_named(
    versions: dict[str, str], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks.sys, "platform", "linux")
    with pytest.raises(CannotBuild, match=message):
        checks.check_recipe(Target(versions, Path(), Path()))


def test_old_abi_of_casadi_is_named(wheels: Target) -> None:
    checks.check_casadi(wheels)
    (wheels.casadi / "libcasadi.so").write_bytes(OLD_ABI)
    with pytest.raises(CannotBuild, match=r"casadi 3\.8\.2 was compiled with the old C\+\+ ABI"):
        checks.check_casadi(wheels)


def test_casadi_without_headers_is_named(wheels: Target) -> None:
    shutil.rmtree(wheels.casadi / "include")
    with pytest.raises(CannotBuild, match="no library, headers or CMake files of CasADi"):
        checks.check_casadi(wheels)


def program(folder: Path, script: str) -> str:
    file = folder / "compiler"
    file.write_text(f"#!/bin/sh\n{script}\n")
    file.chmod(0o755)
    return str(file)


def test_compilers_that_fail_are_named(
    tmp_path: Path, wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not (Path(checks.sysconfig.get_path("include")) / "Python.h").is_file():
        pytest.skip("Python's headers are not installed")
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(CannotBuild, match="CXX=no-such-compiler is not a program"):
        checks.find_compiler(wheels)
    monkeypatch.setenv("CXX", program(tmp_path, "echo 'unknown option -std=c++17' >&2; exit 1"))
    with pytest.raises(CannotBuild, match=r"cannot compile and link (?s:.*)unknown option -std"):
        checks.find_compiler(wheels)
    # The program's path is what follows -o; this one cannot be run.
    fake = 'while [ "$1" != -o ]; do shift; done; printf "#!/bin/sh\\nexit 127\\n" > "$2";'
    monkeypatch.setenv("CXX", program(tmp_path, fake + 'chmod +x "$2"'))
    with pytest.raises(CannotBuild, match=r"cannot run a C\+\+17 program.*exit code is 127"):
        checks.find_compiler(wheels)
    monkeypatch.setenv("CXX", program(tmp_path, "exit 0"))
    with pytest.raises(CannotBuild, match=r"cannot run a C\+\+17 program.*No such file"):
        checks.find_compiler(wheels)
    monkeypatch.setenv("CXX", "g++ -O2")
    with pytest.raises(CannotBuild, match=r"CXX=g\+\+ -O2 is not a program.*without options"):
        checks.find_compiler(wheels)
    monkeypatch.delenv("CXX")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(CannotBuild, match="there is no C\\+\\+ compiler"):
        checks.find_compiler(wheels)


def test_compilers_have_absolute_paths(
    tmp_path: Path, wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CMake starts it from another folder."""
    if not (Path(checks.sysconfig.get_path("include")) / "Python.h").is_file():
        pytest.skip("Python's headers are not installed")
    monkeypatch.chdir(tmp_path)
    program(tmp_path, 'while [ "$1" != -o ]; do shift; done; cp /bin/true "$2"')
    monkeypatch.setenv("CXX", "./compiler")
    assert checks.find_compiler(wheels) == tmp_path / "compiler"


def test_missing_headers_of_python_are_named(
    tmp_path: Path, wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks.sysconfig, "get_path", lambda name: str(tmp_path))
    with pytest.raises(CannotBuild, match=r"headers are missing .*Python\.h"):
        checks.find_compiler(wheels)


@pytest.mark.slow
def test_compiler_of_this_machine_links_with_casadi() -> None:
    try:
        wheels = target.installed_target()
        checks.check_casadi(wheels)
    except CannotBuild as reason:
        pytest.skip(f"not an environment of pip's wheels: {reason}")
    if not any(map(shutil.which, ("c++", "g++", "clang++"))):
        pytest.skip("there is no C++ compiler")
    assert checks.find_compiler(wheels).is_file()


def test_jobs_fit_into_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def free(gigabytes: float) -> None:
        monkeypatch.setattr(checks, "free_memory", lambda: 1e9 * gigabytes)

    free(1000.0)
    assert checks.choose_jobs(None) == len(os.sched_getaffinity(0))
    free(4.0)
    assert checks.choose_jobs(None) == 1
    assert checks.choose_jobs(3) == 3
    free(2.0)
    with pytest.raises(CannotBuild, match=r"2\.0 GB of memory are free.*--jobs 1"):
        checks.choose_jobs(None)


def test_memory_of_a_container_counts(tmp_path: Path) -> None:
    group = tmp_path / "sys" / "fs" / "cgroup"
    for folder in (tmp_path / "proc", group):
        folder.mkdir(parents=True)
    (tmp_path / "proc" / "meminfo").write_text(
        "MemTotal: 9 kB\nMemAvailable:  8 kB\nHugePages: 0\n"
    )
    assert checks.free_memory(tmp_path) == 8192.0
    (group / "memory.max").write_text("max\n")
    assert checks.free_memory(tmp_path) == 8192.0
    (group / "memory.max").write_text("7000\n")
    (group / "memory.current").write_text("6500\n")
    (group / "memory.stat").write_text("anon 1500\ninactive_file 5000\n")
    assert checks.free_memory(tmp_path) == 5500.0


def test_full_disks_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    below = tmp_path / "not" / "there" / "yet"
    checks.check_space(below, 1.0)
    with pytest.raises(CannotBuild, match=f"GB are free in {tmp_path}, 1000000000.00 GB more are"):
        checks.check_space(below, 1e18)
    below.mkdir(parents=True)
    (below / "half").write_bytes(b"half")
    with monkeypatch.context() as patch:
        patch.setattr(checks.shutil, "disk_usage", lambda path: SimpleNamespace(free=0))
        checks.check_space(below, 4.0)
        with pytest.raises(CannotBuild, match="more are needed"):
            checks.check_space(below, 5.0)
    monkeypatch.setattr(checks.os, "access", lambda path, mode: False)
    with pytest.raises(CannotBuild, match=f"{below} cannot be written to"):
        checks.check_space(below, 1.0)


# The build's steps


def test_output_is_logged_and_foreign_settings_are_ignored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CXXFLAGS", "-march=native")
    monkeypatch.setenv("PYTHONPATH", "/opt/ros")
    log, seen = tmp_path / "build.log", []
    show = "import os; print('CXXFLAGS' in os.environ, 'PYTHONPATH' in os.environ)"
    build._run([sys.executable, "-c", show], log, seen.append)
    assert seen == ["False False\n"]
    assert log.read_text().endswith("False False\n")


@pytest.mark.parametrize(
    ("output", "meaning"),
    [
        ("fatal error: No space left on device", "the disk is full"),
        ("c++: fatal error: Killed signal terminated program cc1plus", "try --jobs 1"),
        ("ERROR: No matching distribution found for cmeel-eigen", "not offered by the package"),
        ("httpx.ConnectError: [Errno 101]", "package index cannot be reached"),
        ("error: no member named 'x'", "error: no member named 'x'"),
    ],
)
def test_failures_are_explained(output: str, meaning: str, tmp_path: Path) -> None:
    log = tmp_path / "build.log"
    with pytest.raises(CannotBuild, match=f"{log}; when the cause is mended") as failure:
        build._run([sys.executable, "-c", f"print({output!r}); raise SystemExit(1)"], log)
    assert meaning in str(failure.value)
    assert output in str(failure.value)


def test_cmake_starts_from_scratch_unless_it_succeeded_with_the_same_settings(
    tmp_path: Path,
) -> None:
    folder, log = tmp_path / "build", tmp_path / "build.log"

    def configure(*code: str) -> None:
        command = [sys.executable, "-c", ";".join(code), str(folder)]
        build._configure(command, folder, log)

    make = "import os, sys; os.mkdir(sys.argv[1]); open(sys.argv[1] + '/CMakeCache.txt', 'w')"
    with pytest.raises(CannotBuild):
        configure(make, "raise SystemExit(1)")
    configure(make)
    (folder / "object.o").touch()
    configure(make)
    assert (folder / "object.o").exists()
    configure(make, "'other settings'")
    assert not (folder / "object.o").exists()


def test_interruption_stops_the_program(tmp_path: Path) -> None:
    def stop(line: str) -> None:
        raise KeyboardInterrupt

    forever = "import time; print('started', flush=True); time.sleep(600)"
    with pytest.raises(KeyboardInterrupt):
        build._run([sys.executable, "-c", forever], tmp_path / "build.log", stop)


def test_tests_of_pinocchio_are_left_out(tmp_path: Path) -> None:
    file = tmp_path / "CMakeLists.txt"
    file.write_text(
        "add_subdirectory(utils)\nadd_subdirectory(unittest)\n  add_subdirectory(src)\n"
    )
    build._leave_out_tests(file)
    lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    assert lines == ["  add_subdirectory(src)"]
    with pytest.raises(CannotBuild, match="not as the recipe expects"):
        build._leave_out_tests(file)


def test_progress_counts_and_estimates(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        clock = itertools.chain([0.0, 0.0], itertools.repeat(300.0))
        patch.setattr(progress.time, "monotonic", clock.__next__)
        with progress.Progress("compiling") as shown:
            shown.ninja("ninja: Entering directory `build'")
            shown.ninja("[21/84] Building CXX object a.cpp.o")
    text = capsys.readouterr().out
    assert "compiling: 21 of 84 after 5 min, about 15 min to go" in text


# The cache


def test_finished_builds_are_found_unless_damaged(wheels: Target) -> None:
    assert cache.find(wheels) is None
    folder = built(wheels)
    assert cache.find(wheels) == folder
    assert built(wheels, b"other code") == folder
    assert (folder / MODULE).read_bytes() == b"other code"
    (folder / MODULE).write_bytes(b"other cod")
    assert cache.find(wheels) is None
    (built(wheels) / cache.RECORD).unlink()
    assert cache.find(wheels) is None


@pytest.mark.parametrize(
    "record", ["", "[]", "null", "{}", '{"sha256": null}', '{"versions": {}, "sha256": {}}']
)
def test_builds_with_damaged_records_are_ignored(record: str, wheels: Target) -> None:
    (built(wheels) / cache.RECORD).write_text(record)
    assert cache.find(wheels) is None


def test_one_run_at_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    order = []

    def other_run() -> None:
        with cache.locked(tmp_path):
            order.append("other")

    with cache.locked(tmp_path) as free:
        assert free
        with cache.locked(tmp_path, wait=False) as also_free:
            assert not also_free
        thread = threading.Thread(target=other_run)
        thread.start()
        thread.join(0.1)
        order.append("first")
    thread.join()
    assert order == ["first", "other"]
    assert f"waiting for another run in {tmp_path}" in capsys.readouterr().out


def test_unfinished_builds_are_not_purged(wheels: Target) -> None:
    folder = built(wheels)
    cache.work_folder(wheels).mkdir()
    with (
        cache.locked(cache.work_folder(wheels)),
        pytest.raises(CannotBuild, match="another run is building"),
    ):
        cache.purge()
    assert folder.exists()
    assert cache.purge()
    assert not cache.purge()


# In the environment


@pytest.mark.usefixtures("works")
def test_installed_build_is_removed_completely(wheels: Target) -> None:
    before = files(wheels.pinocchio)
    assert install.installed_key(wheels.pinocchio) is None
    install.install(wheels, built(wheels))
    assert files(wheels.pinocchio) == sorted([*before, MODULE, "casadi/__init__.py"])
    assert install.installed_key(wheels.pinocchio) == wheels.key
    assert install.remove(wheels.pinocchio)
    assert files(wheels.pinocchio) == before
    assert not (wheels.pinocchio / "casadi").exists()
    assert not install.remove(wheels.pinocchio)


def test_build_that_does_not_work_is_removed(
    wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, folder = files(wheels.pinocchio), built(wheels)
    monkeypatch.setattr(install, "import_error", lambda: "ImportError: undefined symbol")
    with pytest.raises(CannotBuild, match=r"taken out of the environment again.*undefined symbol"):
        install.install(wheels, folder)
    assert files(wheels.pinocchio) == before

    def interrupted() -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(install, "import_error", interrupted)
    with pytest.raises(KeyboardInterrupt):
        install.install(wheels, folder)
    assert files(wheels.pinocchio) == before
    assert cache.find(wheels) == folder


def test_foreign_bindings_are_not_touched(wheels: Target) -> None:
    (wheels.pinocchio / "casadi").mkdir()
    (wheels.pinocchio / "casadi" / "__init__.py").touch()
    assert install.installed_key(wheels.pinocchio) == install.FOREIGN
    assert not install.remove(wheels.pinocchio)
    assert (wheels.pinocchio / "casadi" / "__init__.py").exists()


@pytest.mark.usefixtures("works")
def test_other_versions_of_the_wheels_are_refused_on_import(
    wheels: Target, monkeypatch: pytest.MonkeyPatch
) -> None:
    install.install(wheels, built(wheels))
    source = (wheels.pinocchio / "casadi" / "__init__.py").read_text()
    versions = dict(wheels.linked)
    monkeypatch.setattr(target.metadata, "version", versions.__getitem__)
    names: dict[str, object] = {}
    exec(source, names)
    assert names["answer"] == 42
    versions["casadi"] = "3.9.0"
    with pytest.raises(ImportError, match=r"built for casadi 3\.8\.2, here it is 3\.9\.0: build"):
        exec(source, {})


@pytest.mark.slow
def test_import_check_reports_errors() -> None:
    """In this environment: an error, or pinocchio.casadi can be imported."""
    error = install.import_error()
    there = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", "import pinocchio.casadi"], capture_output=True
    )
    assert bool(error) == bool(there.returncode)
    if error:
        assert "No module named 'pinocchio.casadi'" in error


# The command line


@pytest.fixture
def command(
    wheels: Target, monkeypatch: pytest.MonkeyPatch, works: None
) -> Callable[..., Callable[..., int]]:
    """The command line in the made-up environment, with a build that is a function given here."""

    def with_build(make: Callable[..., tuple[Path, Path]]) -> Callable[..., int]:
        monkeypatch.setattr(pinocchio_casadi, "installed_target", lambda: wheels)
        monkeypatch.setattr(pinocchio_casadi, "build", make)
        monkeypatch.setattr(install, "imported_folder", lambda: wheels.pinocchio)
        monkeypatch.setattr(install, "wheel_folders", lambda: [wheels.pinocchio])
        monkeypatch.setattr(checks, "processors", lambda: 2)
        monkeypatch.setattr(checks, "check_recipe", lambda wheels: None)
        monkeypatch.setattr(checks, "find_compiler", lambda wheels: Path("/usr/bin/c++"))
        monkeypatch.setattr(checks, "choose_jobs", lambda asked: asked or 2)
        return lambda *arguments: pinocchio_casadi.main(list(arguments))

    return with_build


def make(wheels: Target, work: Path, compiler: Path, jobs: int) -> tuple[Path, Path]:
    (work / MODULE).write_bytes(b"machine code")
    (work / "__init__.py").write_text("answer = 42\n")
    return work / MODULE, work / "__init__.py"


def never(*arguments: object) -> tuple[Path, Path]:
    raise AssertionError("built although it is there")


def test_build_is_made_once_reused_and_removed(
    command: Callable[..., Callable[..., int]],
    wheels: Target,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = files(wheels.pinocchio)
    assert command(never)("--cached") == 3
    assert "no finished build for these versions" in capsys.readouterr().out
    assert command(make)() == 0
    text = capsys.readouterr().out
    assert "Building pinocchio.casadi for pin 4.1.0 and casadi 3.8.2" in text
    assert "takes about 28 minutes. It takes up to 7 GB of memory" in text
    assert f"installed into {wheels.pinocchio}" in text
    assert not cache.work_folder(wheels).exists()
    assert command(never)() == 0
    assert "already" in capsys.readouterr().out
    assert command(never)("--remove") == 0
    assert files(wheels.pinocchio) == before
    assert "--purge removes them, too" in capsys.readouterr().out
    assert command(never)("--cached") == 0
    assert install.installed_key(wheels.pinocchio) == wheels.key
    assert command(never)("--purge") == 0
    assert files(wheels.pinocchio) == before
    assert not cache.cache_folder().exists()
    capsys.readouterr()
    assert command(never)("--purge") == 0
    assert "there are no builds in" in capsys.readouterr().out
    assert command(never)("--remove") == 0
    assert "has no pinocchio.casadi that was put there by this tool" in capsys.readouterr().out


def test_interruptions_and_failures_lose_nothing(
    command: Callable[..., Callable[..., int]],
    wheels: Target,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(wheels: Target, work: Path, *others: object) -> tuple[Path, Path]:
        (work / "half").touch()
        raise KeyboardInterrupt

    def failed(wheels: Target, work: Path, *others: object) -> tuple[Path, Path]:
        assert (work / "half").exists()
        raise CannotBuild("ninja failed")

    assert command(interrupted)("--jobs", "1") == 130
    assert "the next run continues from here" in capsys.readouterr().err
    assert command(failed)() == 1
    assert capsys.readouterr().err == "pinocchio.casadi: ninja failed\n"
    assert install.installed_key(wheels.pinocchio) is None
    assert (cache.work_folder(wheels) / "half").exists()


def test_older_builds_are_replaced(
    command: Callable[..., Callable[..., int]], wheels: Target
) -> None:
    old = Target(VERSIONS | {"casadi": "3.8.0"}, wheels.pinocchio, wheels.casadi)
    install.install(old, built(old, b"old code"))
    assert command(make)() == 0
    assert install.installed_key(wheels.pinocchio) == wheels.key
    assert (wheels.pinocchio / MODULE).read_bytes() == b"machine code"


def test_foreign_bindings_are_used_if_they_work_and_named_otherwise(
    command: Callable[..., Callable[..., int]],
    wheels: Target,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (wheels.pinocchio / "casadi").mkdir()
    (wheels.pinocchio / "casadi" / "__init__.py").touch()
    assert command(never)() == 0
    assert "of its own: nothing to do" in capsys.readouterr().out
    monkeypatch.setattr(install, "import_error", lambda: "ImportError: libcasadi.so.3.6")
    assert command(never)() == 1
    assert "was not put there by this tool, and does not work" in capsys.readouterr().err


def test_damaged_builds_are_reported_and_rebuilt(
    command: Callable[..., Callable[..., int]],
    wheels: Target,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (built(wheels) / MODULE).write_bytes(b"half of the mach")
    assert command(never)("--cached") == 3
    assert "is damaged, and not used" in capsys.readouterr().out
    assert command(make)() == 0
    assert (wheels.pinocchio / MODULE).read_bytes() == b"machine code"


def test_system_errors_end_with_one_line(
    command: Callable[..., Callable[..., int]],
    wheels: Target,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = wheels.casadi.parent / "file"
    file.touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(file))
    assert command(make)() == 1
    assert capsys.readouterr().err == f"pinocchio.casadi: {file} cannot be written to\n"


@pytest.mark.parametrize(
    "arguments", [["--jobs", "0"], ["--jobs", "two"], ["--remove", "--cached"], ["again"]]
)
def test_wrong_usage_ends_with_code_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        pinocchio_casadi.main(arguments)
    assert "usage:" in capsys.readouterr().err


def test_record_of_a_build(wheels: Target) -> None:
    record = json.loads((built(wheels) / cache.RECORD).read_text())
    assert record["versions"] == {"casadi": "3.8.2", "libpinocchio": "4.1.0", "pin": "4.1.0"}
    assert record["seconds"] == 1700
