"""Geometry of links: signed distances, collision geometry, meshes, enclosing capsules."""
