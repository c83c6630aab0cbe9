"""What is around the actors: the rest of a person, obstacles, distances, ellipsoids."""
