"""Runs that are killed, and clusters that lose workers: nothing is lost or done twice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from here import Here
from minimum_jerk_files import write_stroke

from geodesic_ocp.cli import main as cli
from geodesic_ocp.studies.analyse_recordings import analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings

METRIC = AnalysisSettings(metric="euclidean")
SCRIPT = """
import sys
from geodesic_ocp.studies.analyse_recordings import analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings

if __name__ == "__main__":
    settings = AnalysisSettings(metric="euclidean")
    analyse_recordings(sys.argv[1], sys.argv[2], settings=settings, jobs=2)
"""


def results(out: Path) -> dict[str, int]:
    """Times of the finished results."""
    folder = out / "results"
    found = folder.iterdir() if folder.is_dir() else ()
    return {
        file.name: file.stat().st_mtime_ns
        for file in found
        if file.name[0] != "." and "synergies" not in file.name
    }


def descendants(process: int) -> set[int]:
    found: set[int] = set()
    for file in Path(f"/proc/{process}/task").glob("*/children"):
        for child in map(int, file.read_text().split()):
            found |= {child} | descendants(child)
    return found


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc")
def test_a_killed_run_goes_on_where_it_was(tmp_path: Path) -> None:
    for seed in range(8):
        write_stroke(tmp_path / "data" / f"{seed:02d}.csv", seed)
    out, script = tmp_path / "out", tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(tmp_path / "data"), str(out)]
    with subprocess.Popen(command) as process:
        deadline = time.monotonic() + 60.0
        while len(results(out)) < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        children = descendants(process.pid)
        process.kill()
    assert children
    deadline = time.monotonic() + 20.0
    while (alive := [each for each in children if _is_running(each)]) and (
        time.monotonic() < deadline
    ):
        time.sleep(0.05)
    assert not alive, "processes outlive their parent"
    finished = results(out)
    assert 2 <= len(finished) < 8
    result = analyse_recordings(tmp_path / "data", out, settings=METRIC, executor=Here())
    assert (result.analysed, result.found) == (8 - len(finished), len(finished))
    assert result.recordings()["recording"].nunique() == 8
    after = results(out)
    assert len(after) == 8
    assert {name: after[name] for name in finished} == finished
    assert not list((out / "results").glob(".*"))


def _is_running(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.slow
def test_processes_that_cannot_start_are_told(tmp_path: Path) -> None:
    """Such as in a script that calls at its top level."""
    write_stroke(tmp_path / "a.csv", 1)
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace('if __name__ == "__main__":', "if True:"))
    command = [sys.executable, str(script), str(tmp_path / "a.csv"), str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 1
    assert 'must stand under if __name__ == "__main__":' in done.stderr


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # those of the cluster when a worker is lost
def test_a_cluster_that_loses_a_worker(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    for seed in range(6):
        write_stroke(tmp_path / "data" / f"{seed:02d}.csv", seed)
    killed: list[int] = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        first = client.submit(os.getpid, pure=False).result()

        def kill(outcome: object) -> None:
            if not killed:
                killed.append(first)
                os.kill(first, signal.SIGKILL)

        result = analyse_recordings(
            tmp_path / "data",
            tmp_path / "out",
            settings=METRIC,
            executor=client.get_executor(pure=False),
            jobs=4,
            finished=kill,
        )
        arguments = ["--out", str(tmp_path / "again"), "--scheduler", cluster.scheduler_address]
        files = [str(tmp_path / "data" / f"{seed:02d}.csv") for seed in (0, 1)]
        assert cli.main(["analyse", *files, "--metric", "euclidean", *arguments]) == 0
        assert len(results(tmp_path / "again")) == 2
    assert killed
    assert not result.failures
    assert len(results(tmp_path / "out")) == 6
    assert result.recordings()["recording"].nunique() == 6
