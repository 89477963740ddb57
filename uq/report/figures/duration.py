"""Figure of the average 3σ over the duration of a measurement."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import FigureBase
from matplotlib.ticker import ScalarFormatter, StrMethodFormatter

from identify.rigid_body.inertia import GRAM_METRE
from uq.plan.measurement.required_duration import Growth, average
from uq.plan.measurement.sensor_worth import BOTH
from uq.report.figures.style import PAGE, PALETTE, RULE, display_name, label, new_figure


def duration_figure(growth: Growth, asked: Mapping[str, Sequence[float]]) -> FigureBase:
    """Draw the average 3σ over the duration, all sources and each alone that is not too small to be seen.

    Args:
        growth: of the sources' variances.
        asked: targets [kg·m²] by goal, each in a panel of its own.
    """
    t = np.geomspace(
        max(growth.duration / 10, 1.1 * float(np.nanmax(growth.lost, initial=0.0))), 100 * growth.duration, 300
    )
    figure = new_figure(PAGE, 2.9, layout="constrained")
    goals = list(asked) if set(asked) - set(BOTH) else list(BOTH)
    panels = np.atleast_1d(figure.subplots(1, len(goals), sharey=True))
    curves = {goal: GRAM_METRE * average(3 * np.sqrt(growth.at(t)).transpose(1, 0, 2), goal) for goal in goals}
    totals = {goal: GRAM_METRE * average(growth.three_sigma(t), goal) for goal in goals}
    bottom = 2e-3 * max(total.max() for total in totals.values())
    shown = [k for k in range(len(growth.names)) if max(curve[k].max() for curve in curves.values()) > bottom]
    for panel, goal in zip(panels, goals, strict=True):
        panel.plot(t, totals[goal], color="black", linewidth=1.6, label="total")
        for place, k in enumerate(shown):
            colour, dashes = PALETTE[1:7][place % 6], ("-", "--", ":")[place // 6 % 3]
            text = label(display_name(growth.names[k]))
            panel.plot(t, curves[goal][k], color=colour, linestyle=dashes, label=text)
        for target in asked.get(goal, ()):
            panel.axhline(GRAM_METRE * target, color=PALETTE[0], linestyle=":", linewidth=0.8)
        panel.axvline(growth.duration, color=RULE, linewidth=0.8)
        panel.set(xscale="log", yscale="log", xlabel="duration [s]", title=goal, xlim=(t[0], t[-1]))
        panel.xaxis.set_major_formatter(ScalarFormatter())
        panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panels[0].set_ylim(bottom=bottom)
    panels[0].set_ylabel("average 3σ [g·m²]")
    panels[-1].legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return figure
