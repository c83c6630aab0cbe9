"""The cache of compiled libraries: complete files, private folders, nothing left behind."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from known_metrics import HalfPlane, Sphere

import geodesic_ocp as go
from geodesic_ocp.compiled import cache, library, source
from geodesic_ocp.compiled.library import Compiler, tiny_compiler

Q0, Q1 = np.array([1.0, 0.2]), np.array([1.4, 1.1])
pytestmark = pytest.mark.usefixtures("tcc")


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def is_compiled(metric: go.Metric) -> bool:
    return metric.kernels.available()


def test_a_library_appears_alone_under_the_digest_of_its_content(empty_cache: Path) -> None:
    assert is_compiled(HalfPlane())
    (file,) = empty_cache.iterdir()
    key, digest, _ = file.name.split(".")
    assert file.name == cache.file_name(key, file.read_bytes())
    assert len(key) == len(digest) == 32
    assert file.stat().st_mode & 0o077 == 0
    assert empty_cache.stat().st_mode & 0o777 == 0o700
    assert cache.stored() == [file]


def test_the_second_metric_loads_what_the_first_has_built(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert is_compiled(HalfPlane())
    monkeypatch.setattr(cache, "build", lambda *_: pytest.fail("it is built again"))
    metric = HalfPlane()
    assert is_compiled(metric)
    assert go.distance(metric, Q0, Q1) > 0.0


@pytest.mark.parametrize("damage", ["truncated", "changed", "empty"])
def test_a_damaged_library_is_removed_and_built_again(empty_cache: Path, damage: str) -> None:
    assert is_compiled(HalfPlane())
    (file,) = empty_cache.iterdir()
    content = file.read_bytes()
    changed = bytes([*content[:-1], content[-1] ^ 1])
    # A library is replaced, not overwritten: this process has loaded it.
    file.unlink()
    file.write_bytes({"truncated": content[:5000], "changed": changed, "empty": b""}[damage])
    assert cache.find(file.name.partition(".")[0]) is None
    assert names(empty_cache) == []
    assert is_compiled(HalfPlane())
    assert file.read_bytes() == content


def test_a_library_that_is_something_else_is_removed_and_built_again(empty_cache: Path) -> None:
    assert is_compiled(HalfPlane())
    (file,) = empty_cache.iterdir()
    key = file.name.partition(".")[0]
    file.unlink()
    text = b"not a library"
    (empty_cache / cache.file_name(key, text)).write_bytes(text)
    assert is_compiled(HalfPlane())
    assert names(empty_cache) == [file.name]


def test_files_that_others_could_have_written_are_not_loaded(empty_cache: Path) -> None:
    """Before the folder became private, that is: their names may have the right digest."""
    assert is_compiled(HalfPlane())
    (file,) = empty_cache.iterdir()
    key = file.name.partition(".")[0]
    file.chmod(0o722)
    assert cache.find(key) is None
    assert is_compiled(HalfPlane())
    target = empty_cache.parent / "elsewhere.so"
    file.rename(target)
    file.symlink_to(target)
    assert cache.find(key) is None


@pytest.mark.parametrize("shared", ["compiled", "cache", "."])
def test_a_folder_that_others_can_change_is_not_used(empty_cache: Path, shared: str) -> None:
    empty_cache.mkdir(parents=True)
    folder = {"compiled": empty_cache, "cache": empty_cache.parent, ".": empty_cache.parents[1]}
    folder[shared].chmod(0o777)
    try:
        assert "can be written to by other users" in cache.why_unused(empty_cache)
        assert is_compiled(HalfPlane())
        assert names(empty_cache) == []
        (used,) = cache.writable_folders()
        assert used.stat().st_mode & 0o777 == 0o700
        assert used != empty_cache
        assert len(names(used)) > 0
    finally:
        folder[shared].chmod(0o700)


def test_a_sticky_parent_is_private_enough(empty_cache: Path) -> None:
    empty_cache.parent.mkdir()
    empty_cache.parent.chmod(0o1777)
    assert cache.why_unused(empty_cache) == ""
    empty_cache.chmod(0o1777)
    assert "can be written to" in cache.why_unused(empty_cache)


def test_a_folder_that_belongs_to_another_user_is_not_used(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache.why_unused(empty_cache) == ""
    user = os.getuid() + 1
    if os.getuid() == 0:
        os.chown(empty_cache, user, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: user)
    assert cache.why_unused(empty_cache).endswith("belongs to another user")


def test_a_link_is_followed_before_the_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.mkdir(mode=0o700)
    link.symlink_to(target)
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(link))
    assert next(cache.writable_folders()) == target / "compiled"
    assert is_compiled(HalfPlane())
    assert len(names(target / "compiled")) == 1
    target.chmod(0o777)
    assert "can be written to" in cache.why_unused(cache.cache_folder())


def test_new_folders_are_private_whatever_the_umask_is(empty_cache: Path) -> None:
    before = os.umask(0)
    try:
        assert is_compiled(HalfPlane())
    finally:
        os.umask(before)
    (file,) = empty_cache.iterdir()
    for each in (file, empty_cache, empty_cache.parent):
        assert each.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("name", ["with spaces", "größer", "quote's", "a%20[b]*"])
def test_unusual_names_of_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, str(tmp_path / name))
    assert is_compiled(HalfPlane())
    assert len(names(tmp_path / name / "compiled")) == 1
    assert cache.clear() == 1


def test_relative_folders_are_those_of_the_current_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(cache.ENVIRONMENT_VARIABLE, "mine")
    assert cache.cache_folder() == tmp_path / "mine" / "compiled"
    assert is_compiled(HalfPlane())
    assert cache.clear() == 1


def test_without_a_home_folder_a_temporary_one_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """`expanduser` leaves ~ as it is where there is none."""
    monkeypatch.delenv(cache.ENVIRONMENT_VARIABLE, raising=False)
    monkeypatch.setattr("platformdirs.user_cache_path", lambda _: Path("~/.cache/geodesic_ocp"))
    assert cache.why_unused(cache.cache_folder()) == (
        "there is no home folder; set GEODESIC_OCP_CACHE"
    )
    assert is_compiled(HalfPlane())
    assert not Path("~").exists()


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES])
def test_a_full_or_read_only_cache_is_left_for_a_temporary_folder(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    write = Path.write_text

    def write_elsewhere(file: Path, *text: str, **options: str) -> int:
        if empty_cache in file.parents:
            write(file, "half of the t", **options)
            raise OSError(code, os.strerror(code))
        return write(file, *text, **options)

    monkeypatch.setattr(Path, "write_text", write_elsewhere)
    metric = HalfPlane()
    assert is_compiled(metric)
    assert names(empty_cache) == []
    assert is_compiled(HalfPlane())


def test_without_space_anywhere_nothing_is_compiled(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    metric = HalfPlane()
    with pytest.warns(RuntimeWarning, match=r"functions are not compiled.*No space left"):
        assert not is_compiled(metric)
    assert not is_compiled(metric)  # one warning is enough
    assert go.distance(metric, Q0, Q1) > 0.0
    assert names(empty_cache) == []


def test_a_library_cut_short_by_a_full_disk_is_noticed(
    empty_cache: Path,
) -> None:
    """TinyCC itself reports success."""
    assert is_compiled(HalfPlane())
    (file,) = empty_cache.iterdir()
    content = file.read_bytes()
    assert cache.is_complete(content)
    for size in (0, 3, 40, 100, 5000, len(content) - 1):
        assert not cache.is_complete(content[:size])


def test_stale_builds_are_removed(empty_cache: Path) -> None:
    fresh = cache.new_job(cache_folder := next(cache.writable_folders()), "text", "fresh")
    stale = cache.new_job(cache_folder, "text", "stale")
    os.utime(stale, (0.0, 0.0))
    cache.wait_for_job(cache_folder, "stale")  # does not wait
    with pytest.raises(FileExistsError):
        cache.new_job(cache_folder, "text", "fresh")
    assert is_compiled(HalfPlane())
    assert fresh.exists()
    assert not stale.exists()


def test_large_caches_lose_the_libraries_used_least_recently(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for metric in (HalfPlane(), Sphere()):
        assert is_compiled(metric)
    older, newer = cache.stored()
    os.utime(older, (1e9, 1e9))
    monkeypatch.setattr(cache, "_LARGEST", newer.stat().st_size)
    cache.limit_size()
    assert cache.stored() == [newer]


def test_use_is_added_up_beside_the_library_and_goes_with_it(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = []
    for metric in (HalfPlane(), Sphere()):
        assert is_compiled(metric)
        (file,) = set(cache.stored()) - set(files)
        files.append(file)
        assert cache.use(file) == 0.0
        for _ in range(3):
            cache.add_use(file, 0.0104)
        assert cache.use(file) == pytest.approx(0.03)
    older, newer = files
    os.utime(older, (1e9, 1e9))
    monkeypatch.setattr(cache, "_LARGEST", newer.stat().st_size)
    cache.limit_size()
    assert cache.use(older) == 0.0
    assert len(names(empty_cache)) == 2
    assert cache.clear() == 1
    assert names(empty_cache) == []


def test_use_is_forgotten_where_it_cannot_be_written(tmp_path: Path) -> None:
    file = tmp_path / "missing" / "key.digest.so"
    cache.add_use(file, 1.0)
    assert cache.use(file) == 0.0


def test_the_job_of_a_process_that_was_killed_is_removed_soon(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = next(cache.writable_folders())
    job = cache.new_job(folder, "text", "name")
    monkeypatch.setattr(cache, "_GRACE", 0.0)
    command = [sys.executable, cache.__file__, str(job), "name", "sh", "-c", "sleep 60"]
    with subprocess.Popen(command, start_new_session=True) as process:
        with cache.lock(job):
            assert not cache.is_stale(job)
        try:
            while cache.is_stale(job):
                assert process.poll() is None
        finally:
            os.killpg(process.pid, 9)
    cache.wait_for_job(folder, "name")
    assert cache.new_job(folder, "other text", "name") == job


def test_clearing_removes_libraries_and_leaves_other_files(empty_cache: Path) -> None:
    assert cache.clear() == 0
    assert is_compiled(HalfPlane())
    cache.new_job(empty_cache, "text", "name")
    note = empty_cache / "note.txt"
    note.write_text("mine")
    assert cache.clear() == 1
    assert names(empty_cache) == ["note.txt"]
    assert is_compiled(HalfPlane())


def test_the_key_changes_with_all_that_makes_a_library(monkeypatch: pytest.MonkeyPatch) -> None:
    tiny = tiny_compiler()
    assert tiny is not None

    def key(fingerprint: str = "f", compiler: Compiler = tiny) -> str:
        return library.Library(dict, fingerprint, 2)._key(compiler)

    keys = [key(), key("g"), key(compiler=Compiler("tcc", tiny.command, "another processor"))]
    with monkeypatch.context() as change:
        change.setattr(library, "_versions", lambda: "another version")
        keys.append(key())
    with monkeypatch.context() as change:
        change.setattr(library, "core_text", lambda *given: source.core_text(*given) + " ")
        keys.append(key())
    assert len(set(keys)) == 5
    assert key() == keys[0]


def test_metrics_with_other_expressions_have_other_libraries(empty_cache: Path) -> None:
    class Scaled(HalfPlane):
        factor = 1.0

        def matrix(self, q: object) -> object:
            return self.factor * super().matrix(q)

    class Doubled(Scaled):
        factor = 2.0

    for metric in (Scaled(), Doubled()):
        assert is_compiled(metric)
    assert len(names(empty_cache)) == 2
    assert go.distance(Doubled(), Q0, Q1) == pytest.approx(
        np.sqrt(2.0) * go.distance(Scaled(), Q0, Q1), abs=1e-9
    )
