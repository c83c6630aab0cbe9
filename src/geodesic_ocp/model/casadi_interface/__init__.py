"""Pinocchio's CasADi interface where its Python module `pinocchio.casadi` is not installed.

`pinocchio_casadi.cpp` hands Pinocchio's algorithms over as CasADi functions, `build.py` compiles it
against the installed wheels, and `library.py` finds and calls the result.
"""
