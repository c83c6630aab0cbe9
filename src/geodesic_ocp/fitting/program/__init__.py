"""The nonlinear program of a fit."""
