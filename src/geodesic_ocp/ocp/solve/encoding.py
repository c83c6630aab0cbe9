"""Values of a problem's fields and of arrays as JSON."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Capsule, HalfSpace

_DATACLASSES = {kind.__name__: kind for kind in (Ball, Capsule, HalfSpace)}


def encoded_fields(problem: object) -> dict[str, Any]:
    """The fields of a dataclass as JSON values.

    Returns:
        "fields", values by name; "models", descriptions of models, which are not saved themselves;
        and "left_out", names of all other fields that JSON cannot hold, metrics excepted.
    """
    kept: dict[str, Any] = {}
    models: dict[str, Any] = {}
    left_out = []
    for each in fields(problem) if is_dataclass(problem) else ():
        if not each.init:
            continue
        value = getattr(problem, each.name)
        if isinstance(value, Model):
            models[each.name] = described_model(value)
            continue
        try:
            kept[each.name] = encoded(value)
        except TypeError:
            if not isinstance(value, Metric):  # the path's energy identifies it
                left_out.append(each.name)
    return {"fields": kept, "models": models, "left_out": left_out}


def described_model(model: Model) -> dict[str, Any]:
    """What must be equal for a model to be taken for the one that was saved."""
    return {
        "name": model.name,
        "hand": model.hand,
        "joint_names": list(model.joint_names),
        "lower": as_json(model.lower),
        "upper": as_json(model.upper),
    }


def encoded(value: Any) -> Any:
    """A JSON value from which `decoded` restores the value.

    Raises:
        TypeError: a value that JSON cannot hold.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biuf":
            raise TypeError
        return {"array": [encoded(each) for each in value.ravel().tolist()], "shape": value.shape}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [encoded(each) for each in value]}
    if type(value).__name__ in _DATACLASSES:
        parts = {each.name: encoded(getattr(value, each.name)) for each in fields(value)}
        return {"dataclass": type(value).__name__, "fields": parts}
    if isinstance(value, float) and not np.isfinite(value):
        return {"number": str(value)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError


def decoded(value: Any) -> Any:
    """The value from which `encoded` made a JSON value."""
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.array([decoded(each) for each in value["array"]]).reshape(value["shape"])
    if "number" in value:
        return float(value["number"])
    if "dataclass" in value:
        parts = {name: decoded(each) for name, each in value["fields"].items()}
        return _DATACLASSES[value["dataclass"]](**parts)
    [(name, entries)] = value.items()
    return {"tuple": tuple, "list": list}[name](map(decoded, entries))


def as_json(value: Any) -> Any:
    """Nested lists and numbers; numbers that are not finite by name."""
    if isinstance(value, dict):
        return {key: as_json(each) for key, each in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [as_json(each) for each in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value
