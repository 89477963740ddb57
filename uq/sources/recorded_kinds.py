"""Kinds of the errors of the rig that are declared by their file alone: it says what they do to the samples."""

from typing import ClassVar

from identify.errors.error_model import ErrorModel
from identify.errors.registry import ERRORS
from uq.sources.source import KINDS, ErrorKind


class ErrorByAct(ErrorKind):
    """Lets an error of :mod:`identify.errors` act, to first order, on a recorded run or on a trial's samples."""

    constant = True
    error: ClassVar[ErrorModel]


def register() -> None:
    """Define a kind for each error that is declared by a target and a kind which no other file defines."""
    for error in ERRORS.values():
        if error.declared_as is not None and error.declared_as not in KINDS and error.typical is not None:
            target, name = error.declared_as
            shape = (error.count,) if error.count > 1 else ()
            tables = {"name": name, "targets": {target: error.typical.key_unit}, "shape": shape, "error": error}
            type(error.name, (ErrorByAct,), {**tables, "__doc__": error.typical.about})
