"""Draws docs/figures/spheres.png: angular velocity and angular acceleration of the paper's motion T1, side by side."""

from pathlib import Path

import jax
import matplotlib

from uq import Experiment
from uq.report.figures.paper import rates, spheres
from uq.report.figures.style import STYLE


def draw():
    """The figure."""
    _, omega, alpha = rates(Experiment.load("barreto2016").trajectories["T1"])
    with matplotlib.rc_context(STYLE):
        figure = spheres(omega, alpha)
    figure.set_size_inches(7.2, 3.2)
    for place, axes in zip((0.0, 0.5), figure.axes, strict=True):
        axes.set_position((place, 0.06, 0.46, 0.88))
    return figure


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    draw().savefig(Path(__file__).with_suffix(".png"), dpi=110, pil_kwargs={"optimize": True})
