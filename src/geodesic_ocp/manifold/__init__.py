"""Riemannian metrics, and what follows from the metric tensor: curvature, exp, transport."""
