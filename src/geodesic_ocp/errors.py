"""The package's exceptions, apart from ValueError for wrong arguments."""


class GeodesicOcpError(Exception):
    """Base class of the package's exceptions."""


class IntegrationFailed(GeodesicOcpError):
    """An integration stopped early; the message says where and why.

    Attributes:
        time: where it stopped; None if it did not start or did not meet the tolerance.
        state: state at that time, an array, or None.
    """

    def __init__(self, message: str, time: float | None = None, state: object = None) -> None:
        super().__init__(message)
        self.time = time
        self.state = state


class NotConverged(GeodesicOcpError):
    """A solver stopped without a solution.

    Attributes:
        solution: the record of the attempt (last iterate, status, residuals), for a log map the
            last path, or None if it stopped before the first iterate.
    """

    def __init__(self, message: str, solution: object = None) -> None:
        super().__init__(message)
        self.solution = solution


class RecordingError(GeodesicOcpError, ValueError):
    """A file cannot be read; names the file, the line or element, and what was expected."""
