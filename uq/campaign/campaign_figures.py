"""The figure of a campaign's breakdown: 3σ and mean error of each component, by group or by source.

A dispersion never stands alone: the mean error has its own panel, on its own scale.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

from identify.figure_style import (
    COLUMN,
    GRID,
    LINES,
    PAGE,
    PALETTE,
    RULE,
    STYLE,
    columns,
    display_name,
    label,
    new_figure,
    width_of,
)
from identify.rigid_body.inertia import COMPONENTS
from identify.rounding import significant
from uq.campaign.statistics import GRAM_METRE, Statistics

BESIDE = 5
"""Cases whose bars stand side by side; more have a line each."""


def contributions(cases: Mapping[str, Statistics]) -> FigureBase:
    """Draw what each case does to each component: the source's figure 3, with the mean error in a second panel.

    Error bars are standard errors. A mean error that exceeds its own 3σ is written beside its marker when it belongs
    to the first case. The mean errors are on a symmetric logarithmic scale when one exceeds every 3σ. More than
    ``BESIDE`` cases have a line each, the largest below the first.

    Args:
        cases: statistics by name; a breakdown's ``groups``, or its ``sources``, or both.
    """
    if len(cases) > BESIDE:
        return _line_by_line(cases)
    with matplotlib.rc_context(STYLE):
        figure = new_figure(PAGE if len(cases) > 4 else COLUMN, 3.6, layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        width = 0.84 / max(len(cases), 1)
        for k, (name, s) in enumerate(cases.items()):
            x = np.arange(len(COMPONENTS)) + (k - (len(cases) - 1) / 2) * width
            colour = PALETTE[k]
            bars(top, x, s.three_sigma, s.three_sigma_standard_error, width, colour, label(display_name(name)))
            _marks(bottom, x, s.mean_error, s.mean_error_standard_error, colour)
        finish_dispersion(top)
        _finish_mean_error(bottom, cases)
        bottom.set_xticks(range(len(COMPONENTS)), COMPONENTS)
        for edge in np.arange(len(COMPONENTS) - 1) + 0.5:
            bottom.axvline(edge, color=GRID, linewidth=0.5, zorder=0)
        number = columns(list(map(display_name, cases)), width_of(figure))
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=number)
        figure.align_ylabels()
    return figure


def _line_by_line(cases: Mapping[str, Statistics]) -> FigureBase:
    """A panel for each component, 3σ above and mean error below; a line for each case, the largest first."""
    first, *others = cases
    size = {
        name: float(np.mean(np.nan_to_num(np.hypot(cases[name].three_sigma, 3 * cases[name].mean_error))))
        for name in others
    }
    names = [first, *sorted(others, key=lambda name: -size[name])[:LINES]]
    shown = [cases[name] for name in names]
    with matplotlib.rc_context(STYLE):
        figure = new_figure(PAGE, 1.1 + 0.3 * len(names), layout="constrained")
        panels = figure.subplots(2, len(COMPONENTS), sharex="row", sharey=True)
        y = np.arange(len(names))
        for k, (top, bottom) in enumerate(panels.T):
            sigma, sigma_error, mean, mean_error = (
                GRAM_METRE * np.array([getattr(s, name)[k] for s in shown])
                for name in ("three_sigma", "three_sigma_standard_error", "mean_error", "mean_error_standard_error")
            )
            top.barh(y, sigma, 0.7, color=[PALETTE[0], *[PALETTE[1]] * (len(names) - 1)])
            style: dict[str, Any] = {"ecolor": "black", "elinewidth": 0.8}
            top.errorbar(sigma, y, xerr=sigma_error, fmt="none", **style)
            bottom.axvline(0, color=RULE, linewidth=0.6, zorder=1)
            bottom.errorbar(mean, y, xerr=mean_error, fmt="o", markersize=2.6, color=PALETTE[1], **style)
            bottom.plot(mean[:1], y[:1], "o", markersize=2.6, color=PALETTE[0], zorder=3)
            top.set_title(COMPONENTS[k])
            for axes in (top, bottom):
                axes.tick_params(axis="y", left=False)
                axes.grid(axis="x", color=GRID, linewidth=0.5)
        panels[0, 0].set_yticks(y, [label(display_name(name)) for name in names])
        panels[0, 0].invert_yaxis()
        panels[0, 0].set_xlim(left=0)
        panels[0, 0].xaxis.set_major_locator(MaxNLocator(3))
        panels[1, 0].margins(x=0.15)
        _scale_mean_errors(panels[1, 0], shown)
        panels[0, 2].set_xlabel("3σ [g·m²]", x=1.0)
        panels[1, 2].set_xlabel("mean error [g·m²]", x=1.0)
    return figure


def _scale_mean_errors(axes: Axes, cases: Sequence[Statistics]) -> None:
    """A logarithmic scale about nought, with the outermost decades named, where a mean error exceeds every 3σ."""
    mean = GRAM_METRE * np.array([s.mean_error for s in cases])
    if np.nanmax(np.abs(mean), initial=0) <= GRAM_METRE * np.max(
        np.nan_to_num([s.three_sigma for s in cases]), initial=0
    ):
        axes.xaxis.set_major_locator(MaxNLocator(3))
        return
    axes.set_xscale("symlog", linthresh=1, linscale=0.7)
    decades = [10.0**k for k in range(9)]
    below, above = ([x for x in decades if x <= 3 * np.nanmax(side, initial=0)] for side in (-mean, mean))
    axes.set_xticks([*(-x for x in below[-1:]), 0, *above[-1:]])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    axes.xaxis.set_minor_locator(NullLocator())


def bars(
    axes: Axes, x: np.ndarray, values: np.ndarray, errors: np.ndarray, width: float, colour: str, label: str
) -> None:
    """Draw bars with their standard errors, in g·m²."""
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.bar(x, values, 0.92 * width, color=colour, label=label, linewidth=0)
    axes.errorbar(x, values, errors, fmt="none", ecolor="black", elinewidth=0.6, capsize=1.2, capthick=0.6)


def _marks(axes: Axes, x: np.ndarray, values: np.ndarray, errors: np.ndarray, colour: str) -> None:
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.errorbar(x, values, errors, fmt="o", markersize=2.6, color=colour, elinewidth=0.7, capsize=1.4, capthick=0.6)


def finish_dispersion(axes: Axes) -> None:
    """Label a panel of 3σ."""
    axes.set_ylabel("3σ [g·m²]")
    axes.set_ylim(bottom=0)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color=GRID, linewidth=0.5)


def _finish_mean_error(axes: Axes, cases: Mapping[str, Statistics]) -> None:
    axes.axhline(0, color=RULE, linewidth=0.6, zorder=1)
    axes.set_ylabel("mean error [g·m²]")
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    means = np.abs([s.mean_error for s in cases.values()])
    dispersions = np.array([s.three_sigma for s in cases.values()])
    if np.nanmax(means, initial=0) > np.nanmax(dispersions, initial=0):
        axes.set_yscale("symlog", linthresh=1, linscale=0.7)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    axes.margins(y=0.15)
    _name_excess(axes, cases)


def _name_excess(axes: Axes, cases: Mapping[str, Statistics]) -> None:
    """Write the mean errors of the first case that exceed their 3σ."""
    for s in list(cases.values())[:1]:
        for k in np.flatnonzero(np.abs(s.mean_error) > s.three_sigma):
            value = GRAM_METRE * s.mean_error[k]
            axes.annotate(significant(value), (k, value), (0, 3), textcoords="offset points", ha="center")
