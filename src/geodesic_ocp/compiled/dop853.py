"""Coefficients of the method of order 8 of Dormand and Prince, as SciPy has them.

Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., section II.5. SciPy
keeps them in a file of their own, which is read without the rest of scipy.integrate: its import
takes longer than all integrations of an analysis.

Attributes:
    STAGES: number of stages.
    A, B, C: of the method, (STAGES, STAGES), (STAGES,) and (STAGES,).
    E3, E5: weights of all slopes, that at the end included, in the estimates of orders 3 and 5.
"""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import scipy


def _coefficients() -> Any:
    file = Path(scipy.__file__).parent / "integrate" / "_ivp" / "dop853_coefficients.py"
    spec = spec_from_file_location("dop853_coefficients", file) if file.is_file() else None
    if spec is None or spec.loader is None:
        from scipy.integrate._ivp import dop853_coefficients

        return dop853_coefficients
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_SCIPY = _coefficients()
STAGES: int = _SCIPY.N_STAGES
A = np.array(_SCIPY.A[:STAGES, :STAGES], dtype=float)
B = np.array(_SCIPY.B, dtype=float)
C = np.array(_SCIPY.C[:STAGES], dtype=float)
E3, E5 = np.array(_SCIPY.E3, dtype=float), np.array(_SCIPY.E5, dtype=float)
