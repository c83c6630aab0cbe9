"""From a problem to a solution."""
