"""The one exception of these tools."""


class CannotBuild(Exception):
    """What is in the way, and what helps."""
