"""Where a motion is cut into segments."""
