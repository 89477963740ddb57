"""Functions that JAX compiles: ``jax.jit`` with everything static that is no array."""

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Generic, ParamSpec, TypeVar

import jax

from identify.pytree import is_array

Given = ParamSpec("Given")
Result = TypeVar("Result", covariant=True)
Static = tuple[Any, tuple[tuple[type, str, Any], ...]]
"""The structure of a program's arguments, with None in place of each array and all other leaves as they are."""


class CompiledProgram(Generic[Given, Result]):
    """A function compiled once for each kind of arguments: arrays are traced, all else is compiled in.

    Use it as a decorator of functions at the top of a module.
    """

    def __init__(self, function: Callable[Given, Result], options: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Wrap a function; ``options`` are the compiler's."""
        functools.update_wrapper(self, function)

        @functools.wraps(function)
        def of_arrays(static: Static, arrays: list[Any]) -> Any:
            tree, others = static
            following = iter(arrays)
            leaves = [next(following) if leaf is None else leaf for *_, leaf in others]
            args, kwargs = jax.tree.unflatten(tree, leaves)
            return function(*args, **kwargs)

        del of_arrays.__wrapped__
        self.jitted = jax.jit(of_arrays, static_argnums=0, compiler_options=dict(options))

    def __call__(self, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Call the function."""
        leaves, tree = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if is_array(leaf)]
        return self.jitted((tree, tuple(_distinct(None if is_array(leaf) else leaf) for leaf in leaves)), arrays)

    def __get__(self, instance: object, owner: type) -> Any:
        """Bind a method to its object."""
        call: Any = self
        return call if instance is None else functools.partial(call, instance)


def _distinct(leaf: Any) -> tuple[type, str, Any]:
    """A leaf beside what tells it from those that Python holds for equal: 1, 1.0 and True; 0.0 and -0.0."""
    return type(leaf), repr(leaf) if isinstance(leaf, float) else "", leaf
