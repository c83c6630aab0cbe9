"""Playbacks drawn as pictures and videos, without a screen, a browser or a graphics card."""
