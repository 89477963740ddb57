"""Figures of a motion and of a campaign. Every function returns a matplotlib ``Figure`` and touches no global setting.

Drawn at the width of a journal's column (3.5 in), in Okabe and Ito's colours, which colour-blind readers tell apart.
A dispersion never stands alone: the mean error has its own panel, on its own scale.
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, MOMENTS, PRODUCTS
from uq.campaign.averages import average
from uq.campaign.campaign import GRAM_METRE, MonteCarloResult, Statistics
from uq.experiment.experiment import TrajectorySpec, samples

COLUMN, PAGE = 3.5, 7.2
"""Width of a column and of a page [in]."""

PALETTE = ("#404040", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#A0A0A0")
HATCHES = ("", "////", "....")
STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 1.0,
    "lines.linewidth": 0.8,
    "hatch.linewidth": 0.6,
    "figure.dpi": 150,
}
NAMES = {"total": "total", "cg": "CG", "imu": "IMU", "r_cg": "r CG"}
AXES = ("b1", "b2", "b3")
POINTS = 8000
"""Most samples of a motion that a figure draws."""


def spheres(omega: np.ndarray, alpha: np.ndarray) -> Figure:
    """Draw the paths of angular velocity and angular acceleration in the body frame: the source's figures 2 and 7.

    Args:
        omega: angular velocity in B, component first, (3, n) [rad/s].
        alpha: angular acceleration in B, (3, n) [rad/s²].
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, 5.8))
        _path(figure, (0.0, 0.55, 0.94, 0.43), np.asarray(omega), "(a) angular velocity", "ω{} [rad/s]")
        _path(figure, (0.0, 0.055, 0.94, 0.43), np.asarray(alpha), "(b) angular acceleration", "α{} [rad/s²]")
    return figure


def _path(figure: Figure, place: tuple[float, float, float, float], path: np.ndarray, title: str, label: str) -> None:
    """Draw one path in 3-D with equal axes, the near side darker than the far side."""
    axes: Any = figure.add_axes(place, projection="3d", proj_type="ortho")
    axes.set_title(title, y=1.0)
    axes.view_init(elev=22, azim=-52)
    limit = 1.05 * float(np.max(np.abs(path)))
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), zlim=(-limit, limit))
    axes.set_box_aspect((1, 1, 1), zoom=0.98)
    for number, axis in enumerate((axes.xaxis, axes.yaxis, axes.zaxis), 1):
        axis.set_label_text(f"{AXES[number - 1]}: {label.format(number)}")
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 4, 5, 10], symmetric=True))
        axis.set_pane_color((1, 1, 1, 0))
        axis._axinfo["grid"].update(linewidth=0.3, color="#d8d8d8")  # matplotlib has no public setter
    segments = np.stack([path.T[:-1], path.T[1:]], axis=1)
    azimuth, elevation = np.deg2rad(axes.azim), np.deg2rad(axes.elev)
    towards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    near = segments.mean(axis=1) @ np.array(towards)
    order = np.argsort(near)
    lines = Line3DCollection(segments[order], cmap="Blues", linewidths=0.35, rasterized=True)
    lines.set_array(near[order])
    lines.set_clim(-1.6 * limit, limit)
    axes.add_collection3d(lines, autolim=False)


def angular_velocity(t: np.ndarray, omega: np.ndarray) -> Figure:
    """Draw the three components of the angular velocity against time: the source's figure 4.

    Args:
        t: instants [s], (n,).
        omega: angular velocity in B, component first, (3, n) [rad/s].
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, 2.9), layout="constrained")
        panels = figure.subplots(3, 1, sharex=True, sharey=True)
        for number, (axes, values) in enumerate(zip(panels, np.asarray(omega), strict=True), 1):
            axes.axhline(0, color="#b0b0b0", linewidth=0.5)
            axes.plot(t, values, color=PALETTE[1], linewidth=0.4)
            axes.set_ylabel(f"ω{number} [rad/s]")
            axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 4, 5, 10], symmetric=True))
        panels[-1].set_xlabel("time [s]")
        panels[-1].set_xlim(t[0], t[-1])
        figure.align_ylabels(panels)
    return figure


def rates(spec: TrajectorySpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a trajectory's instants [s], angular velocity [rad/s] and acceleration [rad/s²], thinned for drawing."""
    t = samples(spec)
    t = t[:: -(-len(t) // POINTS)]
    omega, alpha = (jax.vmap(f)(jnp.asarray(t)) for f in (spec.trajectory.omega, spec.trajectory.alpha))
    return t, np.asarray(omega).T, np.asarray(alpha).T


def contributions(cases: Mapping[str, Statistics]) -> Figure:
    """Draw what each case does to each component: the source's figure 3, with the mean error in a second panel.

    Error bars are standard errors. A mean error that exceeds its own 3σ is written beside its marker when it belongs
    to the first case. The mean errors are on a symmetric logarithmic scale when one exceeds every 3σ.

    Args:
        cases: statistics by name; a breakdown's ``groups``, or its ``sources``, or both.
    """
    wide = len(cases) > 4
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE if wide else COLUMN, 3.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        width = 0.84 / max(len(cases), 1)
        for k, (name, s) in enumerate(cases.items()):
            x = np.arange(len(COMPONENTS)) + (k - (len(cases) - 1) / 2) * width
            colour, hatch = PALETTE[k % len(PALETTE)], HATCHES[k // len(PALETTE) % len(HATCHES)]
            _bars(top, x, s.three_sigma, s.three_sigma_standard_error, width, colour, _text(display_name(name)), hatch)
            _marks(bottom, x, s.mean_error, s.mean_error_standard_error, colour)
        _finish_dispersion(top)
        _finish_mean_error(bottom, cases)
        bottom.set_xticks(range(len(COMPONENTS)), COMPONENTS)
        for edge in np.arange(len(COMPONENTS) - 1) + 0.5:
            bottom.axvline(edge, color="#e4e4e4", linewidth=0.5, zorder=0)
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=8 if wide else 4)
        figure.align_ylabels()
    return figure


def estimates(result: Identification) -> Figure:
    """Draw each component as each run alone gives it, with its 95 % interval, and the interval of all runs together.

    Args:
        result: an identification; a run that does not identify the whole tensor alone is not drawn.
    """
    runs = [run for run in result.runs if run.alone]
    beyond = 10 * float(np.abs(result.inertia).max())
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 3.6), layout="constrained")
        for k, axes in enumerate(figure.subplots(2, 3).flat):
            # an end that nothing bounds lies beyond the axis
            low, high = GRAM_METRE * np.nan_to_num(result.interval95[k], posinf=beyond, neginf=-beyond)
            axes.axhspan(low, high, color=PALETTE[1], alpha=0.18, linewidth=0, label="all runs, 95 %")
            axes.axhline(GRAM_METRE * result.inertia[k], color=PALETTE[1])
            values = [GRAM_METRE * (run.inertia - result.taken_off)[k] for run in runs]
            bars = [GRAM_METRE * 1.96 * run.standard_uncertainty[k] for run in runs]
            axes.errorbar(range(1, len(runs) + 1), values, bars, fmt="o", markersize=2.6, color=PALETTE[0],
                          elinewidth=0.7, capsize=1.4, label="each run, ±1.96 u")  # fmt: skip
            axes.set_ylabel(f"{COMPONENTS[k]} [g·m²]")
            axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
            axes.set_xlim(0.4, len(runs) + 0.6)
            axes.ticklabel_format(useOffset=False)
            if np.isinf(result.interval95[k]).any():
                axes.set_ylim(*np.clip(axes.get_ylim(), -0.3 * GRAM_METRE * beyond, 0.3 * GRAM_METRE * beyond))
            if k > 2:
                axes.set_xlabel("run")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels()
    return figure


def parts(result: Identification) -> Figure:
    """Draw each run's angular velocity and which parts of it were used, at most six runs.

    Args:
        result: an identification of runs of which parts were named or found.
    """
    runs = [run for run in result.runs if run.overview is not None][:6]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 0.5 + 1.3 * max(len(runs), 1)), layout="constrained")
        for axes, run in zip(figure.subplots(max(len(runs), 1), 1, squeeze=False).flat, runs, strict=False):
            t, speed = np.asarray(run.overview).T
            axes.plot(t, speed, color=PALETTE[0], linewidth=0.5)
            for k, (start, stop) in enumerate(run.parts):
                label = ("found where it moves" if run.found else "named") if k == 0 else None
                axes.axvspan(start, stop, color=PALETTE[1], alpha=0.18, linewidth=0, label=label)
            axes.set_ylabel("|ω| [rad/s]")
            axes.set_title(run.file, loc="left")
            axes.legend(loc="upper right")
            axes.set_xlim(t[0], t[-1])
        axes.set_xlabel("time from the run's start [s]")
    return figure


def display_name(name: str) -> str:
    """Return a group's or source's name as a reader would write it."""
    return NAMES.get(name, name.replace("_", " ").replace("omega", "ω"))


def _text(name: str) -> str:
    """Return a name that matplotlib does not take for a formula."""
    return name.replace("$", r"\$")


def _bars(
    axes: Axes,
    x: np.ndarray,
    values: np.ndarray,
    errors: np.ndarray,
    width: float,
    colour: str,
    label: str,
    hatch: str = "",
) -> None:
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.bar(x, values, 0.92 * width, color=colour, label=label, hatch=hatch, edgecolor="white", linewidth=0)
    axes.errorbar(x, values, errors, fmt="none", ecolor="black", elinewidth=0.6, capsize=1.2, capthick=0.6)


def _marks(axes: Axes, x: np.ndarray, values: np.ndarray, errors: np.ndarray, colour: str) -> None:
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.errorbar(x, values, errors, fmt="o", markersize=2.6, color=colour, elinewidth=0.7, capsize=1.4, capthick=0.6)


def _finish_dispersion(axes: Axes) -> None:
    axes.set_ylabel("3σ [g·m²]")
    axes.set_ylim(bottom=0)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.5)


def _finish_mean_error(axes: Axes, cases: Mapping[str, Statistics]) -> None:
    axes.axhline(0, color="#808080", linewidth=0.6, zorder=1)
    axes.set_ylabel("mean error [g·m²]")
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.5)
    means = np.abs([s.mean_error for s in cases.values()])
    dispersions = np.array([s.three_sigma for s in cases.values()])
    if np.nanmax(means, initial=0) > np.nanmax(dispersions, initial=0):
        axes.set_yscale("symlog", linthresh=1, linscale=0.7)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "−")))
    axes.margins(y=0.15)
    _name_excess(axes, cases)


def _name_excess(axes: Axes, cases: Mapping[str, Statistics]) -> None:
    """Write the mean errors of the first case that exceed their 3σ."""
    for s in list(cases.values())[:1]:
        for k in np.flatnonzero(np.abs(s.mean_error) > s.three_sigma):
            value = GRAM_METRE * s.mean_error[k]
            axes.annotate(f"{value:.3g}".replace("-", "−"), (k, value), (0, 3), textcoords="offset points", ha="center")


def averages(
    result: MonteCarloResult, estimator: str, printed: Mapping[str, Mapping[str, float]] | None = None
) -> Figure:
    """Draw the average 3σ of the moments and of the products by trajectory: the source's figure 5.

    The second panel holds the average magnitude of the mean errors. Error bars are standard errors.

    Args:
        result: a campaign.
        estimator: one of its estimators.
        printed: the source's values in g·m², by row (``"3σ moments"``, ``"3σ products"``) and trajectory.
    """
    names = list(result.breakdowns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, 3.6), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        x = np.arange(len(names))
        for k, (kind, components) in enumerate({"moments": MOMENTS, "products": PRODUCTS}.items()):
            sigma, sigma_error, mean, mean_error = np.array(
                [average(result, n, estimator, components) for n in names]
            ).T
            place = x + (k - 0.5) * 0.38
            _bars(top, place, sigma, sigma_error, 0.38, PALETTE[k + 1], kind)
            _bars(bottom, place, mean, mean_error, 0.38, PALETTE[k + 1], kind)
            _printed(top, place + 0.1, names, (printed or {}).get(f"3σ {kind}", {}), label=k == 1)
        _finish_dispersion(top)
        top.set_ylabel("average 3σ [g·m²]")
        bottom.set_ylabel("average |mean error|\n[g·m²]")
        bottom.tick_params(axis="x", length=0)
        bottom.grid(axis="y", color="#e4e4e4", linewidth=0.5)
        bottom.set_xticks(x, [_text(name) for name in names])
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        figure.align_ylabels()
    return figure


def _printed(axes: Axes, x: np.ndarray, names: list[str], values: Mapping[str, float], label: bool) -> None:
    known = [(place, values[name]) for place, name in zip(x, names, strict=True) if name in values]
    if known:
        style: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "markeredgewidth": 0.8, "markersize": 4}
        axes.plot(*zip(*known, strict=True), "D", linestyle="none", label="source" if label else None, **style)
