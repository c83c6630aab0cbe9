"""What tools/pinocchio_casadi.py does: Pinocchio's CasADi bindings, built against pip's wheels.

target.py says what is installed, checks.py whether a build can succeed, build.py builds, cache.py
keeps the result, install.py puts it beside the installed pinocchio and takes it away again.
"""
