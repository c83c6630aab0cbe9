"""Pages that show person and robot in motion."""
