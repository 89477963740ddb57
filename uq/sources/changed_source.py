"""A ``[[source]]`` with another figure: what it takes the place of, and one figure for all axes."""

from collections.abc import Mapping
from typing import Any

from uq.files.changed_document import with_keys
from uq.sources.source import KINDS
from uq.sources.source_keys import SIZES
from uq.sources.source_width import WIDTHS

OF_ANOTHER_WIDTH = ("distribution", "degrees_of_freedom", "unit")
"""Keys beside a width that is replaced by one of another kind, such as a datasheet's statement by a sigma."""


def changed_source(entry: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source's keys with others in their place.

    A width, such as ``sigma``, takes the place of any other, such as ``datasheet``, and of the keys that go with that.
    One figure stands for all axes.
    """
    both = {**entry, **keys}
    kind = KINDS.get((str(both.get("target")), str(both.get("kind"))))
    of_axes = kind is not None and kind.shape == (3,)
    before = {key for key in WIDTHS if key in entry}
    left_out: dict[str, None] = {}
    if before and set(keys) & set(WIDTHS) - before:
        of_datasheet = ("full_scale",) if of_axes and "datasheet" in before else ()
        left_out = dict.fromkeys((*before, *OF_ANOTHER_WIDTH, *of_datasheet))
    together = with_keys(entry, {**left_out, **keys})
    if kind is None or not of_axes:
        return together
    repeated = {*SIZES, *kind.sizes} & set(keys)
    return {
        key: [value] * 3 if key in repeated and isinstance(value, str) else value for key, value in together.items()
    }
