"""The package against known geodesics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import exp, sample_geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.dynamics import BACKENDS, choose_backend, why_unavailable
from geodesic_ocp.table import Table
from geodesic_ocp.validation.known_geodesics import KnownGeodesic, read_known_geodesics
from geodesic_ocp.validation.metrics import has_model, metric_of

# A failure of any of these is the verdict on an entry, not the end of the check; CasADi's own
# failures are RuntimeErrors.
_FAILURES = (GeodesicOcpError, ValueError, RuntimeError)


@dataclass(frozen=True)
class Check:
    """One quantity of a known geodesic, as computed by the package.

    Attributes:
        name: of the known geodesic.
        quantity: "exp", "length", "path" or "log"; "metric" where there is not even that.
        backend: of the symbolic rigid-body algorithms; "-" where the metric needs none.
        error: largest difference of any coordinate; inf where there is no result.
        tolerance: what is allowed.
        message: why there is no result, otherwise empty.
    """

    name: str
    quantity: str
    backend: str
    error: float
    tolerance: float
    message: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance; not a number is not."""
        return self.error <= self.tolerance


def check_geodesic(known: KnownGeodesic, backend: str | None = None) -> list[Check]:
    """Exponential map, length, points on the way and logarithm against one known geodesic.

    `exp` is called with the entry's tolerance for it as its own. What raises is reported as failed.

    Args:
        known: the entry.
        backend: of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: the back end is unknown or cannot be imported here.
    """
    used = choose_backend(backend) if has_model(known.metric) else None
    allowed = known.tolerances["exp"]
    try:
        metric = metric_of(known.metric, used)
        errors = _errors(known, metric)
    except _FAILURES as failure:
        return [Check(known.name, "metric", used or "-", np.inf, allowed, str(failure))]
    checks = []
    for quantity, error in errors.items():
        tolerance = known.tolerances["log"] if quantity == "log" else allowed
        try:
            value, message = error(), ""
        except _FAILURES as failure:
            value, message = np.inf, str(failure)
        checks.append(Check(known.name, quantity, used or "-", value, tolerance, message))
    return checks


def _errors(known: KnownGeodesic, metric: Metric) -> dict[str, Callable[[], float]]:
    """For each quantity, how to find its error."""
    tolerance = known.tolerances["exp"]

    def of_exp() -> float:
        return _apart(exp(metric, known.q0, known.v0, tolerance=tolerance), known.q1)

    def of_length() -> float:
        return _apart(metric.norm(known.q0, known.v0), known.length)

    def on_the_way() -> float:
        times = [0.0, *(s for s, _ in known.points)]
        found, _ = sample_geodesic(metric, known.q0, known.v0, times, tolerance=tolerance)
        return _apart(found[1:], [q for _, q in known.points])

    def of_log() -> float:
        return _apart(log(metric, known.q0, known.q1), known.v0)

    errors = {"exp": of_exp, "length": of_length}
    if known.points:
        errors["path"] = on_the_way
    if known.log:
        errors["log"] = of_log
    return errors


def _apart(found: ArrayLike, expected: ArrayLike) -> float:
    return float(np.abs(np.asarray(found) - np.asarray(expected)).max())


def check_known_geodesics(
    known: Iterable[KnownGeodesic], backends: Sequence[str]
) -> tuple[Check, ...]:
    """All checks of known geodesics; those of a model's metric once for every back end."""
    return tuple(
        check
        for entry in known
        for backend in (backends if has_model(entry.metric) else backends[:1])
        for check in check_geodesic(entry, backend)
    )


def table_of(checks: Iterable[Check]) -> Table:
    """Checks as a table."""
    return Table(
        ("name", "quantity", "back end", "error", "tolerance", "verdict"),
        tuple(
            (
                check.name,
                check.quantity,
                check.backend,
                check.error,
                check.tolerance,
                "passed" if check.passed else "FAILED",
            )
            for check in checks
        ),
    )


def run_check(file: str | PathLike[str] | None = None, backend: str | None = None) -> bool:
    """Check the known geodesics, print a table of the results, and say whether all passed.

    Args:
        file: a table of the user's own, checked in addition to the one of the package.
        backend: the only one to check; None: all that can be imported here.

    Raises:
        ValueError: the file is malformed, or the back end is unknown or cannot be imported here.
    """
    known = read_known_geodesics()
    if file is not None:
        known += read_known_geodesics(file)
    backends = [name for name in BACKENDS if not why_unavailable(name)]
    if backend is not None:
        backends = [choose_backend(backend)]
    checks = check_known_geodesics(known, backends)
    print(table_of(checks))
    print()
    failed = [check for check in checks if not check.passed]
    for check in failed:
        if check.message:
            print(f"{check.name}, {check.quantity}, {check.backend}: {check.message}")
    for name in BACKENDS:
        if backend is None and name not in backends:
            print(f"Not checked, as {name} cannot be imported here: {why_unavailable(name)}")
    print(_summary(len(known), checks, backends))
    return not failed


def _summary(geodesics: int, checks: Sequence[Check], backends: Sequence[str]) -> str:
    failed = [check for check in checks if not check.passed]
    subject = f"{geodesics} known geodesics with {' and '.join(backends)}"
    if failed:
        names = dict.fromkeys(repr(check.name) for check in failed)
        return f"{subject}: {len(failed)} of {len(checks)} checks FAILED, of {', '.join(names)}."
    worst = max(checks, key=lambda check: check.error / check.tolerance)
    return (
        f"{subject}: all {len(checks)} checks passed; nearest to its tolerance is {worst.quantity} "
        f"of {worst.name!r}, {worst.error:.1e} of {worst.tolerance:.0e}."
    )
