"""``[[correlation]]`` of an experiment file, and which sources hang together by it."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from rig.toml_tables import TomlTable, written
from uq.files.document import ExperimentError
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing
from uq.sources.source import Source


class Entry(NamedTuple):
    """One ``[[source]]``."""

    source: Source
    correlation: np.ndarray | None
    """Between its own axes."""

    @property
    def axes(self) -> int:
        """How many numbers it draws."""
        return int(np.size(self.source.sigma))


class Link(NamedTuple):
    """One ``[[correlation]]``: between the numbers that two sources draw."""

    names: tuple[str, str]
    coefficients: np.ndarray


def _two_names(_: str, raw: Any) -> tuple[str, str]:
    if not isinstance(raw, list) or len(raw) != 2 or not all(isinstance(name, str) for name in raw):
        raise ValueError(f"is {raw!r}: name two of [[source]]")
    return raw[0], raw[1]


TWO_NAMES = {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}


class LinkTable(TomlTable, frozen=True, kw_only=True):
    """``[[correlation]]``: between the numbers that two sources draw."""

    sources: Annotated[tuple[str, str], written(_two_names, TWO_NAMES)]
    """Names of two sources."""
    coefficient: float | tuple[tuple[float, ...], ...]
    """A number for like axes, or a matrix with a row for each axis of the first."""


def link_of(where: str, table: LinkTable, sources: Mapping[str, Source]) -> Link:
    """Return what a ``[[correlation]]`` links.

    Raises:
        ExperimentError: sources that cannot be correlated, or a matrix of another shape.
    """
    names, written_names = table.sources, list(table.sources)
    if not set(names) <= sources.keys() or names[0] == names[1]:
        raise ExperimentError(f"{where}.sources is {written_names!r}: name two different ones of [[source]]")
    one, two = (sources[name] for name in names)
    for source in (one, two):
        check_correlated(f"{where}.sources", source)
    if one.constant != two.constant:
        raise ExperimentError(f"{where}.sources: one is drawn at each sample, the other once; leave it out")
    sizes = np.size(one.sigma), np.size(two.sigma)
    if isinstance(table.coefficient, float) and sizes[0] == sizes[1]:
        return Link(names, table.coefficient * np.eye(sizes[0]))
    rows = table.coefficient if isinstance(table.coefficient, tuple) else ()
    if [len(row) for row in rows] != [sizes[1]] * sizes[0]:
        finite = "finite " if rows else ""
        raise ExperimentError(f"{where}.coefficient: write {sizes[0]} rows of {sizes[1]} {finite}numbers")
    return Link(names, np.array(rows))


def check_correlated(where: str, source: Source) -> None:
    """Refuse a correlation of what is not drawn from a normal distribution.

    Raises:
        ExperimentError: the source is not drawn, or not normal.
    """
    if not (source.constant or source.white):
        raise ExperimentError(f"{where}: '{source.name}' is {source.kind}, which cannot be correlated; leave it out")
    if not isinstance(source.shape, Normal):
        raise ExperimentError(f"{where}: '{source.name}' is not normal, so it cannot be correlated; leave it out")


def mixing_of(entries: Sequence[Entry], links: Sequence[Link]) -> tuple[Mixing, ...]:
    """Return the sets of sources that hang together by correlations, each with its correlation matrix.

    Raises:
        ExperimentError: coefficients that no joint distribution has.
    """
    sets: list[set[str]] = [{entry.source.name} for entry in entries if entry.correlation is not None]
    for link in links:
        touched = [one for one in sets if one & set(link.names)]
        sets = [one for one in sets if one not in touched] + [set(link.names).union(*touched)]
    return tuple(_mixing([entry for entry in entries if entry.source.name in one], links) for one in sets)


def _mixing(members: Sequence[Entry], links: Sequence[Link]) -> Mixing:
    names, axes = [entry.source.name for entry in members], [entry.axes for entry in members]
    part = {name: slice(end - n, end) for name, n, end in zip(names, axes, np.cumsum(axes), strict=True)}
    matrix = np.eye(sum(axes))
    for entry in members:
        if entry.correlation is not None:
            matrix[part[entry.source.name], part[entry.source.name]] = entry.correlation
    for one, two, coefficients in ((part[a], part[b], c) for (a, b), c in links if a in part):
        matrix[one, two], matrix[two, one] = coefficients, coefficients.T
    check_correlation(f"correlation of {', '.join(names)}", matrix)
    return Mixing(tuple(names), tuple(axes), matrix)


def check_correlation(where: str, matrix: np.ndarray) -> None:
    """Refuse a matrix that is no correlation matrix.

    Raises:
        ExperimentError: not symmetric, not one on the diagonal, or with a negative eigenvalue.
    """
    if not (np.allclose(matrix, matrix.T, rtol=0, atol=1e-12) and np.allclose(np.diag(matrix), 1, rtol=0, atol=1e-12)):
        raise ExperimentError(f"{where} is no correlation matrix: write ones on the diagonal, equal values across it")
    if np.linalg.eigvalsh(matrix)[0] < -1e-9:
        raise ExperimentError(f"{where} is impossible: no variables are correlated so; write smaller coefficients")
