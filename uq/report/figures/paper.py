"""Figures of the paper's simulated experiment (figures 2, 4 and 5)."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection  # type: ignore[import-untyped]

from identify.rigid_body.inertia import GRAM_METRE, MOMENTS, PRODUCTS
from uq.experiment.experiment import Experiment, TrajectorySpec, samples, turn_rates
from uq.monte_carlo.barreto2016 import PaperResult
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult, average
from uq.report.figures.campaign import ERROR_BAR, finish_dispersion
from uq.report.figures.style import COLUMN, GRID, PALETTE, RULE, label, legend_above, new_figure

AXES = ("b1", "b2", "b3")
POINTS = 8000
"""Most samples of a motion that a figure draws."""


def spheres(omega: np.ndarray, alpha: np.ndarray) -> FigureBase:
    """Draw the paths of angular velocity and angular acceleration in the body frame: the paper's figures 2 and 7.

    Args:
        omega: angular velocity in B, component first, (3, n) [rad/s].
        alpha: angular acceleration in B, (3, n) [rad/s²].
    """
    figure = new_figure(COLUMN, 5.8)
    _path(figure, (0.0, 0.55, 0.94, 0.43), np.asarray(omega), "(a) angular velocity", "ω{} [rad/s]")
    _path(figure, (0.0, 0.055, 0.94, 0.43), np.asarray(alpha), "(b) angular acceleration", "α{} [rad/s²]")
    return figure


def _path(
    figure: FigureBase, place: tuple[float, float, float, float], path: np.ndarray, title: str, label: str
) -> None:
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
        axis._axinfo["grid"].update(linewidth=0.3, color=GRID)  # matplotlib has no public setter
    segments = np.stack([path.T[:-1], path.T[1:]], axis=1)
    azimuth, elevation = np.deg2rad(axes.azim), np.deg2rad(axes.elev)
    towards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    near = segments.mean(axis=1) @ np.array(towards)
    order = np.argsort(near)
    lines = Line3DCollection(segments[order], cmap="Blues", linewidths=0.35, rasterized=True)
    lines.set_array(near[order])
    lines.set_clim(-1.6 * limit, limit)
    axes.add_collection3d(lines, autolim=False)


def angular_velocity(t: np.ndarray, omega: np.ndarray) -> FigureBase:
    """Draw the three components of the angular velocity against time: the paper's figure 4.

    Args:
        t: instants [s], (n,).
        omega: angular velocity in B, component first, (3, n) [rad/s].
    """
    figure = new_figure(COLUMN, 2.9, layout="constrained")
    panels = figure.subplots(3, 1, sharex=True, sharey=True)
    for number, (axes, values) in enumerate(zip(panels, np.asarray(omega), strict=True), 1):
        axes.axhline(0, color=RULE, linewidth=0.5)
        axes.plot(t, values, color=PALETTE[1], linewidth=0.4)
        axes.set_ylabel(f"ω{number} [rad/s]")
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 4, 5, 10], symmetric=True))
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(t[0], t[-1])
    figure.align_ylabels(panels)
    return figure


def figure2(result: PaperResult) -> FigureBase:
    """Draw angular velocity and acceleration of T1."""
    _, omega, alpha = rates(_trajectory(result, "T1"))
    return spheres(omega, alpha)


def figure4(result: PaperResult) -> FigureBase:
    """Draw the angular velocity of T3."""
    t, omega, _ = rates(_trajectory(result, "T3"))
    return angular_velocity(t, omega)


def _trajectory(result: PaperResult, name: str) -> TrajectorySpec:
    return Experiment.from_dict(result.campaign.provenance["experiment"]).trajectories[name]


def rates(spec: TrajectorySpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a trajectory's instants [s], angular velocity [rad/s] and acceleration [rad/s²], thinned for drawing."""
    t = samples(spec)
    t = t[:: -(-len(t) // POINTS)]
    omega, alpha = turn_rates(spec.trajectory, jnp.asarray(t))
    return t, np.asarray(omega).T, np.asarray(alpha).T


def averages(
    result: MonteCarloResult, estimator: str, printed: Mapping[str, Mapping[str, float]] | None = None
) -> FigureBase:
    """Draw the average 3σ of the moments and of the products by trajectory: the paper's figure 5.

    The second panel holds the average magnitude of the mean errors. Error bars are standard errors.

    Args:
        result: a campaign.
        estimator: one of its estimators.
        printed: the paper's values in g·m², by row (``"3σ moments"``, ``"3σ products"``) and trajectory.
    """
    names = list(result.breakdowns)
    figure = new_figure(COLUMN, 3.6, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    x = np.arange(len(names))
    for k, (kind, components) in enumerate({"moments": MOMENTS, "products": PRODUCTS}.items()):
        sigma, sigma_error, mean, mean_error = np.array([average(result, n, estimator, components) for n in names]).T
        place = x + (k - 0.5) * 0.38
        _bars(axes=top, x=place, values=sigma, errors=sigma_error, width=0.38, colour=PALETTE[k + 1], label=kind)
        _bars(axes=bottom, x=place, values=mean, errors=mean_error, width=0.38, colour=PALETTE[k + 1], label=kind)
        _printed(top, place + 0.1, names, (printed or {}).get(f"3σ {kind}", {}), label=k == 1)
    finish_dispersion(top)
    top.set_ylabel("average 3σ [g·m²]")
    bottom.set_ylabel("average |mean error|\n[g·m²]")
    bottom.tick_params(axis="x", length=0)
    bottom.grid(axis="y", color=GRID, linewidth=0.5)
    bottom.set_xticks(x, [label(name) for name in names])
    legend_above(figure)
    figure.align_ylabels()
    return figure


def _bars(
    axes: Axes, x: np.ndarray, values: np.ndarray, errors: np.ndarray, width: float, colour: str, label: str
) -> None:
    """Draw bars with their standard errors, in g·m²."""
    values, errors = GRAM_METRE * values, GRAM_METRE * errors
    axes.bar(x, values, 0.92 * width, color=colour, label=label, linewidth=0)
    axes.errorbar(x, values, errors, **ERROR_BAR)


def _printed(axes: Axes, x: np.ndarray, names: list[str], values: Mapping[str, float], label: bool) -> None:
    points = [(place, values[name]) for place, name in zip(x, names, strict=True) if name in values]
    if points:
        style: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "markeredgewidth": 0.8, "markersize": 4}
        axes.plot(*zip(*points, strict=True), "D", linestyle="none", label="paper" if label else None, **style)
