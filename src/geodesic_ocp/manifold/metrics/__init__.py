"""Metrics on the joint space of a model, and the Euclidean one."""
