"""The nonlinear program of a problem on a grid."""
