"""``[[source]]`` of an experiment file -> sources, and with ``[[correlation]]`` what is correlated."""

from pathlib import Path
from typing import get_args

import numpy as np

from uq.files.document import ExperimentError, Table
from uq.sources.correlations import Entry, check_correlated, check_correlation, mixing_of, parse_link
from uq.sources.distributions import Normal
from uq.sources.source import CONSTANT, FIXED, NOISE, SIGNALS, TARGET_UNITS, Kind, Mixing, Source, Target, stream_number
from uq.sources.source_figures import Figures, not_negative, positive
from uq.sources.source_width import Width, width_of

ALLAN_UNITS = {"white": "{}*s**0.5", "flicker": "{}", "random_walk": "{}/s**0.5"}


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
    target: Target = table.choice("target", get_args(Target))
    kind = _kind(table, target)
    width = _width(table, target, kind, folder)
    group, reference = table.typed("group", str), table.typed("reference", str, "")
    settings = _settings(table, target, kind)
    source = Source(name, target, kind, group, width.sigma, reference, width.mean, width.shape, settings)
    axes = width.sigma.size
    correlation = table.numbers("correlation", (axes, axes), None) if axes > 1 else None
    table.finish()
    if group == "total":
        raise ExperimentError(f"{table.path('group')} is 'total', which means all sources: write another name")
    if correlation is not None:
        check_correlated(table.path("correlation"), source)
        check_correlation(table.path("correlation"), correlation)
    return Entry(source, correlation)


def _kind(table: Table, target: Target) -> Kind:
    kind: Kind = table.choice("kind", get_args(Kind))
    allowed = [k for t, k in CONSTANT if t == target] + [*(NOISE + FIXED if target in SIGNALS else ())]
    if kind not in allowed and allowed == ["bias"]:
        raise ExperimentError(f"{table.path('kind')} is '{kind}': {target} is one draw an experiment, write \"bias\"")
    if kind not in allowed:
        raise ExperimentError(f"{table.path('kind')} is '{kind}': for {target} choose one of {', '.join(allowed)}")
    return kind


def _width(table: Table, target: Target, kind: Kind, folder: Path) -> Width:
    if kind in ("coloured", *FIXED):
        return Width(np.zeros(0), np.zeros(0), Normal(0.0, 1.0))
    return width_of(table, Figures(table, target, kind), folder, centred=kind == "precision")


def _settings(table: Table, target: Target, kind: Kind) -> dict[str, np.ndarray]:
    """The figures that are not drawn."""
    nothing = ["0 m"] * 3
    if kind == "coloured":
        return _allan(table, target)
    if kind == "saturation":
        return {"limit": positive(table, "limit", TARGET_UNITS[target])}
    if kind == "quantisation":
        return {"step": positive(table, "step", TARGET_UNITS[target])}
    if target == "displaced_air":
        return {"centre": table.vector("centre_from_cg", "m", nothing)}
    if target == "entrained_air":
        radii = not_negative(table, "radii_of_gyration", table.vector("radii_of_gyration", "m", nothing))
        return {"centre": table.vector("centre_from_cg", "m", nothing), "radii_of_gyration": radii}
    return {}


def _allan(table: Table, target: Target) -> dict[str, np.ndarray]:
    if not ALLAN_UNITS.keys() & table.content.keys():
        raise ExperimentError(f"missing key {table.path('white')}: give white, flicker, random_walk or some of them")
    units = {name: unit.format(TARGET_UNITS[target]) for name, unit in ALLAN_UNITS.items()}
    return {
        name: not_negative(table, name, table.vector(name, unit)) if name in table.content else np.zeros(3)
        for name, unit in units.items()
    }


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
