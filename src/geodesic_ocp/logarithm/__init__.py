"""The logarithmic map: geodesics between configurations, and from a configuration to a pose."""
