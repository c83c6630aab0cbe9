"""Clearance of links from each other: pairs, constraints, exact distances."""
