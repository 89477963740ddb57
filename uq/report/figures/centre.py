"""The figure of a centre: the residual wrench of each static pose."""

import numpy as np
from matplotlib.figure import FigureBase
from matplotlib.ticker import MaxNLocator

from uq.report.figures.style import COLUMN, PALETTE, new_figure


def pose_residuals(residuals: np.ndarray) -> FigureBase:
    """Draw the residual force and moment of each pose, by axis.

    Args:
        residuals: measured less fitted wrench of each pose, (n, 6) [N, N·m].
    """
    figure = new_figure(COLUMN, 3.6, layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    pose = np.arange(1, len(residuals) + 1)
    shown = {"force [N]": residuals[:, :3], "moment [mN·m]": 1e3 * residuals[:, 3:]}
    for axes, (label, values) in zip(panels, shown.items(), strict=True):
        axes.axhline(0, color=PALETTE[0], linewidth=0.6)
        for axis, marker, colour, column in zip("xyz", "os^", PALETTE[1:4], values.T, strict=True):
            axes.plot(pose, column, marker, color=colour, markersize=3, label=axis)
        axes.set_ylabel(f"residual {label}")
    panels[1].set_xlabel("pose")
    panels[1].xaxis.set_major_locator(MaxNLocator(integer=True))
    panels[0].legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return figure
