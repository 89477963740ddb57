"""Figures of a budget: who causes how much of the variance, and how much of the mean square is bias."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identify.figure_style import FILL, GRID, HATCHES, PAGE, PALETTE, STYLE, display_name, label
from uq.sensitivity.budget_shares import COLUMNS, SourceBudget

BIAS, DISPERSION = PALETTE[0], FILL


def shares(b: SourceBudget) -> Figure:
    """Draw one budget: Shapley shares of every component, of the tensor with first order and total, and the bias.

    Error bars are standard errors. The third panel splits the mean squared error into bias and dispersion.

    Args:
        b: the budget of one estimator on one trajectory.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 4.2), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(3, 2), height_ratios=(5, 2))
        top, bottom = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        _stacks(top, b)
        _split(bottom, b)
        _tensor(figure.add_subplot(grid[:, 1]), b)
        figure.align_ylabels([top, bottom])
    return figure


def _colour(k: int) -> tuple[str, str]:
    return PALETTE[1:][k % (len(PALETTE) - 1)], HATCHES[k // (len(PALETTE) - 1) % len(HATCHES)]


def _stacks(axes: Axes, b: SourceBudget) -> None:
    """Shapley shares of each component and of the tensor, stacked; the bars' places are COLUMNS'."""
    shapley = b.sources.shapley
    values = 100 * np.column_stack([shapley.value, shapley.generalised])
    x, base = np.arange(len(COLUMNS)), np.zeros(len(COLUMNS))
    for k in range(len(b.sources.players)):
        colour, hatch = _colour(k)
        axes.bar(x, values[k], 0.8, bottom=base, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3)
        for place, (value, below) in enumerate(zip(values[k], base, strict=True)):
            if value > 9:
                axes.text(place, below + value / 2, f"{value:.0f}", ha="center", va="center", color="white", fontsize=7)
        base = base + values[k]
    axes.set(ylim=(0, 100), ylabel="Shapley share of the variance [%]", title="who causes the dispersion")
    axes.set_xticks(x, COLUMNS)
    axes.tick_params(axis="x", length=0)


def _split(axes: Axes, b: SourceBudget) -> None:
    """The mean squared error: bias and dispersion."""
    m = b.mean_square
    bias = 100 * np.clip([*m.bias_share, m.tensor_bias_share], 0, 1)
    x = np.arange(len(COLUMNS))
    axes.bar(x, bias, 0.8, color=BIAS, label="bias")
    axes.bar(x, 100 - bias, 0.8, bottom=bias, color=DISPERSION, label="dispersion")
    axes.set(ylim=(0, 100), ylabel="share of the\nmean square [%]")
    axes.set_xticks(x, COLUMNS)
    axes.tick_params(axis="x", length=0)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)


def _tensor(axes: Axes, b: SourceBudget) -> None:
    """The whole tensor: each source's Shapley share as a bar between its first order and its total."""
    e, y = b.sources, np.arange(len(b.sources.players))
    for k in range(len(y)):
        colour, hatch = _colour(k)
        axes.barh(k, 100 * e.shapley.generalised[k], 0.62, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3)
    values, errors = 100 * e.shapley.generalised, 100 * e.shapley.generalised_standard_error
    axes.errorbar(
        values,
        y,
        xerr=errors,
        fmt="none",
        ecolor="black",
        elinewidth=0.7,
        capsize=1.6,
        label="Shapley ± standard error",
    )
    axes.plot(100 * e.first.generalised, y - 0.22, "|", color="black", markersize=5, label="first order")
    axes.plot(100 * e.total.generalised, y + 0.22, "ko", markersize=3, markerfacecolor="white", label="total")
    axes.set_yticks(y, [label(display_name(name)) for name in e.players])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set(xlabel="share of the tensor's variance [%]", title="the whole tensor")
    axes.set_xlim(left=min(0, float(np.nanmin(100 * e.first.generalised, initial=0))))
    axes.grid(axis="x", color=GRID, linewidth=0.5)
    axes.legend(loc="lower right")


def overview(budgets: Mapping[tuple[str, str], SourceBudget]) -> Figure:
    """Draw the whole tensor of every trajectory and estimator: Shapley shares, and how much of the error is bias."""
    pairs = list(budgets)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 1.1 + 0.24 * len(pairs)), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        base = np.zeros(len(pairs))
        for k, name in enumerate(budgets[pairs[0]].sources.players):
            width = np.array([100 * budgets[pair].sources.shapley.generalised[k] for pair in pairs])
            colour, hatch = _colour(k)
            left.barh(range(len(pairs)), width, 0.7, left=base, color=colour, hatch=hatch, edgecolor="white",
                      linewidth=0.3, label=label(display_name(name)))  # fmt: skip
            base = base + width
        bias = 100 * np.clip([budgets[pair].mean_square.tensor_bias_share for pair in pairs], 0, 1)
        right.barh(range(len(pairs)), bias, 0.7, color=BIAS, label="bias")
        right.barh(range(len(pairs)), 100 - bias, 0.7, left=bias, color=DISPERSION, label="dispersion")
        left.set_yticks(range(len(pairs)), [label(", ".join(pair)) for pair in pairs])
        left.invert_yaxis()
        left.set(xlim=(0, 100), xlabel="Shapley share of the tensor's variance [%]")
        right.set(xlim=(0, 100), xlabel="share of the mean square [%]")
        for axes in (left, right):
            axes.tick_params(axis="y", length=0)
        handles = [*left.get_legend_handles_labels()[0], *right.get_legend_handles_labels()[0]]
        labels = [*left.get_legend_handles_labels()[1], *right.get_legend_handles_labels()[1]]
        figure.legend(handles, labels, loc="outside upper center", ncols=5)
    return figure
