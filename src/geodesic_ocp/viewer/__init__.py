"""Scenes drawn: pages for browsers and notebooks, and videos."""
