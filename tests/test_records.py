"""Files are written whole or not at all, with the permissions of any new file; errors name them."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

import pytest

from geodesic_ocp.records import TEMPORARY, naming, write_file
from geodesic_ocp.studies.study_tables import write_table
from geodesic_ocp.trajectory.files.series import Gaps


@pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")
@pytest.mark.parametrize("mask", [0o077, 0o022, 0o002])
def test_files_have_the_permissions_that_the_user_asks_for(mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        files = [
            write_file(tmp_path / "a.json", "{}"),
            write_file(tmp_path / "b.json", "{}", lasting=True),
            *write_table(tmp_path, "recordings", [{"samples": 3}]),
        ]
    finally:
        os.umask(before)
    assert {stat.S_IMODE(file.stat().st_mode) for file in files} == {0o666 & ~mask}


def test_a_failure_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    file = write_file(tmp_path / "a.txt", "before")
    with pytest.raises(UnicodeEncodeError):
        write_file(file, "half of it and \ud800")
    assert file.read_text() == "before"
    assert list(tmp_path.iterdir()) == [file]


def test_failures_name_the_file_that_was_to_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = tmp_path / "absent" / "a.txt"
    with pytest.raises(FileNotFoundError) as missing:
        write_file(absent, "text")
    assert str(missing.value) == f"{absent}: there is no folder {absent.parent}"
    file = tmp_path / "a.txt"
    file.mkdir()
    with pytest.raises(OSError, match=r"a\.txt'$") as folder:
        write_file(file, "text")
    assert TEMPORARY not in str(folder.value)

    def refuse(self: Path, *_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "write_text", refuse)  # as in a folder that is read only
    with pytest.raises(PermissionError) as denied:
        write_file(tmp_path / "b.txt", "text")
    assert denied.value.filename == str(tmp_path / "b.txt")
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_errors_name_the_files_that_were_used(tmp_path: Path) -> None:
    used, named = tmp_path / "used.csv", tmp_path / "named.csv"
    for file in (used, named):
        file.write_text("")
    failure = Gaps(f"{named}: is wrong", [(0.0, 1.0)])
    with (
        pytest.raises(
            Gaps, match=r"named\.csv: is wrong \(with marker set .*used\.csv\)$"
        ) as found,
        naming(marker_set=used, columns=str(named), convention="isb", skeleton=None),
    ):
        raise failure
    assert found.value is failure
    assert found.value.parts == ((0.0, 1.0),)
