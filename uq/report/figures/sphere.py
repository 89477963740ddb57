"""The figure of a motion's coverage of the sphere, and of acceleration and uncertainty about every axis."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase
from matplotlib.tri import Triangulation

from identify.results.measured_directions import AxisValues, rms_about, uncertainty_about
from identify.rigid_body.inertia import GRAM_METRE
from uq.report.figures.style import PAGE, PALETTE, RULE, new_figure

RIM = np.sqrt(2)
"""Radius of a half sphere's disc, in Lambert's azimuthal equal-area projection of the unit sphere."""

GROUND = "#f6f6f6"
"""Background colour of a disc, in dark pages too: the darkest colours are the largest values."""


def coverage(omega: np.ndarray, alpha: np.ndarray, covariance: np.ndarray) -> FigureBase:
    """Draw the directions of angular velocity and acceleration, and acceleration and uncertainty about every axis.

    Args:
        omega: angular velocity in B [rad/s], (n, 3).
        alpha: angular acceleration in B [rad/s²], (n, 3).
        covariance: of the packed tensor [(kg·m²)²].
    """
    figure = new_figure(PAGE, 4.4, layout="constrained")
    panels = figure.subplots(2, 3, width_ratios=(1, 1, 1.12))
    for row, path, name in zip(panels, (omega, alpha), ("ω [rad/s]", "α [rad/s²]"), strict=True):
        drawn = [_directions(panel, path, side) for panel, side in zip(row[:2], (1, -1), strict=True)]
        bar = figure.colorbar(drawn[0], ax=row[:2], shrink=0.75, aspect=14)
        bar.set_label(f"|{name[0]}|{name[1:]}")
        row[0].set_title(f"{name[0]}, half of +b3")
        row[1].set_title(f"{name[0]}, half of −b3")
    _about(figure, panels[0, 2], rms_about(alpha), "α about each axis", "rms [rad/s²]", weak="least")
    uncertainty = uncertainty_about(covariance)
    uncertainty = AxisValues(uncertainty.directions, GRAM_METRE * uncertainty.values)
    _about(figure, panels[1, 2], uncertainty, "moment of inertia about each axis", "u [g·m²]", weak="largest")
    return figure


def _disc(panel: Axes) -> None:
    """The rim, the axes b1 and b2 on it, and circles 30° and 60° from b3."""
    turn = np.linspace(0, 2 * np.pi, 181)
    panel.fill(RIM * np.cos(turn), RIM * np.sin(turn), color=GROUND, linewidth=0, zorder=0)
    for angle, width in ((90, 0.8), (60, 0.3), (30, 0.3)):
        radius = 2 * np.sin(np.deg2rad(angle) / 2)
        panel.plot(radius * np.cos(turn), radius * np.sin(turn), color=RULE, linewidth=width, zorder=3)
    panel.annotate("b1", (RIM, 0), (5, 0), textcoords="offset points", va="center", fontsize=7)
    panel.annotate("b2", (0, RIM), (0, 1), textcoords="offset points", ha="center", fontsize=7)
    panel.set_aspect("equal")
    panel.set_axis_off()
    panel.set(xlim=(-1.05 * RIM, 1.2 * RIM), ylim=(-1.05 * RIM, 1.15 * RIM))


def _projected(directions: np.ndarray) -> np.ndarray:
    """Place of each direction of either half on its disc; the half of -b3 is seen through from +b3."""
    return directions[:, :2] * np.sqrt(2 / (1 + np.abs(directions[:, 2:])))


def _directions(panel: Axes, path: np.ndarray, side: int) -> Any:
    """Directions of one half, coloured by magnitude, large ones on top."""
    _disc(panel)
    size = np.linalg.norm(path, axis=1)
    here = (size > 0) & (side * path[:, 2] >= 0)
    order = np.flatnonzero(here)[np.argsort(size[here])]
    at = _projected(path[order] / size[order, None])
    return panel.scatter(at[:, 0], at[:, 1], c=size[order], s=2, linewidths=0, cmap="viridis_r", vmin=0,
                         vmax=max(size.max(), 1e-12),
                         rasterized=True)  # fmt: skip


def _about(figure: FigureBase, panel: Axes, values: AxisValues, title: str, label: str, *, weak: str) -> None:
    """A map of a figure of every axis, the weakest marked; empty where one is not determined."""
    _disc(panel)
    panel.set_title(title)
    if not np.isfinite(values.values).all():
        panel.text(0, 0, "not determined", ha="center", va="center")
        return
    at = _projected(values.directions)
    drawn = panel.tripcolor(Triangulation(*at.T), values.values, shading="gouraud", cmap="viridis_r",
                            vmin=0, vmax=max(values.values.max(), 1e-300), rasterized=True)  # fmt: skip
    figure.colorbar(drawn, ax=panel, shrink=0.75, aspect=14, label=label)
    (place,) = _projected(getattr(values, weak)[0][None])
    panel.plot(*place, "x", color=PALETTE[6], markersize=6, markeredgewidth=1.4, zorder=4, label="weakest axis")
    panel.legend(loc="lower center", bbox_to_anchor=(0.5, -0.14))
