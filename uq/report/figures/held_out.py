"""The figure of a held-out prediction: measured, predicted and error by axis, and the errors beside the expected."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from identify.results.held_out_result import FORCE, HeldOutRun
from uq.report.figures.style import AXIS_COLOURS, FILL, PAGE, PALETTE, RULE, legend_above, new_figure


def prediction(run: HeldOutRun, ratios: Sequence[float]) -> FigureBase:
    """Draw a stretch of measured and predicted force and moment, their difference, and rms errors over the expected.

    Args:
        run: that is drawn.
        ratios: of each row, the largest error over what is expected of all runs.
    """
    quantities = range(len(run.names) // 3)
    figure = new_figure(PAGE, 0.5 + 1.9 * len(quantities), layout="constrained")
    ratio = [3, 1.3] * len(quantities)
    panels = figure.subplots(2 * len(quantities), 4, squeeze=False, height_ratios=ratio, width_ratios=(3, 3, 3, 2))
    for q in quantities:
        for k in range(3):
            _axis(panels[2 * q, k], panels[2 * q + 1, k], run, 3 * q + k)
        _bars(panels[2 * q, 3], run, 3 * q, ratios)
        panels[2 * q + 1, 3].set_axis_off()
        unit = "N" if run.names[3 * q] in FORCE else "N·m"
        panels[2 * q, 0].set_ylabel(f"{'force' if unit == 'N' else 'moment'} [{unit}]")
        panels[2 * q + 1, 0].set_ylabel("error")
    for axes in panels[-1, :3]:
        axes.set_xlabel("time [s]")
    figure.align_ylabels(panels[:, 0])
    legend_above(figure)
    return figure


def _axis(above: Axes, below: Axes, run: HeldOutRun, k: int) -> None:
    """One row's signals over its error, with twice what is expected as a band."""
    above.plot(run.t, run.measured[:, k], color=PALETTE[7], linewidth=2.0, label="measured")
    above.plot(run.t, run.predicted[:, k], color=AXIS_COLOURS[k % 3], label="predicted")
    above.set_title(run.names[k], loc="left")
    above.tick_params(labelbottom=False)
    error, reach = run.measured[:, k] - run.predicted[:, k], 2 * float(run.expected[k])
    below.axhspan(-reach, reach, color=FILL, alpha=0.6, linewidth=0)
    below.plot(run.t, error, color=AXIS_COLOURS[k % 3])
    most = 1.1 * max(float(np.abs(error).max()), reach, 1e-300)
    below.set_ylim(-most, most)
    for axes in (above, below):
        axes.margins(x=0)


def _bars(axes: Axes, run: HeldOutRun, first: int, ratios: Sequence[float]) -> None:
    """Errors over what is expected of the run, and a mark for the largest of all runs."""
    rows = range(first, first + 3)
    axes.bar(range(3), [run.ratio[k] for k in rows], color=AXIS_COLOURS)
    axes.plot(range(3), [ratios[k] for k in rows], "_", color=PALETTE[0], markersize=12)
    axes.axhline(1, color=RULE, linewidth=0.6, linestyle="--")
    axes.set_xticks(range(3), [run.names[k] for k in rows])
    axes.set_title("error / expected", loc="left")
    axes.set_ylim(0, None)
