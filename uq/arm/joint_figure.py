"""The figure of a joint motion: each joint's position, speed and acceleration in parts of its limit."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from uq.arm.arm_design import ArmDesign
from uq.report.figures.style import PAGE, PALETTE, STYLE, label

SHOWN = 12.0
"""Seconds from the start that are drawn."""


def joint_figure(design: ArmDesign) -> Figure:
    """Draw the first seconds of the designed motion; a position counts from the middle of its range."""
    limits, series = design.limits, design.designed.series
    t = np.linspace(0.0, min(SHOWN, design.duration), 600)
    position, speed, acceleration = map(np.asarray, series.states(t))
    rows = {
        "position": (position - limits.middle) / limits.half,
        "speed": speed / limits.arm.speed,
        "acceleration": acceleration / limits.arm.acceleration,
    }
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 4.2), layout="constrained")
        panels = figure.subplots(3, 1, sharex=True)
        for panel, (quantity, values) in zip(panels, rows.items(), strict=True):
            for k, name in enumerate(limits.arm.names):
                panel.plot(t, values[:, k], color=PALETTE[k % len(PALETTE)], label=label(name))
            panel.set(ylabel=f"{quantity} / limit", ylim=(-1.05, 1.05))
        panels[0].legend(ncols=min(limits.arm.count, 6), loc="lower right", bbox_to_anchor=(1, 0.98))
        panels[-1].set(xlabel="time [s]", xlim=(t[0], t[-1]))
        figure.align_ylabels(panels)
    return figure
