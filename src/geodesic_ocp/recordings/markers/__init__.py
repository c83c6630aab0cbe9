"""Joint angles from the positions of markers."""
