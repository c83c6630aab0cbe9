"""The nonlinear program by which a motion is fitted to markers."""
