"""Models from files: URDF, MJCF, the Master Motor Map, robots by name."""
