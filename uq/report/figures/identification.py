"""Figures of an identification: budget, residuals in time and frequency, each run's estimate, parts that counted."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from identify.display.rounding import decimals, fixed, significant
from identify.least_squares.residual_spectrum import Trace
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.report.figures.style import PAGE, PALETTE, coloured_parts, label, legend_above, new_figure, stacked


def shares(parts: Mapping[str, np.ndarray], standard_uncertainty: np.ndarray) -> FigureBase:
    """Draw each part's share of the parts' variances together, with the standard uncertainty beside it.

    The largest have a colour each, the others one together.

    Args:
        parts: contributions to the standard uncertainty by name [kg·m²], each of six components.
        standard_uncertainty: the combined one of each component [kg·m²].
    """
    variances = np.nan_to_num([np.square(values) for values in parts.values()], posinf=0.0)
    total = variances.sum(axis=0)
    figure = new_figure(PAGE, 2.4, layout="constrained")
    axes = figure.subplots()
    stacked(axes, coloured_parts(list(parts), 100 * variances / np.maximum(total, 1e-300)), 0.72)
    for k, value in enumerate(GRAM_METRE * standard_uncertainty):
        axes.annotate(
            f"u = {fixed(value, decimals(value))} g·m²", (100, k), (4, 0), textcoords="offset points", va="center"
        )
    axes.set_yticks(range(6), COMPONENTS)
    axes.invert_yaxis()
    axes.set(xlim=(0, 100), xlabel="share of the variance [%]")
    axes.tick_params(axis="y", length=0)
    legend_above(figure)
    return figure


def moments(runs: Sequence[RunEstimate]) -> FigureBase:
    """Draw measured and predicted moment about the centre of gravity in a short stretch of each run.

    Args:
        runs: one or more that kept their residuals.
    """
    figure = new_figure(PAGE, 0.6 + 1.25 * len(runs), layout="constrained")
    panels = figure.subplots(len(runs), 3, squeeze=False, sharey="row", sharex="row")
    for row, run in zip(panels, runs, strict=True):
        assert run.trace is not None  # noqa: S101
        stretch = run.trace.stretch
        for k, axes in enumerate(row):
            axes.plot(stretch.t, stretch.measured[:, k], color=PALETTE[7], linewidth=0.8, label="measured")
            axes.plot(stretch.t, stretch.predicted[:, k], color=PALETTE[k + 1], linewidth=1.2, label="predicted")
            axes.set_title(f"M{k + 1}" if k else f"{label(run.file)}, M1", loc="left")
            axes.margins(x=0)
        row[0].set_ylabel("moment [N·m]")
    panels[-1, 1].set_xlabel("time from the run's start [s]")
    legend_above(figure)
    return figure


def residuals(runs: Sequence[RunEstimate]) -> FigureBase:
    """Draw the residual moment about the centre of gravity, as bands over time and as amplitude density.

    Args:
        runs: one or more that kept their residuals.
    """
    figure = new_figure(PAGE, 0.6 + 1.25 * len(runs), layout="constrained")
    panels = figure.subplots(len(runs), 2, squeeze=False, width_ratios=(3, 2))
    for (in_time, in_frequency), run in zip(panels, runs, strict=True):
        assert run.trace is not None  # noqa: S101
        _in_time(in_time, run.trace)
        _in_frequency(in_frequency, run.trace)
        in_time.set_title(label(run.file), loc="left")
    panels[-1, 0].set_xlabel("time from the run's start [s]")
    panels[-1, 1].set_xlabel("frequency [Hz]")
    legend_above(figure)
    return figure


def _in_time(axes: Axes, trace: Trace) -> None:
    """The range of the residuals in each segment of time, one strip an axis, nothing drawn across a gap."""
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
    axes.set_title(f"strips ±{significant(shift / 2.2, 2)} N·m", loc="right")


def _in_frequency(axes: Axes, trace: Trace) -> None:
    """Amplitude density of the residuals on each axis, and of the moment itself."""
    if not len(trace.frequency):
        return
    axes.loglog(trace.frequency, trace.moment_density, color=PALETTE[7], linewidth=1.6, label="moment")
    for k in range(3):
        axes.loglog(trace.frequency, trace.residual_density[:, k], color=PALETTE[k + 1], label=f"residual of M{k + 1}")
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_major_locator(LogLocator(subs=(1,) if high > 100 * low else (1, 2, 5), numticks=8))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("[N·m/Hz$^{1/2}$]")


def estimates(
    runs: Sequence[RunEstimate], inertia: np.ndarray, interval95: np.ndarray, taken_off: np.ndarray
) -> FigureBase:
    """Draw each component as each run alone gives it, with its 95 % interval, and the interval of all runs together.

    Args:
        runs: of which one that does not identify the whole tensor alone is not drawn.
        inertia: of all runs together, packed [kg·m²].
        interval95: about ``inertia``, (6, 2) [kg·m²].
        taken_off: what a fixture adds to each run's own tensor [kg·m²].
    """
    runs = [run for run in runs if run.alone]
    beyond = 10 * float(np.abs(inertia).max())
    figure = new_figure(PAGE, 3.6, layout="constrained")
    for k, axes in enumerate(figure.subplots(2, 3).flat):
        # an end that nothing bounds lies beyond the axis
        low, high = GRAM_METRE * np.nan_to_num(interval95[k], posinf=beyond, neginf=-beyond)
        axes.axhspan(low, high, color=PALETTE[1], alpha=0.18, linewidth=0, label="all runs, 95 %")
        axes.axhline(GRAM_METRE * inertia[k], color=PALETTE[1])
        values = [GRAM_METRE * (run.inertia - taken_off)[k] for run in runs]
        bars = [GRAM_METRE * 1.96 * run.standard_uncertainty[k] for run in runs]
        axes.errorbar(range(1, len(runs) + 1), values, bars, fmt="o", markersize=2.6, color=PALETTE[0],
                      elinewidth=0.7, capsize=1.4, label="each run, ±1.96 u")  # fmt: skip
        axes.set_ylabel(f"{COMPONENTS[k]} [g·m²]")
        axes.xaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1))
        axes.set_xlim(0.4, len(runs) + 0.6)
        axes.ticklabel_format(useOffset=False)
        if np.isinf(interval95[k]).any():
            axes.set_ylim(*np.clip(axes.get_ylim(), -0.3 * GRAM_METRE * beyond, 0.3 * GRAM_METRE * beyond))
        if k > 2:
            axes.set_xlabel("run")
    legend_above(figure)
    figure.align_ylabels()
    return figure


def parts(runs: Sequence[RunEstimate]) -> FigureBase:
    """Draw each run's angular velocity and which parts of it were used, at most six runs.

    Args:
        runs: those of which parts were named or found are drawn.
    """
    runs = [run for run in runs if run.overview is not None][:6]
    figure = new_figure(PAGE, 0.8 + 0.85 * max(len(runs), 1), layout="constrained")
    for axes, run in zip(figure.subplots(max(len(runs), 1), 1, squeeze=False).flat, runs, strict=False):
        t, speed = np.asarray(run.overview).T
        axes.plot(t, speed, color=PALETTE[0], linewidth=0.5)
        for start, stop in run.segments:
            name = f"the part that counts, {'found where it moves' if run.detected else 'named'}"
            axes.axvspan(start, stop, color=PALETTE[1], alpha=0.18, linewidth=0, label=name)
        axes.set_ylabel("|ω| [rad/s]")
        axes.set_title(label(run.file), loc="left")
        axes.set_xlim(t[0], t[-1])
    axes.set_xlabel("time from the run's start [s]")
    legend_above(figure)
    return figure
