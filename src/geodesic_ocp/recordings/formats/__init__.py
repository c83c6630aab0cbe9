"""Recordings of people in their file formats."""
