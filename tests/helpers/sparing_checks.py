"""Annotated shapes and types are checked at the first calls of each function in a test; at every call it takes too long.

pytest's option ``--jaxtyping-packages`` decorates each function of the packages with ``jaxtyping.jaxtyped``, which makes
its checker at once and asks it always. Here the checker is made at the first call, and asked :data:`CALLS` times a test.
"""

import functools
import inspect
from collections.abc import Callable
from typing import Any

import jaxtyping

CALLS = 20
"""Of each function in each test."""
every_call = jaxtyping.jaxtyped
begun = 0
"""Tests so far."""


def jaxtyped(function: Any = None, *, typechecker: Any) -> Any:
    """Take the place of ``jaxtyping.jaxtyped``; classes, whose construction it checks, are left to it."""
    if function is None:
        return functools.partial(jaxtyped, typechecker=typechecker)
    if not inspect.isfunction(function):
        return every_call(function, typechecker=typechecker)
    if not function.__annotations__:
        return function
    checked: Callable[..., Any] | None = None
    calls, test = 0, -1

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        __tracebackhide__ = True
        nonlocal checked, calls, test
        if test != begun:
            calls, test = 0, begun
        if calls >= CALLS:
            return function(*arguments, **named)
        calls += 1
        if checked is None:
            checked = every_call(function, typechecker=typechecker)
        return checked(*arguments, **named)

    return call


def begin_test() -> None:
    """Count the calls anew."""
    global begun
    begun += 1


jaxtyping.jaxtyped = jaxtyped
