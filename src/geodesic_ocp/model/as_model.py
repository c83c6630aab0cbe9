"""Check of arguments that must be models."""

from __future__ import annotations

from typing import Any

from geodesic_ocp.model.model import Model


def as_model(model: Any) -> Model:
    """The argument, if it is a model; ValueError otherwise."""
    if not isinstance(model, Model):
        hint = "; use its attribute model" if hasattr(model, "model") else ""
        raise ValueError(f"model must be a Model, got {model!r}{hint}")
    return model
