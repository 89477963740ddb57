"""Export formats, one file each: the name of the file is that of the format, its ``FORMAT`` what is written.

A new format is one new file; see docs/extending.md.
"""

from collections.abc import Callable
from importlib import import_module
from pkgutil import iter_modules
from typing import NamedTuple

from uq.bodies.exported_body import ExportedBody


class ExportFormat(NamedTuple):
    """A file that others read."""

    file: str
    """Its name."""
    description: str
    text: Callable[[ExportedBody], str]
    """What stands in it."""


def names() -> tuple[str, ...]:
    """Return the names of all formats, without importing them."""
    return tuple(sorted(module.name for module in iter_modules(__path__)))


def export_format(name: str) -> ExportFormat:
    """Return a format, by its name out of :func:`names`."""
    return import_module(f"{__name__}.{name}").FORMAT
