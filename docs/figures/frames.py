"""The frames and points of a recorded rig: docs/figures/frames.svg, drawn by gallery.py."""

from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, FancyArrowPatch, FancyBboxPatch, Rectangle

BODY, CELL, IMU, INK = "#0072B2", "#D55E00", "#009E73", "#404040"


def arrow(axes, start, step, color, label, *, offset=(0.0, 0.0), width=1.4):
    """One arrow from a point, with its label beyond the tip."""
    tip = (start[0] + step[0], start[1] + step[1])
    style = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0}
    axes.add_patch(FancyArrowPatch(start, tip, color=color, linewidth=width, **style))
    axes.text(tip[0] + offset[0], tip[1] + offset[1], label, color=color, ha="center", va="center", fontsize=8)


def draw():
    """The figure."""
    figure = Figure(figsize=(7.2, 4.3))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, 14.4)
    axes.set_ylim(0, 8.6)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.add_patch(Ellipse((5.6, 5.6), 6.2, 3.6, facecolor="#eef4fa", edgecolor=INK))
    axes.text(3.15, 6.5, "body", fontsize=9, color=INK)
    axes.add_patch(FancyBboxPatch((4.6, 2.5), 2.0, 1.0, boxstyle="round,pad=0.05", facecolor="#fbe9df", edgecolor=CELL))
    axes.text(4.4, 2.75, "load cell", fontsize=8, color=CELL, ha="right")
    axes.add_patch(Rectangle((1.2, 1.5), 9.0, 0.9, facecolor="#f2f2f2", edgecolor=INK))
    axes.text(2.0, 1.95, "moving platform", fontsize=9, color=INK, va="center")
    axes.add_patch(Rectangle((8.9, 2.45), 0.9, 0.6, facecolor="#e2f3ec", edgecolor=IMU))
    axes.text(9.9, 2.75, "IMU", fontsize=8, color=IMU, va="center")
    q, cg, p, accelerometer = (5.6, 3.55), (6.3, 6.0), (5.6, 2.75), (9.35, 2.75)
    for point, name, shift in ((q, "Q", (-0.32, 0.05)), (cg, "CG", (0.42, 0.15)), (p, "P", (-0.3, 0.0))):
        axes.plot(*point, "o", color=INK, markersize=4)
        style = {"fontsize": 9, "weight": "bold", "color": INK, "ha": "center", "va": "center"}
        axes.text(point[0] + shift[0], point[1] + shift[1], name, **style)
    axes.plot(*accelerometer, "o", color=IMU, markersize=4)
    arrow(axes, q, (0, 1.9), BODY, "b3", offset=(-0.3, 0.0))
    arrow(axes, q, (1.9, 0.15), BODY, "b1", offset=(0.32, 0.05))
    arrow(axes, q, (-0.95, 0.55), BODY, "b2", offset=(-0.25, 0.15))
    arrow(axes, q, (cg[0] - q[0], cg[1] - q[1]), INK, "", width=1.0)
    axes.text(6.35, 4.95, "r_cg_from_q", fontsize=8, color=INK, family="monospace")
    arrow(axes, q, (p[0] - q[0], p[1] - q[1] + 0.06), CELL, "", width=1.0)
    axes.text(5.75, 3.02, "wrench_point", fontsize=8, color=CELL, family="monospace")
    arrow(axes, q, (accelerometer[0] - q[0] - 0.06, accelerometer[1] - q[1] + 0.03), IMU, "", width=1.0)
    axes.text(7.5, 3.3, "imu_position", fontsize=8, color=IMU, family="monospace")
    arrow(axes, p, (0, -1.15), CELL, "x", offset=(-0.22, 0.05))
    arrow(axes, p, (1.15, -0.0), CELL, "z", offset=(0.2, -0.22))
    arrow(axes, accelerometer, (-0.85, 0), IMU, "x", offset=(-0.2, -0.1))
    arrow(axes, accelerometer, (0, 1.0), IMU, "z", offset=(0.25, 0.0))
    arrow(axes, (1.5, 5.2), (0, -1.5), INK, "g", offset=(-0.3, 0.1))
    notes = (
        (BODY, "body frame B, origin Q:", "every result, r_CG, every point"),
        (CELL, "the load cell's own axes:", "wrench_rotation_to_body"),
        (IMU, "the IMU's own axes:", "imu_rotation_to_body"),
        (INK, "F, M on the body:", 'wrench = "on_body"'),
        (INK, "F, M as the reaction:", 'wrench = "on_sensor"'),
    )
    for k, (color, what, key) in enumerate(notes):
        axes.text(10.35, 7.75 - 0.95 * k, what, fontsize=8, color=color)
        axes.text(10.35, 7.35 - 0.95 * k, key, fontsize=7.5, color=color, family="monospace")
    axes.text(0.3, 0.55, "M_Q = M_P + wrench_point × F        body = rotation · sensor", fontsize=9, color=INK)
    return figure
