"""From a recording to geodesic synergies."""
