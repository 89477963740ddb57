"""The errors of a user's mistake, which a command answers with one line."""

from identify.exceptions import RunError
from rig.exceptions import RigError


class ExperimentError(ValueError):
    """A mistake in an experiment file, in one line: what, where, what to do."""


MISTAKES = (ExperimentError, RunError, RigError)
"""Errors of a user's mistake, each one line."""
