"""What a new process takes: import, first logarithmic map, analysis, memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from comparison.measurement import Measurement
from comparison.recordings import FILE

# Its own peak of memory [kB] comes last on stderr: the one that wait4 reports includes that of the
# parent before the new program is loaded.
_COMMAND = """
import sys
from geodesic_ocp.cli.main import main
status = main()
with open("/proc/self/status") as file:
    print(*(line.split()[1] for line in file if line.startswith("VmHWM")), file=sys.stderr)
sys.exit(status)
"""
_IMPORT = """
import time; start = time.perf_counter()
import geodesic_ocp
print(time.perf_counter() - start)
"""
_MODEL = """
import time; start = time.perf_counter()
import geodesic_ocp as go
go.KineticEnergy(go.human_arm()).matrix([0.0] * 7), go.log
print(time.perf_counter() - start)
"""
# A map under another metric imports everything; the library of this one is another.
_FIRST_LOG = """
import time, geodesic_ocp as go
pair = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.2, 0.1]
go.log(go.KineticEnergy(go.human_arm(height=1.6)), *pair)
start = time.perf_counter()
go.log(go.KineticEnergy(go.human_arm()), *pair)
print(time.perf_counter() - start)
"""


def start_up(repetitions: int) -> list[Measurement]:
    """Times of new processes; the cache of compiled code is empty only where that is said."""
    imports = [_printed(_IMPORT, None) for _ in range(repetitions + 1)][1:]
    models = [_printed(_MODEL, None) for _ in range(repetitions)]
    with tempfile.TemporaryDirectory() as cache:
        firsts = []
        for index in range(repetitions):
            firsts.append(_printed(_FIRST_LOG, Path(cache) / str(index)))
        again = [_printed(_FIRST_LOG, Path(cache) / "0") for _ in range(repetitions)]
        runs = [_analysis(Path(cache) / "0") for _ in range(repetitions + 1)][1:]
    seconds, megabytes = np.array(runs).T
    return [
        Measurement("import geodesic_ocp", np.array(imports)),
        Measurement("import, a first model and metric, and go.log imported", np.array(models)),
        Measurement("first go.log of a model, empty cache", np.array(firsts)),
        Measurement("first go.log of a model, filled cache", np.array(again)),
        Measurement("geodesic-ocp analyse, later runs", seconds),
        Measurement("geodesic-ocp analyse, memory", megabytes, unit="MB"),
    ]


def _environment(cache: Path | None) -> dict[str, str]:
    return os.environ | ({"GEODESIC_OCP_CACHE": str(cache)} if cache is not None else {})


def _printed(program: str, cache: Path | None) -> float:
    """The number that a program prints."""
    command = [sys.executable, "-c", program]
    printed = subprocess.run(
        command, check=True, text=True, stdout=subprocess.PIPE, env=_environment(cache)
    )
    return float(printed.stdout)


def _analysis(cache: Path) -> tuple[float, float]:
    """Time [s] and peak memory [MB] of the command on the bundled recording."""
    command = [sys.executable, "-c", _COMMAND, "analyse", str(FILE), "--side=left"]
    start = time.perf_counter()
    process = subprocess.run(
        command,
        check=True,
        text=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=_environment(cache),
    )
    return time.perf_counter() - start, float(process.stderr.split()[-1]) / 1024.0
