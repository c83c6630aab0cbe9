"""Names that the examples in docstrings take for granted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import geodesic_ocp as go


@pytest.fixture(autouse=True)
def _names_of_examples(doctest_namespace: dict[str, Any]) -> None:
    doctest_namespace.update(go=go, np=np)
