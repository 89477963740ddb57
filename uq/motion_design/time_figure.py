"""The figure of a motion: several quantities of each axis or joint over time, one panel below the other."""

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.figure import FigureBase

from uq.report.figures.style import PAGE, STYLE, label, new_figure


def time_figure(
    t: Float[np.ndarray, " n"],
    rows: Mapping[str, Float[np.ndarray, "n k"]],
    channels: Sequence[str],
    colours: Sequence[str],
) -> FigureBase:
    """Draw quantities over time.

    Args:
        t: instants [s].
        rows: values by what stands at their panel, a column a channel.
        channels: names of the axes or joints.
        colours: of the channels, over and over.
    """
    with matplotlib.rc_context(STYLE):
        figure = new_figure(PAGE, 4.2, layout="constrained")
        panels = figure.subplots(len(rows), 1, sharex=True)
        for panel, (quantity, values) in zip(panels, rows.items(), strict=True):
            for k, name in enumerate(channels):
                panel.plot(t, values[:, k], color=colours[k % len(colours)], label=label(name))
            panel.set_ylabel(quantity)
        panels[0].legend(ncols=min(len(channels), 6), loc="lower right", bbox_to_anchor=(1, 0.98))
        panels[-1].set(xlabel="time [s]", xlim=(t[0], t[-1]))
        figure.align_ylabels(panels)
    return figure
