"""Skeletons of motion-capture files, and the segments of the body that their joints carry."""
