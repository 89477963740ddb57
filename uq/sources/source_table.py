"""``[[source]]`` of an experiment file -> sources, and with ``[[correlation]]`` what is correlated."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from rig.exceptions import quoted
from rig.toml_tables import TomlError, WrongKeyError, read_table, read_value
from uq.files.mistakes import ExperimentError
from uq.sources.correlations import LinkTable, SourceEntry, check_correlated, check_correlation, link_of, mixing_of
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing, stream_number
from uq.sources.source import KINDS, ErrorKind, Source
from uq.sources.source_keys import source_table
from uq.sources.source_width import Width, width_of


class WrittenSource(NamedTuple):
    """A ``[[source]]`` as it stands in a file, read by its kind's declaration."""

    where: str
    raw: Mapping[str, Any]
    kind: ErrorKind
    table: Any


def read_source(path: str, raw: Any) -> WrittenSource:
    """Read a ``[[source]]`` by the declaration of its kind on its target.

    Raises:
        TomlError: a mistake in its keys.
    """
    if not isinstance(raw, Mapping):
        raise TomlError(f"{path} is {quoted(raw)}: write a table")
    target = _word(path, raw, "target", {target for target, _ in KINDS})
    name = _word(path, raw, "kind", {name for _, name in KINDS})
    kind = KINDS.get((target, name))
    if kind is None:
        allowed = sorted(other.name for other in set(KINDS.values()) if other.targets.get(target))
        advice = f'{target} is one draw an experiment, write "bias"'
        if allowed != ["bias"]:
            advice = f"for {target} choose one of {', '.join(allowed)}"
        raise TomlError(f"{path}.kind is '{name}': {advice}")
    return WrittenSource(path, raw, kind, read_table(path, raw, source_table(target, name)))


def _word(path: str, raw: Mapping[str, Any], key: str, words: set[str]) -> str:
    if key not in raw:
        raise TomlError(f"missing key {path}.{key}: add it")
    return read_value(f"{path}.{key}", raw[key], Literal[tuple(sorted(words))])


def sources_of(
    written: Sequence[WrittenSource], correlations: Sequence[LinkTable], folder: Path
) -> tuple[tuple[Source, ...], tuple[Mixing, ...]]:
    """Return the sources of an experiment file, and what is correlated.

    Args:
        written: its ``[[source]]``.
        correlations: its ``[[correlation]]``.
        folder: where files of samples are.

    Raises:
        ExperimentError: a mistake in either.
    """
    entries = []
    for table in written:
        try:
            entries.append(_entry(table, folder))
        except WrongKeyError as error:
            raise ExperimentError(error.line(table.where, table.raw)) from None
    sources = {entry.source.name: entry.source for entry in entries}
    _check_names([entry.source for entry in entries])
    links = [link_of(f"correlation[{k}]", link, sources) for k, link in enumerate(correlations)]
    return tuple(sources.values()), mixing_of(entries, links)


def _entry(written: WrittenSource, folder: Path) -> SourceEntry:
    table, kind, where = written.table, written.kind, written.where
    width = Width(np.zeros(0), np.zeros(0), Normal(0.0, 1.0))
    if kind.constant or kind.white:
        width = width_of(table, kind, table.target, folder)
    settings = kind.settings({key: getattr(table, key) for key in kind.keys(table.target)})
    identity = (table.name, table.target, kind.name, table.group)
    source = Source(*identity, width.sigma, table.reference, width.mean, width.shape, settings)
    if table.group == "total":
        raise WrongKeyError("group", "write another name", "is 'total', which means all sources")
    correlation = getattr(table, "correlation", None)
    if correlation is not None:
        check_correlated(f"{where}.correlation", source)
        check_correlation(f"{where}.correlation", correlation)
    return SourceEntry(source, correlation)


def _check_names(sources: list[Source]) -> None:
    """Refuse names that would be mistaken for one another: a source's for a group's, or two of one random stream."""
    names, groups = [source.name for source in sources], {source.group for source in sources}
    streams = {stream_number(name): name for name in names}
    for name in names:
        if names.count(name) > 1:
            raise ExperimentError(f"two entries named '{name}' in [[source]]: give each its own name")
        if name in groups:
            raise ExperimentError(f"'{name}' names a source and a group: rename one")
        if (other := streams[stream_number(name)]) != name:
            raise ExperimentError(f"sources '{name}' and '{other}' have one random stream: rename one")
