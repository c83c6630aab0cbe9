"""Parts of the benchmark `run.py`: our routes and other solvers on the same problems."""

import os

# Small matrices: threads of the linear algebra would only compete with each other. This must be
# set before NumPy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
