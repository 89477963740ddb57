"""The one exception of this package."""


class RigError(ValueError):
    """A user's mistake or a fault of a file or device, in one line: ``<what> <where>: <what to do>``."""
