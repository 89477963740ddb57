"""``[[source]]`` of an experiment file -> sources, and with ``[[correlation]]`` what is correlated."""

from pathlib import Path

from uq.files.document import ExperimentError, Table
from uq.sources.correlations import Entry, check_correlated, check_correlation, mixing_of, parse_link
from uq.sources.draws import Mixing, stream_number
from uq.sources.source import KINDS, ErrorKind, Source


def parse_sources(top: Table, folder: Path) -> tuple[tuple[Source, ...], tuple[Mixing, ...]]:
    """Read ``[[source]]`` and ``[[correlation]]`` from an experiment file.

    Args:
        top: the file's content.
        folder: where files of samples are.

    Raises:
        ExperimentError: a mistake in either.
    """
    entries = top.tables("source", lambda table: _entry(table, folder))
    sources = {entry.source.name: entry.source for entry in entries}
    _check_names([entry.source for entry in entries])
    links = top.tables("correlation", lambda table: parse_link(table, sources))
    return tuple(sources.values()), mixing_of(entries, links)


def _entry(table: Table, folder: Path) -> Entry:
    name = table.typed("name", str)
    target = table.choice("target", tuple(sorted({target for target, _ in KINDS})))
    kind = _kind(table, target)
    width = kind.width(table, target, folder)
    group, reference = table.typed("group", str), table.typed("reference", str, "")
    settings = kind.settings(table, target)
    source = Source(name, target, kind.name, group, width.sigma, reference, width.mean, width.shape, settings)
    axes = width.sigma.size
    correlation = table.numbers("correlation", (axes, axes), None) if axes > 1 else None
    table.finish()
    if group == "total":
        raise ExperimentError(f"{table.path('group')} is 'total', which means all sources: write another name")
    if correlation is not None:
        check_correlated(table.path("correlation"), source)
        check_correlation(table.path("correlation"), correlation)
    return Entry(source, correlation)


def _kind(table: Table, target: str) -> ErrorKind:
    name = table.choice("kind", tuple(sorted({name for _, name in KINDS})))
    if kind := KINDS.get((target, name)):
        return kind
    allowed = sorted(other.name for other in set(KINDS.values()) if other.targets.get(target))
    if allowed == ["bias"]:
        raise ExperimentError(f"{table.path('kind')} is '{name}': {target} is one draw an experiment, write \"bias\"")
    raise ExperimentError(f"{table.path('kind')} is '{name}': for {target} choose one of {', '.join(allowed)}")


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
