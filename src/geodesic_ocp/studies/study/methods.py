"""The methods of a study, in their order, and what they are called."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from geodesic_ocp.manifold.metrics import KINETIC_ENERGY, STRAIGHT_LINES
from geodesic_ocp.studies.tables.columns import Row

OWN = "riemannian"
_ORDER = (OWN, "joint_inertia", "kinetic_energy", "euclidean_same_segments", "euclidean")
_LIKE_FOR_LIKE = f"{STRAIGHT_LINES}, same segments"


def method_labels(rows: Iterable[Row]) -> dict[str, str]:
    """Labels by key; a key whose label depends on the condition is its own label."""
    labels: dict[str, set[str]] = {}
    for row in rows:
        label = str(row.get("method_label") or row["method"])
        labels.setdefault(str(row["method"]), set()).add(label)
    order = sorted(labels, key=lambda key: (*(key != known for known in _ORDER), key))
    return {key: labels[key].pop() if len(labels[key]) == 1 else key for key in order}


def reference(
    methods: Mapping[str, str], conditions: Sequence[str], against: str | None
) -> tuple[str, str]:
    """What others are compared with: "method" or "condition", and its key.

    Raises:
        ValueError: there is no such method or condition; of None, no straight lines on the same
            segments.
    """
    wanted = _LIKE_FOR_LIKE if against is None else against
    if key := next((k for k, label in methods.items() if wanted in (k, label)), None):
        return "method", key
    if wanted in conditions:
        return "condition", wanted
    known = ", ".join(map(repr, (*methods, *conditions)))
    raise ValueError(f"against must be one of {known}, got {against!r}")


def length_unit(methods: Mapping[str, str]) -> str:
    """Unit of the synergies' lengths; empty if it is not known."""
    label = methods.get(OWN, "")
    if STRAIGHT_LINES in label:
        return "rad"
    return "sqrt(kg) m" if KINETIC_ENERGY in label else ""
