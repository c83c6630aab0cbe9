"""What is found by optimisation."""
