"""Annotated shapes, checked once for each kind of call: types, shapes and dtypes of what goes in and comes out.

Functions without the shape of an array in their annotations are mypy's to check.
jaxtyping and beartype judge a call by nothing else, but for longer than most functions take; a test repeats a few kinds
of calls thousands of times. To tell their kinds takes longer than many of them, too, so that of each function a test
looks at its first calls. What checks a function is made at its first call, since a test calls few of them.
"""

import functools
import inspect
import threading
import typing

import beartype
import jax
import jaxtyping
import numpy as np

FEW = 16
"""Longer sequences are told apart by their length and first element, mappings by their first item, longer texts not at all."""


LOOKED_AT = 200
"""Calls of a function that a test looks at."""


PLAIN = tuple.__iter__, list.__iter__, dict.__iter__
"""Containers of our own are looked through by checked functions of theirs."""


def _of_array(value):
    return type(value), value.shape, value.dtype


def _of_sequence(value):
    return type(value), len(value), tuple(map(kind, value if len(value) <= FEW else value[:1]))


def _of_mapping(value):
    return type(value), next(((kind(key), kind(each)) for key, each in value.items()), None)


def _of_text(value):
    return type(value), value if len(value) <= FEW else None  # a word may be one of those that are allowed


def _how(value):
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return _of_array
    if isinstance(value, str):
        return _of_text
    if getattr(type(value), "__iter__", None) in PLAIN:
        return _of_mapping if isinstance(value, dict) else _of_sequence
    return type


_HOW = {}


def kind(value):
    """Return what tells a value from those of other kinds."""
    describe = _HOW.get(type(value))
    if describe is None:
        describe = _HOW[type(value)] = _how(value)
    return describe(value)


def shaped(annotation):
    """Return whether an annotation states an array's shape, which mypy does not see."""
    if isinstance(annotation, str):  # of a name that is defined later
        return any(f"{name}[" in annotation for name in dir(jaxtyping))
    array = isinstance(annotation, type) and issubclass(annotation, jaxtyping.AbstractArray)
    return array or any(map(shaped, typing.get_args(annotation)))


class Checks:
    """A function's check, which kinds of its calls have passed it, and how many calls this test has made."""

    test = 0
    """Number of the present test."""

    def __init__(self, function, typechecker):
        self.function, self.typechecker, self.passed, self.here = function, typechecker, {}, threading.local()
        self.caller, self.calls = 0, 0

    @functools.cached_property
    def checked(self):
        """The function with its check; where its result is known, of that result."""

        @functools.wraps(self.function)
        def answer(*args, **options):
            computed = self.here.__dict__.pop("computed", None)
            return computed[0] if computed else self.function(*args, **options)

        return REAL(answer, typechecker=self.typechecker)

    def __call__(self, args, options):
        if self.caller != Checks.test:
            self.caller, self.calls = Checks.test, 0
        self.calls += 1
        if self.calls > LOOKED_AT:
            return self.function(*args, **options)
        asked = tuple(map(kind, args)), tuple((name, kind(value)) for name, value in options.items())
        answers = self.passed.get(asked)
        if answers is None:
            result = self.checked(*args, **options)
            self.passed[asked] = {kind(result)}
            return result
        result = self.function(*args, **options)
        if kind(result) not in answers:
            self.here.computed = (result,)
            try:
                self.checked(*args, **options)
            finally:
                self.here.__dict__.pop("computed", None)
            answers.add(kind(result))
        return result


REAL = jaxtyping.jaxtyped


def checked_calls(target=None, *, typechecker):
    """Do what ``jaxtyping.jaxtyped`` does, once for each kind of call."""
    again = functools.partial(checked_calls, typechecker=typechecker)
    if target is None:
        return again
    if isinstance(target, classmethod | staticmethod):
        return type(target)(again(target.__func__))
    if isinstance(target, property):
        return property(*(each and again(each) for each in (target.fget, target.fset, target.fdel)))
    if inspect.isclass(target):
        plain = target.__init__
        REAL(target, typechecker=typechecker)
        if target.__init__ is not plain:
            target.__init__ = again(plain)
        return target
    if not any(map(shaped, inspect.get_annotations(target).values())):
        return target
    checks = Checks(target, typechecker)

    @functools.wraps(target)
    def called(*args, **options):
        __tracebackhide__ = True
        return checks(args, options)

    return called


jaxtyping.jaxtyped = checked_calls
beartyped = checked_calls(typechecker=beartype.beartype)
