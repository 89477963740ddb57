"""The error of a run that cannot be used."""


class RunError(ValueError):
    """A run that cannot be used, in one line: what, where, what to do."""
