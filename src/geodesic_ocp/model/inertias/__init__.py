"""Masses and inertias of the links of a model."""
