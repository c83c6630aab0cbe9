"""Whether what is installed computes the geodesics that are known."""
