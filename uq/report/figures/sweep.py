"""Figure of a sweep: 3σ and mean error against the value."""

import numpy as np
from matplotlib.figure import FigureBase

from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.monte_carlo.campaign.sweep import SweepResult
from uq.report.figures.style import GRID, PAGE, PALETTE, RULE, legend_above, new_figure


def against_value(result: SweepResult, trajectory: str, estimator: str) -> FigureBase:
    """Draw 3σ and mean error of the six components against the values of a key, with bands of two standard errors.

    Args:
        result: of one key.
        trajectory: its name.
        estimator: its name.
    """
    ((key, values),) = result.values.items()
    places, label = _places(values)
    figures = result.figures_of(trajectory, estimator)
    figure = new_figure(PAGE, 2.8, layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, name, title in ((left, "three_sigma", "3σ"), (right, "mean_error", "mean error")):
        for component, colour, style in zip(COMPONENTS, PALETTE[1:], ("-", "--", "--", "-", "--", "-"), strict=False):
            k = COMPONENTS.index(component)
            middle, error = (GRAM_METRE * figures[f"{name}{end}"][:, k] for end in ("", "_standard_error"))
            axes.fill_between(places, middle - 2 * error, middle + 2 * error, color=colour, alpha=0.2, linewidth=0)
            axes.plot(places, middle, style, color=colour, label=component, marker=".", markersize=3)
        axes.set(xlabel=f"{key}{label}", ylabel=f"{title} [g·m²]")
        axes.grid(color=GRID, linewidth=0.5)
        if not label and places.dtype == int:
            axes.set_xticks(places, values)
    left.set_ylim(bottom=0)
    right.axhline(0, color=RULE, linewidth=0.6)
    legend_above(figure)
    return figure


def _places(values: tuple[str, ...]) -> tuple[np.ndarray, str]:
    """Places of values on the axis, and their unit; one after the other where they are no numbers of one unit."""
    parts = [value.partition(" ") for value in values]
    try:
        numbers = np.array([float(number) for number, *_ in parts])
    except ValueError:
        return np.arange(len(values)), ""
    units = {unit for *_, unit in parts}
    return (numbers, f" [{units.pop()}]" if units != {""} else "") if len(units) == 1 else (np.arange(len(values)), "")
