"""Figures of a design, with their captions: the platform in motion, the legs, the sphere, budgets, durations."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from identify.reporting import Drawing
from identify.results import measured_directions
from uq.campaign.statistics import Breakdown
from uq.experiment.experiment import Experiment
from uq.motion_design.hexapod import design_figures
from uq.motion_design.hexapod.design import Design
from uq.motion_design.hexapod.designed_experiment import NAME
from uq.motion_design.hexapod.platform_figures import moving, still
from uq.motion_design.hexapod.platform_scene import FRAMES, Scene, scene
from uq.motion_design.time_figure import time_figure
from uq.planning.platform_run import effort_of, motion_at
from uq.planning.required_duration import Duration
from uq.propagation.law_result import LawStatistics
from uq.report.drawing import drawing
from uq.report.figures.style import AXIS_COLOURS
from uq.report.tables.planning import duration_drawing

SHOWN = 10.0
"""Length of the motion that figures show, from its middle [s]."""
PLAYED = 5.0
"""Length of the motion that the moving drawing plays [s]."""
RATE = 100.0
"""Rate of the instants that figures draw [Hz]."""


def design_drawings(
    design: Design,
    laws: Mapping[str, Breakdown[LawStatistics]],
    bound: Mapping[str, float | None],
    durations: Sequence[Duration],
) -> list[Drawing]:
    """Return the figures, not yet drawn.

    Args:
        design: whose motion is drawn.
        laws: by trajectory, the designed one first.
        bound: the least average 3σ of moments and products [kg·m²]; None: not known.
        durations: that targets take.
    """
    motion, used = _shown(design)
    t = np.asarray(motion.t)
    omega, alpha = np.asarray(motion.twist.omega), np.asarray(motion.twist.alpha)
    visited = [f"{100 * measured_directions.visited(path):.0f} %" for path in (omega, alpha)]
    view = _scene(design.experiment, motion)
    position = np.asarray(motion.pose.position) - np.asarray(design.experiment.platform.home)
    paths = {"ω [rad/s]": omega, "α [rad/s²]": alpha, "displacement [mm]": 1e3 * position}
    totals = {name: law.total for name, law in laws.items()}
    return [
        Drawing(
            "platform", f"{view.seconds:g} s of the motion, as fast and as large; {VIEW}", partial(still, view),
            partial(moving, view),
        ),
        Drawing(
            "motion", f"{t[-1] - t[0]:.0f} s from the middle.",
            partial(time_figure, t, paths, ["axis 1", "axis 2", "axis 3"], AXIS_COLOURS),
        ),
        Drawing("legs", LEGS, partial(design_figures.legs, t, used, design.limits)),
        drawing("coverage", COVERAGE.format(*visited), "sphere.coverage", omega, alpha, laws[NAME].total.covariance),
        drawing("components", COMPONENTS_OF, "campaign.contributions", totals),
        Drawing("budgets", BUDGETS, partial(design_figures.budgets, laws, bound)),
        duration_drawing(durations),
    ]  # fmt: skip


def _shown(design: Design) -> tuple[Any, Any]:
    """Motion and effort of the design at the instants that figures show."""
    spec, experiment = design.spec, design.experiment
    shown = min(SHOWN, spec.duration)
    last = np.ceil((spec.duration + shown) / 2 * RATE) / RATE
    t = jnp.arange(0.0, last, 1 / RATE)
    run = motion_at(experiment, spec, t)
    motion = jax.tree.map(lambda x: x[len(t) - round(shown * RATE) :], run)
    return motion, effort_of(experiment, motion)


def _scene(experiment: Experiment, motion: Any) -> Scene:
    """Return the scene that the drawing of the platform shows."""
    step = round(RATE / FRAMES)
    shown = slice(0, round(PLAYED * RATE) + 1, step)
    position, rotation = (np.asarray(x)[shown] for x in motion.pose)
    seconds = (len(position) - 1) / FRAMES
    return scene(experiment.platform, experiment.body, experiment.r_cg_from_omb, position, rotation, seconds)


VIEW = "grey box: a cuboid of the body's mass and tensor; red dot: its centre of gravity."
COVERAGE = (
    "Directions in the body frame that the same seconds visit: within 15° of {} of all axes the angular velocity comes "
    "with half its largest magnitude or more, the angular acceleration within 15° of {}."
)
LEGS = "The legs over the same seconds, each against its own limit; dashed: the limit."
COMPONENTS_OF = "3σ and mean error of each component with each trajectory, all sources together."
BUDGETS = "Average 3σ of moments and of products, all sources and the largest alone; dashed: no motion can beat it."
