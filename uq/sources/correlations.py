"""``[[correlation]]`` of an experiment file, and the sets of sources that it correlates."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from rig.exceptions import quoted
from rig.toml_tables import TomlTable, written
from uq.files.mistakes import ExperimentError
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing
from uq.sources.source import Source


class Link(NamedTuple):
    """A correlation between the numbers that two sources draw, from a ``[[correlation]]``."""

    names: tuple[str, str]
    coefficients: np.ndarray


def _two_names(_: str, raw: Any) -> tuple[str, str]:
    if not isinstance(raw, list) or len(raw) != 2 or not all(isinstance(name, str) for name in raw):
        raise ValueError(f"is {quoted(raw)}: name two of [[source]]")
    return raw[0], raw[1]


TWO_NAMES = {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}


class LinkTable(TomlTable, frozen=True, kw_only=True):
    """``[[correlation]]``: a correlation between the numbers that two sources draw."""

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
        raise ExperimentError(f"{where}.sources is {quoted(written_names)}: name two different ones of [[source]]")
    first, second = (sources[name] for name in names)
    for source in (first, second):
        check_correlated(f"{where}.sources", source)
    if first.constant != second.constant:
        raise ExperimentError(f"{where}.sources: one is drawn at each sample, the other once; leave it out")
    sizes = np.size(first.sigma), np.size(second.sigma)
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


def mixing_of(
    sources: Sequence[Source], of_axes: Mapping[str, np.ndarray], links: Sequence[Link]
) -> tuple[Mixing, ...]:
    """Return the sets of sources that are correlated, each with its correlation matrix.

    Args:
        sources: all of them.
        of_axes: correlation matrices of a source's own axes, by its name.
        links: correlations between two sources.

    Raises:
        ExperimentError: coefficients that no joint distribution has.
    """
    sets: list[set[str]] = [{name} for name in of_axes]
    for link in links:
        linked = [names for names in sets if names & set(link.names)]
        sets = [names for names in sets if names not in linked] + [set(link.names).union(*linked)]
    return tuple(_mixing([source for source in sources if source.name in names], of_axes, links) for names in sets)


def _mixing(members: Sequence[Source], of_axes: Mapping[str, np.ndarray], links: Sequence[Link]) -> Mixing:
    names, axes = zip(*((source.name, int(np.size(source.sigma))) for source in members), strict=True)
    matrix = np.eye(sum(axes))
    mixing = Mixing(names, axes, matrix)
    places = mixing.places
    for name in of_axes.keys() & places.keys():
        matrix[places[name], places[name]] = of_axes[name]
    for rows, columns, coefficients in ((places[a], places[b], c) for (a, b), c in links if a in places):
        matrix[rows, columns], matrix[columns, rows] = coefficients, coefficients.T
    check_correlation(f"correlation of {', '.join(names)}", matrix)
    return mixing


def check_correlation(where: str, matrix: np.ndarray) -> None:
    """Refuse a matrix that is no correlation matrix.

    Raises:
        ExperimentError: not symmetric, not one on the diagonal, or with a negative eigenvalue.
    """
    if not (np.allclose(matrix, matrix.T, rtol=0, atol=1e-12) and np.allclose(np.diag(matrix), 1, rtol=0, atol=1e-12)):
        raise ExperimentError(f"{where} is no correlation matrix: write ones on the diagonal, equal values across it")
    if np.linalg.eigvalsh(matrix)[0] < -1e-9:
        raise ExperimentError(f"{where} is impossible: no variables are correlated so; write smaller coefficients")
