"""The errors of a caller's mistake, in one line."""

import os
from collections.abc import Callable, Iterable
from functools import wraps
from inspect import Parameter, signature
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class RunError(ValueError):
    """A run that cannot be used, in one line: what, where, what to do."""


class UnknownNameError(KeyError):
    """A name under which there is nothing, in one line with those that there are."""

    def __init__(self, name: object, names: Iterable[object]) -> None:
        super().__init__(f"no {name!r}: choose one of {', '.join(map(repr, names))}")

    def __str__(self) -> str:
        return str(self.args[0])  # a KeyError would put it in quotes


def explains_names(function: Callable[P, T]) -> Callable[P, T]:
    """Answer arguments that are given by position but must be named with the call as it should be.

    So it answers the name of a file or preset in place of an argument ``experiment``.

    Raises:
        TypeError: when such a call is made.
    """
    parameters = signature(function).parameters.values()
    by_position = [parameter.name for parameter in parameters if parameter.kind is not Parameter.KEYWORD_ONLY]
    by_name = [parameter.name for parameter in parameters if parameter.kind is Parameter.KEYWORD_ONLY]

    place = by_position.index("experiment") if "experiment" in by_position else None

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        if len(args) > len(by_position):
            more = zip(by_name, args[len(by_position) :], strict=False)
            written = ", ".join([*by_position, *(f"{name}={_short(value)}" for name, value in more)])
            name = function.__name__
            raise TypeError(f"{name}() takes its other arguments by their names: write {name}({written})")
        given = kwargs.get("experiment", args[place] if place is not None and place < len(args) else None)
        if place is not None and isinstance(given, (str, os.PathLike)):
            raise TypeError(
                f"{function.__name__}() takes an Experiment, not its name: write Experiment.load({os.fspath(given)!r})"
            )
        return function(*args, **kwargs)

    return call


def _short(value: object) -> str:
    text = repr(value) if isinstance(value, (int, float, str)) else ""
    return text if 0 < len(text) <= 30 else "…"
