"""The same motion timed by other software, for comparison."""
