"""Predictions that geodesics are compared with."""
