"""The one exception of these tools."""


class CannotBuild(Exception):
    """The reason why a build is impossible, and what to do."""
