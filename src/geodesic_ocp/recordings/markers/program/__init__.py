"""The nonlinear program that fits a motion to markers."""
