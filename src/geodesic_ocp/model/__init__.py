"""What moves: rigid bodies."""
