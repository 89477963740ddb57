"""How a source's draw is distributed: from the keys of its ``[[source]]`` to scale, mean and shape."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uq.files.document import REQUIRED, ExperimentError, Table
from uq.files.units import UnitError
from uq.sources.datasheet import datasheet
from uq.sources.distributions import Distribution, Empirical, Normal, Rectangular, StudentT, Triangular, UShaped
from uq.sources.source_figures import Figures, not_negative

BOUNDED: dict[str, tuple[Callable[..., Distribution], float]] = {
    "rectangular": (Rectangular, np.sqrt(3)),
    "triangular": (Triangular, np.sqrt(6)),
    "u_shaped": (UShaped, np.sqrt(2)),
}
"""Distributions between limits, and their half-width over their standard deviation."""
DISTRIBUTIONS = ("normal", *BOUNDED, "student_t", "samples")
WIDTHS = ("sigma", "half_width", "scale", "datasheet", "samples")
MOST_ROWS = 100_000
"""Rows of a file of samples."""


class Width(NamedTuple):
    """How a source's draw is distributed: ``mean + sigma * shape``."""

    sigma: np.ndarray
    mean: np.ndarray
    shape: Distribution


def width_of(table: Table, figures: Figures, folder: Path, *, centred: bool) -> Width:
    """Return the distribution of a source that is drawn.

    Args:
        table: its ``[[source]]``.
        figures: reads its figures.
        folder: where files of samples are.
        centred: whether it has no mean, as noise.

    Raises:
        ExperimentError: a mistake in the keys, or in a file of samples.
    """
    given = [key for key in WIDTHS if key in table.content]
    if len(given) > 1:
        raise ExperimentError(f"{table.path(given[0])} and {given[1]} both state the width: leave one out")
    by_key = {"datasheet": _from_datasheet, "samples": _from_samples}
    build = by_key.get(given[0] if given else "", _from_keys)
    width = build(table, figures, folder)
    mean = np.zeros(figures.shape) if centred else width.mean + figures.read("mean", np.zeros(figures.shape))
    return Width(np.asarray(width.sigma), np.asarray(mean), width.shape)


def _from_keys(table: Table, figures: Figures, _: Path) -> Width:
    distribution = table.choice("distribution", DISTRIBUTIONS, "normal")
    if distribution == "samples":
        raise ExperimentError(f"missing key {table.path('samples')}: name the file")
    nu = _freedom(table, REQUIRED if distribution == "student_t" else np.array(np.inf))
    key, ratio = "sigma", 1.0
    shape: Distribution = Normal(0.0, 1.0, nu)
    if distribution == "student_t":
        key, shape = "scale", StudentT(0.0, 1.0, nu)
    elif distribution != "normal":
        build, ratio = BOUNDED[distribution]
        shape = build(-ratio, ratio, nu)
        key, ratio = ("half_width", ratio) if "half_width" in table.content else ("sigma", 1.0)
    return Width(not_negative(table, key, figures.read(key)) / ratio, np.zeros(figures.shape), shape)


def _freedom(table: Table, default: object) -> float:
    freedom = float(table.numbers("degrees_of_freedom", (), default))
    if freedom <= 0:
        raise ExperimentError(f"{table.path('degrees_of_freedom')} is {freedom:g}: write more than zero")
    return freedom


def _from_datasheet(table: Table, figures: Figures, _: Path) -> Width:
    """One statement for all axes, or one for each."""
    for key in ("distribution", "degrees_of_freedom"):
        if key in table.content:
            raise ExperimentError(f"{table.path(key)} is said by the datasheet's figure: leave it out")
    raw, wholes = table.raw("datasheet"), figures.wholes()
    texts = raw if isinstance(raw, list) else [raw] * len(wholes)
    if len(texts) != len(wholes):
        raise ExperimentError(f"{table.path('datasheet')} is {raw!r}: write one statement, or one for each axis")
    reading = 100.0 if figures.unit == "%" else None
    try:
        found = [datasheet(t, figures.unit, full_scale=w, reading=reading) for t, w in zip(texts, wholes, strict=True)]
    except UnitError as error:
        raise ExperimentError(f"{table.path('datasheet')} {error}") from None
    scales, shapes = zip(*map(_standard, found), strict=True)
    if len({(type(shape), float(shape.degrees_of_freedom)) for shape in shapes}) > 1:
        raise ExperimentError(f"{table.path('datasheet')} states several distributions: write a source for each")
    return Width(figures.placed(np.array(scales)), np.zeros(figures.shape), shapes[0])


def _standard(distribution: Distribution) -> tuple[float, Distribution]:
    """Scale and shape of a distribution about zero."""
    if isinstance(distribution, StudentT):
        return float(distribution.scale), StudentT(0.0, 1.0, distribution.degrees_of_freedom)
    sigma = float(distribution.standard_deviation)
    for build, ratio in BOUNDED.values():
        if type(distribution) is build:
            return sigma, build(-ratio, ratio)
    return sigma, Normal(0.0, 1.0)


def _from_samples(table: Table, figures: Figures, folder: Path) -> Width:
    if table.choice("distribution", DISTRIBUTIONS) != "samples":
        raise ExperimentError(f'{table.path("distribution")} is not "samples" but samples are given: leave one out')
    rows = _read_samples(table, folder)
    axes = int(np.prod(figures.shape))
    if rows.shape[1] not in (1, axes):
        raise ExperimentError(f"{table.path('samples')} has {rows.shape[1]} columns: give 1, or {axes}, one an axis")
    rows = rows * figures.scale_of(table.typed("unit", str))
    mean, sigma = rows.mean(axis=0), rows.std(axis=0)
    standard = (rows - mean) / np.where(sigma > 0, sigma, 1)
    shape = Empirical(standard if standard.shape[1] > 1 else standard[:, 0])
    sigma, mean = (np.broadcast_to(value, axes).reshape(figures.shape).copy() for value in (sigma, mean))
    return Width(sigma, mean, shape)


def _read_samples(table: Table, folder: Path) -> np.ndarray:
    name = table.typed("samples", str)
    where = f"{table.path('samples')} is {name!r}"
    try:
        text = (folder / name).read_text("utf-8")
    except (OSError, UnicodeDecodeError, ValueError):
        raise ExperimentError(f"{where}: not a readable file beside the experiment; correct the name") from None
    lines = [line.split("#")[0].replace(",", " ").split() for line in text.splitlines()]
    try:
        rows = np.array([[float(item) for item in line] for line in lines if line])
    except ValueError:
        raise ExperimentError(f"{where}: write numbers, the same count in every line") from None
    if rows.ndim != 2 or not 2 <= len(rows) <= MOST_ROWS or not np.isfinite(rows).all():
        raise ExperimentError(f"{where}: give 2 to {MOST_ROWS:,} lines of finite numbers")
    return rows
