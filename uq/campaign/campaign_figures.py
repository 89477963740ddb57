"""The figure of a campaign's breakdown: 3σ and mean error of each component, by group or by source.

A dispersion never stands alone: the mean error has its own panel, on its own scale.
"""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from identify.figure_style import COLUMN, GRID, HATCHES, PAGE, PALETTE, RULE, STYLE, display_name, label
from identify.rigid_body.inertia import COMPONENTS
from uq.campaign.statistics import GRAM_METRE, Statistics


def contributions(cases: Mapping[str, Statistics]) -> Figure:
    """Draw what each case does to each component: the source's figure 3, with the mean error in a second panel.

    Error bars are standard errors. A mean error that exceeds its own 3σ is written beside its marker when it belongs
    to the first case. The mean errors are on a symmetric logarithmic scale when one exceeds every 3σ.

    Args:
        cases: statistics by name; a breakdown's ``groups``, or its ``sources``, or both.
    """
    wide = len(cases) > 4
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE if wide else COLUMN, 3.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        width = 0.84 / max(len(cases), 1)
        for k, (name, s) in enumerate(cases.items()):
            x = np.arange(len(COMPONENTS)) + (k - (len(cases) - 1) / 2) * width
            colour, hatch = PALETTE[k % len(PALETTE)], HATCHES[k // len(PALETTE) % len(HATCHES)]
            bars(top, x, s.three_sigma, s.three_sigma_standard_error, width, colour, label(display_name(name)), hatch)
            _marks(bottom, x, s.mean_error, s.mean_error_standard_error, colour)
        finish_dispersion(top)
        _finish_mean_error(bottom, cases)
        bottom.set_xticks(range(len(COMPONENTS)), COMPONENTS)
        for edge in np.arange(len(COMPONENTS) - 1) + 0.5:
            bottom.axvline(edge, color=GRID, linewidth=0.5, zorder=0)
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=8 if wide else 4)
        figure.align_ylabels()
    return figure


def bars(
    axes: Axes,
    x: np.ndarray,
    values: np.ndarray,
    errors: np.ndarray,
    width: float,
    colour: str,
    label: str,
    hatch: str = "",
) -> None:
    """Draw bars with their standard errors, in g·m²."""
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.bar(x, values, 0.92 * width, color=colour, label=label, hatch=hatch, edgecolor="white", linewidth=0)
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
            axes.annotate(f"{value:.3g}".replace("-", "−"), (k, value), (0, 3), textcoords="offset points", ha="center")
