"""Environment variables of the programs of the build."""

from __future__ import annotations

import os

# Settings of other installations, of ROS and conda for instance, must not get into this build;
# nor must compiler flags: -march would change how Eigen lays out its matrices.
LEFT_OUT = (
    *("PYTHONPATH", "PYTHONHOME", "PYTHONOPTIMIZE", "CONDA_PREFIX", "PKG_CONFIG_PATH"),
    *("CPATH", "C_INCLUDE_PATH", "CPLUS_INCLUDE_PATH", "LIBRARY_PATH", "LD_RUN_PATH"),
    *("CPPFLAGS", "CFLAGS", "CXXFLAGS", "LDFLAGS"),
    *("PIP_CONSTRAINT", "PIP_PREFIX", "PIP_TARGET", "PIP_USER"),
)


def clean_environment() -> dict[str, str]:
    """Environment variables of the process, without those that would change the result."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in LEFT_OUT and not name.startswith("CMAKE_")
    }
    return kept | {"PYTHONNOUSERSITE": "1", "LC_ALL": "C", "NINJA_STATUS": "[%f/%t] "}
