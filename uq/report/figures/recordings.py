"""Figures of recordings: a run beside its plan, the residual wrench of static poses, Allan deviations at rest."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.figure import FigureBase
from matplotlib.ticker import MaxNLocator

from uq.report.figures.style import AXIS_COLOURS, COLUMN, PAGE, PALETTE, legend_above, new_figure
from uq.runs.recorded.still_noise import TARGETS, ChannelNoise


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
