"""Files of marker positions."""
