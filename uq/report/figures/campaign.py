"""The figure of a campaign's breakdown: 3σ and mean error of each component, by group and by source.

A dispersion never stands alone: the mean error has its own panel, on its own scale.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.markers import TICKDOWN
from matplotlib.ticker import FuncFormatter, MaxNLocator

from identify.display.rounding import significant
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.monte_carlo.campaign.statistics import OfCase
from uq.report.figures.style import (
    COLUMN,
    GRID,
    LINES,
    PAGE,
    PALETTE,
    RULE,
    display_name,
    label,
    legend_above,
    new_figure,
)

BESIDE = 5
"""Cases whose bars stand side by side; more have a line each."""
WIDTH = 0.8
"""Width of a component's column, over the distance of two."""
MARKER = 2.6**2
"""Size of a mean error's marker [pt²]."""
ERROR_BAR: dict[str, Any] = {"fmt": "none", "ecolor": "black", "elinewidth": 0.6, "capsize": 1.2, "capthick": 0.6}
LABELS = 8
"""Most characters of a column's labels; of more, only zero and the outermost are written."""


def contributions(cases: Mapping[str, OfCase], groups: Collection[str] = ()) -> FigureBase:
    """Draw what each case does to each component: the paper's figure 3, with the mean error in a second panel.

    Error bars are standard errors. A mean error that exceeds its own 3σ is written beside its marker when it belongs
    to the first case. The mean errors are on a symmetric logarithmic scale when one exceeds every 3σ. More than
    ``BESIDE`` cases have a line each: below the first the groups, then the sources, the largest first.

    Args:
        cases: statistics by name: a breakdown's ``cases``, or its ``groups`` alone.
        groups: names of the cases that are groups, where others are sources.
    """
    if len(cases) > BESIDE:
        return _line_by_line(cases, groups)
    figure = new_figure(PAGE if len(cases) > 4 else COLUMN, 3.6, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    width = 0.84 / max(len(cases), 1)
    x = np.arange(len(COMPONENTS)) + (np.arange(len(cases))[:, None] - (len(cases) - 1) / 2) * width
    sigma, sigma_error, mean, mean_error = _in_gram_metre(cases.values())
    for name, colour, place, heights in zip(cases, PALETTE, x, sigma, strict=False):
        top.bar(place, heights, 0.92 * width, color=colour, label=label(display_name(name)), linewidth=0)
    top.errorbar(x.ravel(), sigma.ravel(), sigma_error.ravel(), **ERROR_BAR)
    colours = np.repeat(PALETTE[: len(cases)], len(COMPONENTS))
    bottom.vlines(x, mean - mean_error, mean + mean_error, colours, linewidth=0.7)
    bottom.scatter(x, mean, MARKER, colours, zorder=3)
    finish_dispersion(top)
    _finish_mean_error(bottom, cases)
    bottom.set_xticks(range(len(COMPONENTS)), COMPONENTS)
    edges = np.arange(len(COMPONENTS) - 1) + 0.5
    bottom.vlines(edges, 0, 1, GRID, linewidth=0.5, zorder=0, transform=bottom.get_xaxis_transform())
    legend_above(figure)
    figure.align_ylabels()
    return figure


def _line_by_line(cases: Mapping[str, OfCase], groups: Collection[str]) -> FigureBase:
    """A column for each component, 3σ above and mean error below; a line for each group and the largest sources."""
    first, *others = cases
    size = {
        name: float(np.mean(np.nan_to_num(np.hypot(cases[name].three_sigma, 3 * cases[name].mean_error))))
        for name in others
    }
    largest_first = sorted(others, key=lambda name: -size[name])
    shown_groups = [name for name in largest_first if name in groups]
    sources = [name for name in largest_first if name not in groups][:LINES]
    names = [first, *shown_groups, *sources]
    colours = [PALETTE[0], *[PALETTE[2]] * len(shown_groups), *[PALETTE[1]] * len(sources)]
    sigma, sigma_error, mean, mean_error = _in_gram_metre(cases[name] for name in names)
    highest = np.nanmax(sigma, initial=0)
    beyond = np.nanmax(np.abs(mean), initial=0) > highest
    y = np.arange(len(names))[:, None]
    figure = new_figure(PAGE, 1.2 + 0.24 * len(names), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharey=True)
    place = _columns(top, [sigma + sigma_error], (0.0, 0.05))
    for k, (start, end) in enumerate(zip(place(0 * sigma), place(sigma), strict=True)):
        top.broken_barh(list(zip(start, end - start, strict=True)), (k - 0.35, 0.7), facecolor=colours[k])
    top.hlines(y + 0 * sigma, place(sigma - sigma_error), place(sigma + sigma_error), color="black", linewidth=0.8)
    for k, name in enumerate(COMPONENTS):
        top.text(k + WIDTH / 2, 1.05, name, ha="center", transform=top.get_xaxis_transform())
    ends = mean - mean_error, mean + mean_error
    decade = 10.0 ** np.floor(np.log10(highest or 1))
    place = _columns(bottom, ends, (0.15, 0.15), decade if beyond else np.inf)
    bottom.vlines(place(0), 0, 1, color=RULE, linewidth=0.6, transform=bottom.get_xaxis_transform())
    bottom.hlines(y + 0 * mean, *map(place, ends), color="black", linewidth=0.8)
    bottom.scatter(place(mean), y + 0 * mean, MARKER, np.repeat(colours, len(COMPONENTS)), zorder=3)
    top.set_yticks(y[:, 0], [label(display_name(name)) for name in names])
    top.set_ylim(len(names) - 0.5, -0.5)
    top.set_xlabel("3σ [g·m²]")
    bottom.set_xlabel("mean error [g·m²]" + (f", logarithmic beyond ±{decade:g}" if beyond else ""))
    return figure


def _columns(
    axes: Axes, values: Sequence[np.ndarray], margins: tuple[float, float], linear: float = np.inf
) -> Callable[[Any], np.ndarray]:
    """Draw the axes of all components side by side in one, in a fraction of the time that one each takes.

    Args:
        axes: empty.
        values: that the columns, which are alike, must hold beside zero.
        margins: below and above them, over their range.
        linear: magnitude from which the scale is logarithmic.

    Returns:
        Where values stand in the axes, the last dimension being the components.
    """

    def scale(values: Any) -> Any:
        return np.arcsinh(np.asarray(values) / linear) if np.isfinite(linear) else np.asarray(values)

    def place(values: Any) -> np.ndarray:
        return begins + WIDTH * (scale(values) - low) / (high - low)

    begins = np.arange(len(COMPONENTS))
    numbers = np.nan_to_num(values)
    low, high = scale([np.min(numbers, initial=0), np.max(numbers, initial=0)])
    high += low == high
    low, high = low - margins[0] * (high - low), high + margins[1] * (high - low)
    decades = linear * 10.0 ** np.arange(9)
    ticks = np.array([*-decades[::-1], 0, *decades]) if np.isfinite(linear) else MaxNLocator(3).tick_values(low, high)
    ticks = ticks[(low <= scale(ticks)) & (scale(ticks) <= high)]
    texts = [f"{tick:g}".replace("-", "−") for tick in ticks]
    named = texts if len("".join(texts)) <= LABELS else ["0", texts[np.argmax(np.abs(ticks))]]
    marks, across = place(ticks[:, None]), axes.get_xaxis_transform()
    for text, row in zip(texts, marks, strict=True):
        for k, x in enumerate(row) if text in named else ():
            shown = axes.annotate(text, (x, 0), (0, -7), across, "offset points", ha="center", va="top")
            shown.set_in_layout(k == len(row) - 1)  # the others need no room beside the axes
    axes.vlines(marks, 0, 1, color=GRID, linewidth=0.5, transform=across, zorder=0.5)
    style: dict[str, Any] = {"color": "black", "linewidth": 0.6, "clip_on": False, "transform": across}
    for x in marks:
        axes.plot(x, 0 * x, linestyle="none", marker=TICKDOWN, markersize=3.5, markeredgewidth=0.6, **style)
    for x in begins:
        axes.plot([x, x, x + WIDTH], [1, 0, 0], **style)
    axes.set_xticks([])
    axes.set_xlim(0, len(COMPONENTS) - 1 + WIDTH)
    axes.tick_params(axis="y", left=False)
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.xaxis.labelpad = 20
    return place


def _in_gram_metre(cases: Iterable[OfCase]) -> np.ndarray:
    """3σ, its standard error, mean error and its standard error of all components, (4, cases, 6) [g·m²]."""
    names = "three_sigma", "three_sigma_standard_error", "mean_error", "mean_error_standard_error"
    return GRAM_METRE * np.stack([[getattr(s, name) for name in names] for s in cases], axis=1)


def finish_dispersion(axes: Axes) -> None:
    """Label a panel of 3σ."""
    axes.set_ylabel("3σ [g·m²]")
    axes.set_ylim(bottom=0)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color=GRID, linewidth=0.5)


def _finish_mean_error(axes: Axes, cases: Mapping[str, OfCase]) -> None:
    axes.axhline(0, color=RULE, linewidth=0.6, zorder=1)
    axes.set_ylabel("mean error [g·m²]")
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    means = np.abs([s.mean_error for s in cases.values()])
    dispersions = np.array([s.three_sigma for s in cases.values()])
    if np.nanmax(means, initial=0) > np.nanmax(dispersions, initial=0):
        axes.set_yscale("symlog", linthresh=1, linscale=0.7)
        axes.set_ylabel("mean error [g·m²]\nlogarithmic beyond ±1")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    axes.margins(y=0.15)
    _name_excess(axes, cases)


def _name_excess(axes: Axes, cases: Mapping[str, OfCase]) -> None:
    """Write the mean errors of the first case that exceed their 3σ."""
    for s in list(cases.values())[:1]:
        for k in np.flatnonzero(np.abs(s.mean_error) > s.three_sigma):
            value = GRAM_METRE * s.mean_error[k]
            axes.annotate(significant(value), (k, value), (0, 3), textcoords="offset points", ha="center")
