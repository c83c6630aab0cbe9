"""All synergies of a motion as one program: configurations at the waypoints, and paths."""
