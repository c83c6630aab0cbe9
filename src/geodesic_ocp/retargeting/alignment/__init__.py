"""Alignment of robots' arms with a person's: known ones, proposals from the kinematics, files."""
