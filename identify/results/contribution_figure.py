"""The figure of an identified tensor's budget: each part's share of each component's variance."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.figure import FigureBase

from identify.figure_style import (
    OTHERS,
    PAGE,
    PALETTE,
    STYLE,
    columns,
    display_name,
    label,
    largest,
    new_figure,
    others,
)
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import decimals, fixed


def shares(parts: Mapping[str, np.ndarray], standard_uncertainty: np.ndarray) -> FigureBase:
    """Draw each part's share of the parts' variances together, with the standard uncertainty beside it.

    The largest have a colour each, the others one together.

    Args:
        parts: contributions to the standard uncertainty by name [kg·m²], each of six components.
        standard_uncertainty: the combined one of each component [kg·m²].
    """
    variances = np.nan_to_num([np.square(values) for values in parts.values()], posinf=0.0)
    total = variances.sum(axis=0)
    with matplotlib.rc_context(STYLE):
        figure = new_figure(PAGE, 2.4, layout="constrained")
        axes = figure.subplots()
        base = np.zeros(len(COMPONENTS))
        names, shares_of = list(parts), 100 * variances / np.maximum(total, 1e-300)
        shown, rest = largest(names, shares_of.max(axis=1, initial=0.0).tolist())
        stacks = [(label(display_name(names[k])), PALETTE[1 + n], shares_of[k]) for n, k in enumerate(shown)]
        stacks += [(others(rest), OTHERS, shares_of[rest].sum(axis=0))] if rest else []
        for name, colour, width in stacks:
            axes.barh(range(6), width, 0.72, left=base, color=colour, edgecolor="white", linewidth=0.3, label=name)
            base = base + width
        for k, value in enumerate(GRAM_METRE * standard_uncertainty):
            axes.annotate(
                f"u = {fixed(value, decimals(value))} g·m²", (100, k), (4, 0), textcoords="offset points", va="center"
            )
        axes.set_yticks(range(6), COMPONENTS)
        axes.invert_yaxis()
        axes.set(xlim=(0, 100), xlabel="share of the variance [%]")
        axes.tick_params(axis="y", length=0)
        figure.legend(
            *axes.get_legend_handles_labels(), loc="outside upper center", ncols=columns([s[0] for s in stacks], PAGE)
        )
    return figure
