"""Recordings an hour of `analyse_recordings`, and whether its memory stays flat.

    python benchmarks/many_recordings.py --count 100 --jobs 1 2

writes synthetic recordings of about 2 s to a temporary folder, analyses them with each number of
processes, and prints recordings an hour, the ratio to the first, the time on cores, and the memory
of the parent and of its processes over time. Times include the start of the processes and the
tables. On a computer that does other work, the time on cores tells more than the ratio.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import geodesic_ocp as go

_RATE, _NOISE = 100.0, 1e-3  # [Hz], [rad]
_TRIALS = 20  # of each subject


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100, help="number of recordings")
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        write_recordings(folder / "data", options.count)
        first = 0.0
        for number, jobs in enumerate(options.jobs):
            rate = measure(folder / "data", folder / f"run_{number}", options.count, jobs)
            first = first or rate
            print(f"  {rate / first:.2f} times the first", flush=True)


def write_recordings(folder: Path, count: int) -> None:
    """Reaches of several people: three strokes of minimum jerk, at other paces, with noise."""
    random = np.random.default_rng(0)
    for number in range(count):
        subject, trial = divmod(number, _TRIALS)
        arm = go.human_arm("right", height=1.5 + 0.02 * (subject % 25))
        folder_of = folder / f"subject_{subject:02d}"
        folder_of.mkdir(parents=True, exist_ok=True)
        time_, q = reach(arm, random)
        header = ["# unit: rad", f"# height: {1.5 + 0.02 * (subject % 25):.2f}", "# mass: 70"]
        rows = [",".join(["time", *arm.joint_names])]
        rows += [",".join(f"{value:.8f}" for value in row) for row in np.column_stack([time_, q])]
        (folder_of / f"reach_{trial:02d}.csv").write_text("\n".join([*header, *rows]) + "\n")


def reach(arm: go.Model, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Times and noisy joint angles of strokes between random postures within the limits."""
    middle, half = (arm.upper + arm.lower) / 2.0, (arm.upper - arm.lower) / 2.0
    postures = middle + 0.5 * half * random.uniform(-1.0, 1.0, (4, arm.dof))
    durations = random.uniform(0.5, 0.8, 3)
    pieces = []
    for start, stop, duration in zip(postures[:-1], postures[1:], durations, strict=True):
        s = np.linspace(0.0, 1.0, int(duration * _RATE), endpoint=False)
        pieces.append(start + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, stop - start))
    q = np.concatenate([*pieces, postures[-1:]])
    return np.arange(len(q)) / _RATE, q + _NOISE * random.normal(size=q.shape)


def measure(data: Path, out: Path, count: int, jobs: int) -> float:
    """Analyse and print; returns recordings an hour."""
    memory: list[tuple[float, float, list[float]]] = []
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(memory, done))
    watcher.start()
    start, used = time.perf_counter(), _processor_time()
    try:
        result = go.studies.analyse_recordings(data, out, jobs=jobs, recursive=True)
    finally:
        done.set()
        watcher.join()
    seconds, used = time.perf_counter() - start, _processor_time() - used
    rows = set(result.recordings()["recording"])
    assert len(rows) + len(result.failures) == count, "a recording is lost"
    rate = 3600.0 * len(rows) / seconds
    print(f"{jobs} processes: {result.counts} in {seconds:.1f} s, {rate:.0f} an hour")
    print(f"  {used / count:.2f} s of a core for each recording, start of the processes included")
    for failure in result.failures[:5]:
        print(f"  {failure}")
    for share in (0.1, 0.25, 0.5, 0.75, 1.0):
        after, parent, children = memory[int(share * (len(memory) - 1))]
        print(
            f"  after {after:6.1f} s: parent {parent:4.0f} MB, processes "
            + ", ".join(f"{each:.0f} MB" for each in sorted(children))
        )
    largest = max(max(children, default=0.0) for _, _, children in memory)
    print(f"  largest: parent {max(each[1] for each in memory):.0f} MB, process {largest:.0f} MB")
    return rate


def _processor_time() -> float:
    """Of this process and those that it has waited for [s]."""
    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in each)


def _watch(memory: list[tuple[float, float, list[float]]], done: threading.Event) -> None:
    """Resident memory [MB] of this process and its children over time (Linux)."""
    start = time.perf_counter()
    while not done.wait(0.5):
        children = Path("/proc/self/task").glob("*/children")
        numbers = {number for file in children for number in file.read_text().split()}
        found = [_resident(number) for number in numbers]
        memory.append((time.perf_counter() - start, _resident("self"), [x for x in found if x]))


def _resident(process: str) -> float:
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * 4096 / 1e6


if __name__ == "__main__":
    main()
