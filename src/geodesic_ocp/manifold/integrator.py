"""Adaptive integration of ordinary differential equations given as CasADi functions.

The method of order 8 of Dormand and Prince with error estimates of orders 5 and 3 (DOP853: Hairer,
Norsett, Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., section II.5), with the
coefficients from SciPy. One step is one CasADi call, an order of magnitude faster than one call per
stage.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled import dop853
from geodesic_ocp.errors import IntegrationFailed

_STAGES = dop853.STAGES
_ORDER = 8
_SAFETY = 0.9
_SHRINK, _GROW = 0.2, 8.0
_SMALLEST_STEP = 1e-13  # relative to the interval

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
        self._parameters = rate.size1_in(1) if rate.n_in() == 2 else 0
        self._rate = rate
        self._step = self._step_function(rate)

    def _step_function(self, rate: ca.Function) -> ca.Function:
        y = ca.MX.sym("y", rate.size1_in(0))
        first = ca.MX.sym("f", rate.size1_in(0))
        step = ca.MX.sym("step", 2)  # its size, and the tolerance
        size = step[0]
        p = ca.MX.sym("p", self._parameters, _STAGES + 1)

        def slope(state: ca.MX, stage: int) -> ca.MX:
            return rate(state, p[:, stage]) if self._parameters else rate(state)

        slopes = [first]
        for stage in range(1, _STAGES):
            weights = ca.DM(dop853.A[stage, :stage])
            slopes.append(slope(y + size * (ca.horzcat(*slopes) @ weights), stage))
        end = y + size * (ca.horzcat(*slopes) @ ca.DM(dop853.B))
        slopes.append(slope(end, _STAGES))
        stages = ca.horzcat(*slopes)
        scale = step[1] * ca.fmax(ca.fmax(ca.fabs(y), ca.fabs(end)), 1.0)
        errors = [ca.sumsqr(size * (stages @ ca.DM(w)) / scale) for w in (dop853.E5, dop853.E3)]
        inputs = [y, first, step, p] if self._parameters else [y, first, step]
        return ca.Function("step", inputs, [end, slopes[-1], ca.vertcat(*errors)])

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
        state = np.array(start, dtype=float)
        states, now = [state.copy()], float(times[0])
        p = [] if parameters is None else [parameters(now * np.ones(1))]
        slope = self._rate(state, *p).full()[:, 0]
        # Inputs and outputs at fixed addresses: CasADi's conversions would cost more than the step.
        controls, squares = np.array([0.0, tolerance]), np.empty(2)
        end, end_slope = np.empty(state.size), np.empty(state.size)
        stages = np.empty((_STAGES + 1, self._parameters))
        arguments: list[Any] = [state, slope, controls, *([] if parameters is None else [stages])]
        buffer: Any
        buffer, take_step = self._step.buffer()
        for index, array in enumerate(arguments):
            buffer.set_arg(index, memoryview(array))
        results: list[Any] = [end, end_slope, squares]
        for index, array in enumerate(results):
            buffer.set_res(index, memoryview(array))
        interval = float(times[-1]) - now
        # Initial step: a known curve is smooth between its stops, otherwise it is a guess.
        size = interval / 8.0 if parameters is None else float(times[1]) - now
        taken = 0
        for stop in times[1:]:
            while now < stop:
                controls[0] = step = min(size, stop - now)
                if parameters is not None:
                    stages[:] = parameters(now + step * STAGE_TIMES).T
                take_step()
                error = _error(float(squares[0]), float(squares[1]), state.size)
                if error <= 1.0:
                    now = stop if step == stop - now else now + step
                    state[:], slope[:] = end, end_slope
                factor = _SHRINK if error == np.inf else _SAFETY * error ** (-1 / _ORDER)
                suggested = step * min(max(factor, _SHRINK), _GROW)
                # A step that was shortened to end at a stop does not limit the next one.
                size = suggested if error > 1.0 or step == size else max(size, suggested)
                taken += 1
                if taken >= max_steps or size < _SMALLEST_STEP * interval:
                    end_of = IntegrationEnd(taken >= max_steps, now, size, taken)
                    raise integration_failure(end_of, times, tolerance, state)
            states.append(state.copy())
        return np.array(states)


def _error(squared_5: float, squared_3: float, size: int) -> float:
    """Hairer's combined estimate of the error of a step, relative to the tolerance."""
    if not math.isfinite(squared_5 + squared_3):
        return math.inf
    if squared_5 + squared_3 == 0.0:
        return 1e-16
    return max(squared_5 / math.sqrt((squared_5 + 0.01 * squared_3) * size), 1e-16)
