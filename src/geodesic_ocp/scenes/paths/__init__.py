"""Paths and solutions of problems."""
