"""Filters of sampled motions, and the noise in them."""
