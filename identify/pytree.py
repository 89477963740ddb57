"""Frozen dataclasses that JAX takes for trees of their fields: what a function of one trial is given and returns."""

import dataclasses
from abc import ABC
from collections.abc import Iterable
from typing import Any, dataclass_transform

import jax
import numpy as np
from jax.tree_util import GetAttrKey


def static_field(**options: Any) -> Any:
    """Return a field that is compiled in, as it is no array: of :class:`Pytree`; options are those of a dataclass."""
    return dataclasses.field(metadata={"static": True}, **options)


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, static_field))
class Pytree(ABC):  # noqa: B024 - subclasses have abstract methods
    """A frozen dataclass whose fields are a tree of JAX; subclasses need no decorator.

    The same as ``equinox.Module`` for what is needed here; to import that would delay the start of every command.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        """Make the subclass a dataclass and register it."""
        super().__init_subclass__(**options)
        dataclasses.dataclass(frozen=True, eq=False, repr="__repr__" not in cls.__dict__)(cls)
        fields: dict[bool, list[str]] = {True: [], False: []}
        for field in dataclasses.fields(cls):  # type: ignore[arg-type]
            fields[field.metadata.get("static", False)].append(field.name)
        static, dynamic = fields[True], fields[False]

        def flatten(tree: Any) -> tuple[list[Any], tuple[Any, ...]]:
            return [getattr(tree, name) for name in dynamic], tuple(getattr(tree, name) for name in static)

        def flatten_with_keys(tree: Any) -> tuple[list[tuple[Any, Any]], tuple[Any, ...]]:
            values, fixed = flatten(tree)
            return [(GetAttrKey(name), value) for name, value in zip(dynamic, values, strict=True)], fixed

        def unflatten(fixed: Iterable[Any], values: Iterable[Any]) -> Any:
            tree = object.__new__(cls)  # what a field holds within a transformation may pass no check
            for name, value in (*zip(dynamic, values, strict=True), *zip(static, fixed, strict=True)):
                object.__setattr__(tree, name, value)
            return tree

        jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)

    def __eq__(self, other: object) -> bool:
        """Return whether both are of one class, with the same structure and equal leaves."""
        if type(other) is not type(self):
            return NotImplemented
        both: Any = map(jax.tree.flatten, (self, other))
        (leaves, tree), (others, other_tree) = both
        return bool(tree == other_tree) and all(map(np.array_equal, leaves, others))

    def __hash__(self) -> int:
        """Return the hash of structure and leaves. Raises TypeError where a leaf is an array."""
        leaves, tree = jax.tree.flatten(self)
        return hash((tree, tuple(leaves)))
