"""What is found by optimization."""
