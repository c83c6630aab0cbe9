"""Distances of links and obstacles in the program."""
