"""Views: the functions that show objects of a type as tables, figures and texts, registered by the type's name.

A view is a module with any of the functions ``title``, ``tables``, ``overview``, ``notes``, ``drawings`` and
``section``, each of the object shown; several small views share a module, each with a prefix, as ``bound_title``.
:mod:`identify.display.reporting` says what stands for a function that a view lacks. A view is imported when an object
of its type is first shown; the type itself knows nothing of it.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

_PATHS: dict[str, str] = {}


def register(paths: Mapping[str, str]) -> None:
    """Name the views of types.

    Args:
        paths: of each view, ``module`` or ``module:prefix``, by the type's module and name: ``package.module.Type``.
    """
    _PATHS.update(paths)


def part_of_view(kind: type, part: str) -> Callable[[Any], Any] | None:
    """Return a function of the view of a type, or of the nearest of its bases that has one; None: there is none."""
    names = (f"{base.__module__}.{base.__qualname__}" for base in kind.__mro__)
    path = next((_PATHS[name] for name in names if name in _PATHS), None)
    if path is None:
        return None
    module, _, prefix = path.partition(":")
    return getattr(import_module(module), f"{prefix}_{part}" if prefix else part, None)
