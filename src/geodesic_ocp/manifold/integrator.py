"""Integration of ordinary differential equations by SciPy, where functions are not compiled.

The method is that of the compiled core, of order 8 by Dormand and Prince with error estimates of
orders 5 and 3 (DOP853: Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
2nd ed., section II.5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
from scipy.integrate import DOP853

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled import dop853
from geodesic_ocp.errors import IntegrationFailed

_SMALLEST_STEP = 1e-13  # relative to the interval
_FINEST = 2.3e-14  # the smallest tolerance that SciPy takes

# Times of the stages within a step; the last is the end of the step.
STAGE_TIMES: Array = np.append(dop853.C, 1.0)


@dataclass(frozen=True)
class IntegrationEnd:
    """Where an integration stopped early.

    Attributes:
        too_many_steps: whether it stopped at the largest number of steps, or the step at the
            smallest size.
        time: reached.
        step: size of the last step.
        steps: number of steps.
    """

    too_many_steps: bool
    time: float
    step: float
    steps: int


def integration_failure(
    end: IntegrationEnd, times: Array, tolerance: float, state: Array
) -> IntegrationFailed:
    """The exception for an integration over these times that stopped at this state."""
    why = (
        f"{end.steps} steps were not enough, the last of {end.step:.1e}; the motion is too fast or "
        "the tolerance too small"
        if end.too_many_steps
        else f"the step fell to {end.step:.1e}; the metric is singular there, or the tolerance "
        "cannot be reached"
    )
    return IntegrationFailed(
        f"the integration stopped at t = {end.time:.6g} in [{times[0]:.6g}, {times[-1]:.6g}], with "
        f"a tolerance of {tolerance:.1e} per step: {why}",
        end.time,
        state,
    )


class Integrator:
    """Integrates y' = f(y) or y' = f(y, p(t)).

    Args:
        rate: CasADi function y -> y' or (y, p) -> y', where p is a known function of time, such as
            the position and velocity of the curve in parallel transport.
    """

    def __init__(self, rate: ca.Function) -> None:
        self._rate = rate

    def __call__(
        self,
        start: Array,
        times: Array,
        tolerance: float,
        parameters: Callable[[Array], Array] | None = None,
        max_steps: int = 20_000,
    ) -> Array:
        """The solution at the given times, (len(times), len(start)), from y(times[0]) = start.

        The estimated error of every step is at most `tolerance`, absolute for components below one
        and relative above. `parameters` returns p, (size, len(t)), at an array of times t.

        Raises:
            IntegrationFailed: the step became too small, or more than `max_steps` were needed.
        """

        def slope(t: float, y: Array) -> Array:
            p = [] if parameters is None else [parameters(np.array([t]))]
            return np.asarray(self._rate(y, *p).full()[:, 0])

        interval = float(times[-1] - times[0])
        states, taken, size = [np.array(start, dtype=float)], 0, interval / 8.0
        tolerance = max(tolerance, _FINEST)
        for begin, stop in pairwise(times.tolist()):
            first = min(size, stop - begin)
            solver = DOP853(
                slope, begin, states[-1], stop, rtol=tolerance, atol=tolerance, first_step=first
            )
            while solver.status == "running":
                solver.step()
                taken, size = taken + 1, solver.h_abs
                is_short = solver.status == "failed" or size < _SMALLEST_STEP * interval
                if solver.status != "finished" and (is_short or taken >= max_steps):
                    end = IntegrationEnd(not is_short, solver.t, size, taken)
                    raise integration_failure(end, times, tolerance, solver.y)
            states.append(solver.y)
        return np.array(states)
