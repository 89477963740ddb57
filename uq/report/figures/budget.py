"""Figures of a budget: who causes how much of the variance, and how much of the mean square is bias."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from uq.analysis.sensitivity.budget_shares import COLUMNS, SourceBudget
from uq.report.figures.style import (
    FILL,
    GRID,
    PAGE,
    PALETTE,
    coloured_parts,
    label,
    largest,
    legend_over,
    new_figure,
    on,
    stacked,
)

BIAS, DISPERSION = PALETTE[0], FILL


def shares(b: SourceBudget) -> FigureBase:
    """Draw one budget: Shapley shares of every component, of the tensor with first order and total, and the bias.

    Error bars are standard errors. The third panel splits the mean squared error into bias and dispersion.

    Args:
        b: the budget of one estimator on one trajectory.
    """
    figure = new_figure(PAGE, 4.2, layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(3, 2), height_ratios=(5, 2))
    top, bottom = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    _stacks(top, b)
    _split(bottom, b)
    right = figure.add_subplot(grid[:, 1])
    _tensor(right, b)
    figure.align_ylabels([top, bottom])
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _stacks(axes: Axes, b: SourceBudget) -> None:
    """Shapley shares of each component and of the tensor, stacked; the bars' places are COLUMNS'."""
    shapley = b.sources.shapley
    values = 100 * np.column_stack([shapley.value, shapley.generalised])
    x, base = np.arange(len(COLUMNS)), np.zeros(len(COLUMNS))
    for _, colour, heights in coloured_parts(b.sources.players, values):
        axes.bar(x, heights, 0.8, bottom=base, color=colour, edgecolor="white", linewidth=0.3)
        for place, (value, below) in enumerate(zip(heights, base, strict=True)):
            if value > 9:
                at = (place, below + value / 2)
                axes.text(*at, f"{value:.0f}", ha="center", va="center", color=on(colour), fontsize=7)
        base = base + heights
    axes.set(ylim=(0, 100), ylabel="Shapley share of the variance [%]", title="sources of the dispersion")
    _name_columns(axes)


def _name_columns(axes: Axes) -> None:
    axes.set_xticks(range(len(COLUMNS)), COLUMNS)
    axes.tick_params(axis="x", bottom=False)


def _split(axes: Axes, b: SourceBudget) -> None:
    """The mean squared error: bias and dispersion."""
    m = b.mean_square
    bias = 100 * np.clip([*m.bias_share, m.tensor_bias_share], 0, 1)
    x = np.arange(len(COLUMNS))
    axes.bar(x, bias, 0.8, color=BIAS, label="bias")
    axes.bar(x, 100 - bias, 0.8, bottom=bias, color=DISPERSION, label="dispersion")
    axes.set(ylim=(0, 100), ylabel="share of the\nmean square [%]")
    _name_columns(axes)


def _tensor(axes: Axes, b: SourceBudget) -> None:
    """The whole tensor: each source's Shapley share as a bar between its first order and its total."""
    e, tensor_shares = b.sources, 100 * b.sources.shapley.generalised
    shapley = 100 * np.column_stack([e.shapley.value, e.shapley.generalised])
    parts, (shown, _) = coloured_parts(e.players, shapley), largest(e.players, shapley.max(axis=1).tolist())
    for k, (_, colour, shares_of) in enumerate(parts):
        axes.barh(k, shares_of[-1], 0.62, color=colour, edgecolor="white", linewidth=0.3)
    y = np.arange(len(shown))
    values, errors = tensor_shares[shown], 100 * e.shapley.generalised_standard_error[shown]
    axes.errorbar(
        values, y, xerr=errors, fmt="none", ecolor="black", elinewidth=0.7, capsize=1.6,
        label="Shapley ± standard error",
    )  # fmt: skip
    axes.plot(100 * e.first.generalised[shown], y - 0.22, "|", color="black", markersize=5, label="first order")
    axes.plot(100 * e.total.generalised[shown], y + 0.22, "ko", markersize=3, markerfacecolor="white", label="total")
    axes.set_yticks(range(len(parts)), [name for name, *_ in parts])
    axes.tick_params(axis="y", left=False)
    axes.invert_yaxis()
    axes.set(xlabel="share of the tensor's variance [%]", title="the whole tensor")
    axes.set_xlim(left=min(0, float(np.nanmin(100 * e.first.generalised, initial=0))))
    axes.grid(axis="x", color=GRID, linewidth=0.5)


def overview(budgets: Mapping[tuple[str, str], SourceBudget]) -> FigureBase:
    """Draw the whole tensor of every trajectory and estimator: Shapley shares, and how much of the error is bias."""
    pairs = list(budgets)
    figure = new_figure(PAGE, 1.2 + 0.24 * len(pairs), layout="constrained")
    shapley, squares = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    shares_of = 100 * np.column_stack([budgets[pair].sources.shapley.generalised for pair in pairs])
    stacked(shapley, coloured_parts(budgets[pairs[0]].sources.players, shares_of), 0.7)
    bias = 100 * np.clip([budgets[pair].mean_square.tensor_bias_share for pair in pairs], 0, 1)
    squares.barh(range(len(pairs)), bias, 0.7, color=BIAS, label="bias")
    squares.barh(range(len(pairs)), 100 - bias, 0.7, left=bias, color=DISPERSION, label="dispersion")
    shapley.set_yticks(range(len(pairs)), [label(", ".join(pair)) for pair in pairs])
    shapley.invert_yaxis()
    shapley.set(xlim=(0, 100), xlabel="Shapley share of the tensor's variance [%]")
    squares.set(xlim=(0, 100), xlabel="share of the mean square [%]")
    for axes, width in ((shapley, 0.55 * PAGE), (squares, 0.35 * PAGE)):
        axes.tick_params(axis="y", left=False)
        legend_over(axes, width)
    return figure
