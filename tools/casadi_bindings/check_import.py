"""Exit code 0 if pinocchio.casadi can be imported and agrees with numeric Pinocchio."""

from __future__ import annotations

import warnings

import casadi as ca
import numpy as np
import pinocchio as pin

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", "to-Python converter", RuntimeWarning)  # once per process
    import pinocchio.casadi as cpin

model = pin.buildSampleModelManipulator()
symbolic, data = cpin.Model(model), model.createData()
q = ca.SX.sym("q", model.nq)
found = ca.Function("G", [q], [cpin.crba(symbolic, symbolic.createData(), q)])
at = np.linspace(-1.0, 1.0, model.nq)
difference = np.abs(np.triu(np.array(found(at)) - pin.crba(model, data, at))).max()
if not difference < 1e-12:
    raise SystemExit(f"the mass matrices of pinocchio.casadi and pinocchio differ by {difference}")
