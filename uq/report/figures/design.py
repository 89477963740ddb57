"""Figures of a designed motion: over time, of legs and joints against their limits, and the largest sources."""

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.figure import FigureBase

from identify.motion.leg_limits import Effort, Limits, shares
from identify.rigid_body.inertia import GRAM_METRE
from uq.analysis.propagation.law_result import LawStatistics
from uq.monte_carlo.campaign.statistics import Breakdown
from uq.plan.measurement.required_duration import average
from uq.plan.measurement.sensor_worth import BOTH
from uq.plan.motion_design.arm.arm_design import ArmDesign
from uq.report.figures.style import MOST, PAGE, PALETTE, display_name, label, legend_above, new_figure

LEG_COLOURS = PALETTE[:6]
SHOWN = 12.0
"""Length of an arm's motion that its figure shows, from the start [s]."""


def over_time(
    t: Float[np.ndarray, " n"], rows: Mapping[str, Float[np.ndarray, "n k"]], colours: Mapping[str, str]
) -> FigureBase:
    """Draw quantities over time.

    Args:
        t: instants [s].
        rows: values by what stands at their panel, a column a channel.
        colours: of the channels, by the name of the axis or joint.
    """
    figure = new_figure(PAGE, 4.2, layout="constrained")
    panels = figure.subplots(len(rows), 1, sharex=True)
    for panel, (quantity, values) in zip(panels, rows.items(), strict=True):
        for channel, (name, colour) in zip(values.T, colours.items(), strict=True):
            panel.plot(t, channel, color=colour, label=label(name))
        panel.set_ylabel(quantity)
    panels[0].legend(ncols=min(len(colours), 6), loc="lower right", bbox_to_anchor=(1, 0.98))
    panels[-1].set(xlabel="time [s]", xlim=(t[0], t[-1]))
    figure.align_ylabels(panels)
    return figure


def joints(design: ArmDesign) -> FigureBase:
    """Draw positions and speeds of an arm's joints from the start of the run, in parts of each joint's limit."""
    arm = design.limits.arm
    t = np.linspace(0.0, min(SHOWN, design.duration), 600)
    used = arm.joint_shares(design.designed.series.sampled(t))
    colours = dict(zip(arm.names, cycle(PALETTE), strict=False))
    figure: Any = over_time(t, {f"{what} / limit": share for what, share in used.items()}, colours)
    for panel in figure.axes:
        panel.set_ylim(-1.05, 1.05)
    return figure


def legs(t: Float[np.ndarray, " n"], asked: Effort, limits: Limits) -> FigureBase:
    """Draw the legs' lengths, speeds, accelerations and forces over a segment of time, in parts of each leg's limit.

    Args:
        t: instants [s].
        asked: what the motion asks for at these.
        limits: of the rig; a length counts from the middle of its range.
    """
    used = shares(asked, limits)
    figure = new_figure(PAGE, 4.4, layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for panel, name in zip(panels, ("length", "speed", "acceleration", "force"), strict=True):
        for k, share in enumerate(np.asarray(used[name]).T):
            panel.plot(t, 100 * share, color=LEG_COLOURS[k], linewidth=0.6, label=f"leg {k + 1}")
        for end in (-100, 100):
            panel.axhline(end, color=PALETTE[6], linestyle="--", linewidth=0.8)
        panel.set(title="length, from the middle" if name == "length" else name, xlim=(t[0], t[-1]))
    for panel in panels[::2]:
        panel.set_ylabel("part of the limit [%]")
    for panel in panels[2:]:
        panel.set_xlabel("time [s]")
    legend_above(figure)
    return figure


def budgets(laws: Mapping[str, Breakdown[LawStatistics]], bound: Mapping[str, float | None]) -> FigureBase:
    """Draw the average 3σ of moments and products: all sources and the largest alone, a bar for each trajectory.

    Args:
        laws: by trajectory, all with the same sources.
        bound: the least that any motion reaches, of ``moments`` and ``products`` [kg·m²]; None: not known.
    """
    first = next(iter(laws.values()))
    widths = {
        name: max(case.three_sigma.max() for case in (law.sources[name] for law in laws.values()))
        for name in first.sources
    }
    sources = sorted(widths, key=lambda name: -widths[name])[:MOST]
    names = ["total", *sources]
    width = 0.8 / len(laws)
    figure = new_figure(PAGE, 2.9, layout="constrained")
    panels = figure.subplots(1, 2)
    for panel, goal in zip(panels, BOTH, strict=True):
        for k, (trajectory, law) in enumerate(laws.items()):
            cases = [law.total, *(law.sources[name] for name in sources)]
            values = [GRAM_METRE * average(case.three_sigma, goal) for case in cases]
            at = np.arange(len(names)) + (k - (len(laws) - 1) / 2) * width
            panel.bar(at, values, width, color=PALETTE[1:][k % 7], label=label(trajectory))
        least = bound.get(goal)
        if least is not None:
            panel.plot([-0.5, 0.5], [GRAM_METRE * least] * 2, color=PALETTE[0], linestyle="--", label="bound")
        texts = [label(display_name(name)) for name in names]
        panel.set_xticks(np.arange(len(names)), texts, rotation=35, ha="right")
        panel.set_title(goal)
    panels[0].set_ylabel("average 3σ [g·m²]")
    legend_above(figure)
    return figure
