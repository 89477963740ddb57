"""Figure of the Allan deviations of a recording at rest."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import FigureBase

from uq.recorded.still_noise import TARGETS, ChannelNoise
from uq.report.figures.style import AXIS_COLOURS, PAGE, legend_above, new_figure

TITLES = {"F": "force [N]", "M": "moment [N·m]", "omega": "angular velocity [rad/s]", "f": "specific force [m/s²]"}


def allan_deviations(channels: Sequence[ChannelNoise]) -> FigureBase:
    """Draw each signal's overlapping Allan deviation over the averaging time, with that of the fitted noise.

    Args:
        channels: axes of signals, in any order.
    """
    targets = [quantity for quantity in TARGETS if any(channel.quantity == quantity for channel in channels)]
    figure = new_figure(PAGE, 2.6 * -(-len(targets) // 2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(-(-len(targets) // 2), min(len(targets), 2))).flat
    for panel, quantity in zip(panels, targets, strict=False):
        for channel in channels:
            if channel.quantity == quantity:
                colour, tau = AXIS_COLOURS[channel.axis], channel.tau
                fit = channel.noise.allan_deviation(tau)
                panel.plot(tau, channel.deviation, "o", color=colour, markersize=2, label=f"b{channel.axis + 1}")
                panel.plot(tau, fit, color=colour)
        panel.set(xscale="log", yscale="log", xlabel="averaging time [s]", ylabel=TITLES[quantity])
    legend_above(figure)
    return figure
