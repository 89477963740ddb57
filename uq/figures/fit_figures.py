"""The figure of what the fit leaves of each run: residual moment in time and frequency."""

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from identify.estimators.residual_trace import Trace
from identify.results.identification_result import Identification
from identify.results.run_estimate import RunEstimate
from uq.figures.campaign_figures import PAGE, PALETTE, STYLE

MOST = 4
"""Runs that are drawn."""


def drawn(result: Identification) -> list[RunEstimate]:
    """Return the runs that the figure shows: those with the largest residuals, in the order of the result."""
    kept = [run for run in result.runs if run.trace is not None]
    largest = sorted(kept, key=lambda run: -float(np.sum(run.residual**2)))[:MOST]
    return [run for run in kept if any(run is one for one in largest)]


def fit_residuals(result: Identification) -> Figure | None:
    """Draw the residual moment about the centre of gravity, as bands over time and as amplitude density.

    Args:
        result: an identification; None is returned where none of its runs kept its residuals.
    """
    runs = drawn(result)
    if not runs:
        return None
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 0.6 + 1.25 * len(runs)), layout="constrained")
        panels = figure.subplots(len(runs), 2, squeeze=False, width_ratios=(3, 2))
        for (left, right), run in zip(panels, runs, strict=True):
            assert run.trace is not None  # noqa: S101
            _in_time(left, run.trace)
            _in_frequency(right, run.trace)
            left.set_title(run.file.replace("$", r"\$"), loc="left")
        panels[-1, 0].set_xlabel("time from the run's start [s]")
        panels[-1, 1].set_xlabel("frequency [Hz]")
        figure.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def _in_time(axes: Axes, trace: Trace) -> None:
    """The range of the residuals in each stretch of time, one strip an axis, nothing drawn across a gap."""
    shift = 1.1 * 2 * max(float(np.abs(trace.low).max()), float(np.abs(trace.high).max()), 1e-300)
    steps = np.diff(trace.t)
    seen = np.append(steps < 3 * np.median(steps), True) if len(steps) else np.ones(1, bool)
    for k in range(3):
        base = (1 - k) * shift
        axes.fill_between(trace.t, base + trace.low[:, k], base + trace.high[:, k], where=seen, color=PALETTE[k + 1],
                          linewidth=0.4)  # fmt: skip
        axes.axhline(base, color=PALETTE[0], linewidth=0.4)
    axes.set_yticks([shift, 0, -shift], [f"M{k}" for k in (1, 2, 3)])
    axes.set_ylim(-1.55 * shift, 1.55 * shift)
    axes.margins(x=0)
    axes.set_title(f"strips ±{shift / 2.2:.2g} N·m", loc="right")


def _in_frequency(axes: Axes, trace: Trace) -> None:
    """Amplitude density of the residuals on each axis, and of the moment itself."""
    if not len(trace.frequency):
        return
    axes.loglog(trace.frequency, trace.moment_density, color=PALETTE[7], linewidth=1.6, label="moment")
    for k in range(3):
        axes.loglog(trace.frequency, trace.residual_density[:, k], color=PALETTE[k + 1], label=f"residual of M{k + 1}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=8))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("[N·m/Hz$^{1/2}$]")
