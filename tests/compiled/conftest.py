"""Fixtures of the tests of compiled code: an empty cache, and each compiler in turn."""

from __future__ import annotations

from pathlib import Path

import pytest

from geodesic_ocp.compiled import cache, library


@pytest.fixture(autouse=True)
def _empty_temporary_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """Libraries that another test has put there would be found."""
    monkeypatch.setattr(cache, "_temporary", {})


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of libraries in an empty cache."""
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(tmp_path / "cache"))
    return cache.cache_folder()


def choose(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Use one of the compilers; skip the test where it is missing."""
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, name)
    if name != "none" and not library.compilers():
        pytest.skip(f"there is no C compiler of the kind {name!r} here")


@pytest.fixture
def tcc(monkeypatch: pytest.MonkeyPatch) -> None:
    choose(monkeypatch, "tcc")


# The system's compiler takes two seconds for the library of a metric.
@pytest.fixture(params=["tcc", pytest.param("system", marks=pytest.mark.slow)])
def compiler(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each of the compilers in turn."""
    choose(monkeypatch, request.param)
    return str(request.param)


@pytest.fixture(params=["tcc", pytest.param("system", marks=pytest.mark.slow), "none"])
def route(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each of the compilers in turn, and none."""
    choose(monkeypatch, request.param)
    return str(request.param)
