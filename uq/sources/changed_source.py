"""Sources of a file's content: one with another figure, and the content without some, by their names or kinds."""

from collections.abc import Mapping, Sequence
from typing import Any

from rig.exceptions import listed, quoted
from uq.files.changed_document import with_keys
from uq.files.mistakes import ExperimentError
from uq.sources.source import KINDS, Source
from uq.sources.source_table import WIDTHS

OF_ANOTHER_WIDTH = ("distribution", "degrees_of_freedom", "unit")
"""Keys beside a width that is replaced by one of another kind, such as a datasheet's statement by a sigma."""


def changed_source(entry: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a source's keys with others in their place.

    A width, such as ``sigma``, takes the place of any other, such as ``datasheet``, and of the keys that go with that.
    """
    both = {**entry, **keys}
    kind = KINDS.get((str(both.get("target")), str(both.get("kind"))))
    is_vector = kind is not None and kind.shape == (3,)
    before = {key for key in WIDTHS if key in entry}
    left_out: dict[str, None] = {}
    if before and set(keys) & set(WIDTHS) - before:
        datasheet_keys = ("full_scale",) if is_vector and "datasheet" in before else ()
        left_out = dict.fromkeys((*before, *OF_ANOTHER_WIDTH, *datasheet_keys))
    return with_keys(entry, {**left_out, **keys})


def without_sources(
    document: Mapping[str, Any], sources: Sequence[Source], which: Sequence[str]
) -> tuple[dict[str, Any], list[str]]:
    """Return the content without the sources of some names or kinds and what correlates them, and their names.

    A name may have spaces for its underscores, as tables print it.

    Raises:
        ExperimentError: no source has such a name or kind.
    """
    names_by_word: dict[str, list[str]] = {}
    for source in sources:
        for word in (source.name, source.kind):
            names_by_word.setdefault(word.replace(" ", "_"), []).append(source.name)
    left_out: dict[str, None] = {}
    for wanted in which:
        names = names_by_word.get(wanted.replace(" ", "_"))
        if names is None:
            named, kinds = (dict.fromkeys(getattr(s, key) for s in sources) for key in ("name", "kind"))
            choices = f"choose a name of [[source]] ({listed(named)}) or a kind ({listed(kinds)})"
            raise ExperimentError(f"no source to leave out has the name or kind {quoted(wanted)}: {choices}")
        left_out |= dict.fromkeys(names)
    links = [link for link in document.get("correlation", []) if not left_out.keys() & set(link["sources"])]
    remaining = [source for source in document.get("source", []) if source["name"] not in left_out]
    return with_keys(document, {"source": remaining, "correlation": links or None}), list(left_out)
