"""Paths of a Panda by pygeodex; runs where pygeodex is installed.

    python pygeodex_worker.py < pairs.json > results.json

Pairs (k, 2, 7) of configurations; the results are times [s] and paths (m, 7) of `discrete_geodesic`
and of `plan`, both with their default settings and without obstacles.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version

import geodex
import numpy as np


def main() -> None:
    robot, results = geodex.robots.Panda(), {"discrete_geodesic": [], "plan": []}
    for q0, q1 in np.array(json.load(sys.stdin)):
        for name, records in results.items():
            start = time.perf_counter()
            result = getattr(geodex, name)(robot, q0, q1)
            seconds = time.perf_counter() - start
            path = np.array(result.path)
            solved = result.solved if name == "plan" else result.status.name == "Converged"
            records.append({"seconds": seconds, "path": path.tolist(), "solved": bool(solved)})
    json.dump({"version": f"pygeodex {version('pygeodex')}", "results": results}, sys.stdout)


if __name__ == "__main__":
    main()
