"""The figure of a recorded run beside its plan."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import FigureBase

from uq.report.figures.style import AXIS_COLOURS, PAGE, PALETTE, new_figure


def followed(t: Float[np.ndarray, " n"], plan: np.ndarray, measured: np.ndarray) -> FigureBase:
    """Draw planned and measured angular velocity on each axis.

    Args:
        t: instants [s].
        plan: in B [rad/s], (n, 3).
        measured: in the same order.
    """
    figure = new_figure(PAGE, 4.2, layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for k, panel in enumerate(panels):
        panel.plot(t, measured[:, k], color=AXIS_COLOURS[k], linewidth=1.2, label="measured")
        panel.plot(t, plan[:, k], color=PALETTE[0], linestyle="--", linewidth=0.8, label="planned")
        panel.set_ylabel(f"ω{k + 1} [rad/s]")
    panels[0].legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 0.98))
    panels[-1].set(xlabel="time from the plan's start [s]", xlim=(t[0], t[-1]))
    figure.align_ylabels(panels)
    return figure
