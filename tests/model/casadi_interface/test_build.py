"""Building Pinocchio's CasADi interface: what happens where it cannot be built."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin
import pytest

from geodesic_ocp.compiled import cache
from geodesic_ocp.model.casadi_interface import build


@pytest.fixture
def compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program in place of the compiler, an empty cache, and a folder in place of Eigen's."""
    program = tmp_path / "compiler"
    monkeypatch.setenv("CXX", str(program))
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setattr(build, "_eigen", lambda headers, work: work)
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda name: None)
    return program


def fake(program: Path, commands: str) -> None:
    """A compiler that tells its version, and otherwise does what the commands say."""
    version = '[ "$1" = --version ] && echo "compiler 1.0" && exit'
    program.write_text(f"#!/bin/sh\n{version}\n{commands}\n")
    program.chmod(0o700)


def kept(tmp_path: Path) -> list[Path]:
    return list((tmp_path / "cache" / "pinocchio_casadi").iterdir())


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("file.cpp:1:2: error: no such type", "no such type"),
        ("fatal error: Killed signal terminated program cc1plus", "memory were not free"),
        ("undefined reference to casadi::SX", "does not fit CasADi's wheel"),
        ("error: No space left on device", "the disk is full"),
    ],
)
def test_a_compiler_that_fails_is_quoted(
    compiler: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], said: str, expected: str
) -> None:
    fake(compiler, f'echo "{said}" >&2; exit 1')
    assert build.main([]) == 1
    message = capsys.readouterr().err
    assert expected in message
    assert str(compiler) in message
    assert kept(tmp_path) == []


def test_a_library_that_does_not_work_is_not_kept(
    compiler: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake(compiler, 'while [ "$1" != -o ]; do shift; done; echo nonsense > "$2"')
    assert build.main([]) == 1
    assert "the library does not work" in capsys.readouterr().err
    assert kept(tmp_path) == []


def test_a_missing_compiler_is_named(compiler: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert build.main([]) == 1
    assert f"CXX='{compiler}' is not a program" in capsys.readouterr().err


def test_missing_headers_are_named(
    compiler: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake(compiler, "exit 0")
    monkeypatch.setattr(pin, "__file__", "/usr/lib/python3/dist-packages/pinocchio/__init__.py")
    assert build.main([]) == 1
    assert "pin has no header pinocchio/autodiff/casadi.hpp" in capsys.readouterr().err


def test_a_folder_that_others_can_write_to_is_not_used(
    compiler: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake(compiler, "exit 0")
    folder = tmp_path / "cache" / "pinocchio_casadi"
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert build.main([]) == 1
    assert "can be written to by other users" in capsys.readouterr().err


def test_what_was_built_can_be_removed(
    compiler: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "cache" / "pinocchio_casadi"
    folder.mkdir(parents=True)
    (folder / "pin-4.so").touch()
    assert build.main(["--remove"]) == 0
    assert capsys.readouterr().out == f"removed 1 from {folder}\n"
    assert kept(tmp_path) == []
