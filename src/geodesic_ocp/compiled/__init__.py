"""Compiled code: CasADi functions and a small numerical core as one library for each metric."""
