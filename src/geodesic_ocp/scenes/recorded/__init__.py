"""Recordings of people and their synergies."""
