"""Readers of recording formats."""
