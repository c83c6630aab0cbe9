"""Ipopt through CasADi: the only module that calls nlpsol and reads its success."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from difflib import get_close_matches
from io import StringIO
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, by_buffers

# The objective is scaled to the order of one, so tolerances are relative to the path's energy.
# Ipopt relaxes bounds by 1e-8 internally; the solution satisfies the original ones.
_IPOPT = {
    "tol": 1e-10,
    "max_iter": 300,
    "print_level": 0,
    "sb": "yes",
    "honor_original_bounds": "yes",
    # Multipliers of fixed variables would take another gradient in each iteration: they are zero.
    "fixed_variable_treatment": "make_parameter_nodual",
}
# Ends of a solve that the user's own options set.
LIMITS = {
    "max_iter": "Ipopt reached its iteration limit (ipopt={'max_iter': ...})",
    "max_cpu_time": "Ipopt reached its limit of processor time",
    "max_wall_time": "Ipopt reached its limit of wall time",
}
NO_VALUE = "not finite, or not differentiable"
STOPPED = "the callback stopped Ipopt"
NOT_FINITE = "the metric or a condition is not finite along the path"
_SENTENCES = {
    "Solve_Succeeded": "Ipopt found a local solution",
    "Solved_To_Acceptable_Level": "Ipopt could not reach its tolerance, only its acceptable level",
    "Infeasible_Problem_Detected": "the conditions cannot be met near the initial guess",
    "Maximum_Iterations_Exceeded": LIMITS["max_iter"],
    "Maximum_CpuTime_Exceeded": LIMITS["max_cpu_time"],
    "Maximum_WallTime_Exceeded": LIMITS["max_wall_time"],
    "Restoration_Failed": "Ipopt's restoration phase failed to meet the conditions",
    "Invalid_Number_Detected": NOT_FINITE,
    "Search_Direction_Becomes_Too_Small": "Ipopt's steps became too small",
    "Diverging_Iterates": "the iterates diverge",
    "Error_In_Step_Computation": "the linear system of a step could not be solved",
    "User_Requested_Stop": STOPPED,
    "Not_Enough_Degrees_Of_Freedom": "there are more equalities than variables",
}

# CasADi turns Ctrl-C during a solve into one of these.
_INTERRUPTED = ("NonIpopt_Exception_Thrown", "User_Requested_Stop")


@dataclass(frozen=True, repr=False)
class Outcome(ShortRepr):
    """Result of Ipopt: success, status in words, iterations, time, objective, last iterate.

    `may_be_saddle`: Ipopt has not seen there that the objective is convex where it may move, as
    it made no step, or added to the Hessian for the last one.
    """

    success: bool
    status: str
    iterations: int
    seconds: float
    objective: float
    x: Array
    g: Array
    lam_x: Array
    lam_g: Array
    may_be_saddle: bool = False
    _shown = ("status", "iterations", "objective")


class Relay(ca.Callback):
    """Passes the number and the values of every iterate to a function, whose True stops Ipopt.

    Args:
        size_x, size_g, size_p: numbers of variables, constraint functions and parameters.
        receive: the function; the values are those of nlpsol's outputs.

    Attributes:
        failure: exception that the function raised, which CasADi would turn into a warning.
        stopped: whether it stopped Ipopt.
    """

    def __init__(
        self,
        size_x: int,
        size_g: int,
        size_p: int,
        receive: Callable[[int, dict[str, ca.DM]], object],
    ) -> None:
        super().__init__()
        self._receive = receive
        self._number = 0
        self.failure: BaseException | None = None
        self.stopped = False
        sizes = (size_x, 1, size_g, size_x, size_g, size_p)
        self._sizes = dict(zip(ca.nlpsol_out(), sizes, strict=True))
        self.construct("iteration_callback", {})

    def get_n_in(self) -> int:
        """Return number of inputs: as many as a solver has outputs."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Return number of outputs: whether to stop."""
        return 1

    def get_name_in(self, index: int) -> str:
        """Return name of the solver's output of that index."""
        return str(ca.nlpsol_out(index))

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """Return dense columns of the program's sizes."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(index)])

    def eval(self, arguments: Sequence[ca.DM]) -> list[int]:
        """Return [1] to stop Ipopt, else [0]."""
        try:
            answer = self._receive(self._number, dict(zip(self._sizes, arguments, strict=True)))
            self.stopped = isinstance(answer, (bool, np.bool_)) and bool(answer)
        except BaseException as error:
            self.failure = error
            self.stopped = True
        self._number += 1
        return [int(self.stopped)]


def _wrong_option(options: Mapping[str, Any]) -> str | None:
    """Return which option Ipopt does not take, and what it would take; None if it takes all."""
    for name, value in options.items():
        try:
            _printed({name: value})
        except RuntimeError:
            known = _known_options()
            if name in known:
                return f"{name} must be {known[name]}, got {value!r}"
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            return f"Ipopt has no option {name!r}{hint}"
    return None


def _known_options() -> dict[str, str]:
    """Return the options of this Ipopt with what they take, from its own documentation."""
    text = _printed({"print_options_documentation": "yes", "print_advanced_options": "yes"})
    found = {}
    for entry in re.split(r"\n(?=\w)", text):
        if heading := re.match(r"(\w+) +(.*\(.*\).*)", entry):
            words = re.findall(r"^ {4}- ([\w-]+)", entry, re.MULTILINE)
            numbers = re.sub(r"\( *(.*?) *\)", r"(default \1)", " ".join(heading[2].split()))
            found[heading[1]] = f"one of {', '.join(words)}" if words else numbers
    return found


def _printed(options: Mapping[str, Any]) -> str:
    """Return what Ipopt prints for the program min x^2; RuntimeError if it refuses an option."""
    x = ca.SX.sym("x")
    settings: dict[str, Any] = {
        "print_time": False,
        "ipopt": {"sb": "yes", "max_iter": 0, **options},
    }
    with redirect_stdout(StringIO()) as output:
        ca.nlpsol("options", "ipopt", {"x": x, "f": x**2}, settings)(x0=1.0)
    return output.getvalue()


@dataclass(eq=False)
class Ipopt:
    """A nonlinear program with Ipopt, to be called with numerical arguments.

    Args:
        nlp: dictionary of CasADi expressions or a function; x, p -> f, g.
        derivatives: functions for nlpsol's options grad_f and hess_lag, if not CasADi's own.
        options: options of Ipopt by name, which override the package's.
        relay: callback for every iteration.
        solved: called after every solve with the processor time of its evaluations [s].

    Raises:
        ValueError: there is no such option, or its value is of another type.
    """

    nlp: Any
    derivatives: Mapping[str, ca.Function] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    relay: Relay | None = None
    solved: Callable[[float], object] | None = None
    _solver: ca.Function = field(init=False, repr=False)
    _usual: dict[str, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        options: dict[str, Any] = {
            "print_time": False,
            "calc_lam_p": False,  # unused, and CasADi would print a warning after a failed solve
            "no_nlp_grad": True,  # which would serve for that alone
            "error_on_fail": False,
            "show_eval_warnings": False,
            "ipopt": {**_IPOPT, **self.options},
            **self.derivatives,
        }
        if self.relay is not None:
            options["iteration_callback"] = self.relay
        try:
            solver = ca.nlpsol("nlp", "ipopt", self.nlp, options)
        except RuntimeError as error:
            wrong = _wrong_option(self.options)
            if wrong is None:
                raise
            raise ValueError(f"ipopt: {wrong}") from error
        usual = {
            name: np.full(solver.numel_in(k), solver.default_in(k))
            for k, name in enumerate(solver.name_in())
        }
        self._solver = solver
        self._usual = usual

    @property
    def size_g(self) -> int:
        """Number of constraint functions."""
        return int(self._solver.size1_in("lbg"))

    def __call__(self, **values: Any) -> Outcome:
        """Solve with nlpsol's x0, p, lbx, ubx, lbg, ubg."""
        start = time.perf_counter()
        given = {**self._usual, **values}
        numbers = [
            np.broadcast_to(np.asarray(given[name], dtype=float), each.shape)
            for name, each in self._usual.items()
        ]
        try:
            found = by_buffers(self._solver, numbers)
        except SystemError as error:  # a Ctrl-C that CasADi noticed, as of Python 3.13
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise KeyboardInterrupt from error
            raise
        if self.relay is not None and self.relay.failure is not None:
            raise self.relay.failure
        seconds = time.perf_counter() - start
        assert found is not None  # all inputs are dense
        outputs, record = found
        stats = record.stats()
        if self.solved is not None:
            self.solved(sum(each for key, each in stats.items() if key.startswith("t_proc_nlp")))
        word = stats["return_status"]
        if word in _INTERRUPTED and (self.relay is None or not self.relay.stopped):
            raise KeyboardInterrupt
        status = _SENTENCES.get(word, f"Ipopt stopped: {word.replace('_', ' ').lower()}")
        x, f, g, lam_x, lam_g = (each[:, 0] for each in outputs[:5])
        added = stats["iterations"]["regularization_size"] if stats["iter_count"] else [1.0]
        success = bool(stats["success"]) and word == "Solve_Succeeded"
        success = success and bool(np.isfinite(np.concatenate([x, g, lam_x, lam_g])).all())
        iterations = int(stats["iter_count"])
        objective = f.item()
        return Outcome(
            success, status, iterations, seconds, objective, x, g, lam_x, lam_g, added[-1] > 0.0
        )
