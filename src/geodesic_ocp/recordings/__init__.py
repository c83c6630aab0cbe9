"""Recordings of people, read from files."""
