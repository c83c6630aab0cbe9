"""Every exception of the package that is not a ValueError about an argument."""


class GeodesicOcpError(Exception):
    """Base of the package's exceptions."""


class IntegrationFailed(GeodesicOcpError):
    """An integration stopped before its end: the message says where and why.

    Attributes:
        time: at which it stopped, None where it was not begun or not to the tolerance.
        state: what it had reached then, an array, or None.
    """

    def __init__(self, message: str, time: float | None = None, state: object = None) -> None:
        super().__init__(message)
        self.time = time
        self.state = state


class NotConverged(GeodesicOcpError):
    """A solver stopped elsewhere than at a solution.

    Attributes:
        solution: the record of the attempt (last iterate, status, residuals), or None where the
            attempt ended before there was an iterate.
    """

    def __init__(self, message: str, solution: object = None) -> None:
        super().__init__(message)
        self.solution = solution


class RecordingError(GeodesicOcpError, ValueError):
    """A recording cannot be read: names the file, the line or element, and what was expected."""
