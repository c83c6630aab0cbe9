"""Arms, robots and people as outlines in a plane."""
