"""Export formats, one file each: an entry point of the group ``inertia_uq.exports`` names an :class:`ExportFormat`.

docs/how-to/extending.md shows a new one.
"""

from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from typing import NamedTuple

from rig.exceptions import quoted
from uq.bodies.exported_body import ExportedBody
from uq.files.mistakes import ExperimentError

ENTRIES = entry_points(group="inertia_uq.exports")


class ExportFormat(NamedTuple):
    """A file that others read."""

    file: str
    """Name of the file."""
    description: str
    text: Callable[[ExportedBody], str]
    """Function that writes the text of the file."""


def names() -> tuple[str, ...]:
    """Return the names of all formats, without importing them."""
    return tuple(sorted(ENTRIES.names))


def chosen(formats: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names of formats, each once, from names or from one string of them with commas.

    Raises:
        ExperimentError: no format, or one that there is not.
    """
    given = formats.split(",") if isinstance(formats, str) else formats
    wanted = tuple(dict.fromkeys(name.strip() for name in given))
    if unknown := [name for name in wanted or ("",) if name not in names()]:
        raise ExperimentError(f"unknown export format {quoted(unknown[0])}: choose of {', '.join(names())}")
    return wanted


def export_format(name: str) -> ExportFormat:
    """Return a format, by its name out of :func:`names`."""
    return ENTRIES[name].load()
