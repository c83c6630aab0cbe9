"""The nonlinear program of a trajectory in time."""
