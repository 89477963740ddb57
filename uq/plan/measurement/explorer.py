"""The widget of :func:`uq.plan.measurement.explore.explore`; needs anywidget, which nothing else does."""

import dataclasses
from importlib import resources
from typing import Any

import anywidget
import traitlets

from uq.experiment.experiment import Experiment
from uq.plan.measurement.adjustable_motion import changed

TEMPLATES = resources.files("uq").joinpath("templates")


class Explorer(anywidget.AnyWidget):
    """A table of sources with sliders; what it shows is computed in the browser."""

    _esm = TEMPLATES.joinpath("adjustable.js").read_text("utf-8")
    _css = TEMPLATES.joinpath("adjustable.css").read_text("utf-8")
    law = traitlets.Dict().tag(sync=True)
    """Numbers from which the browser computes the law."""
    state = traitlets.Dict().tag(sync=True)
    """State of the sliders: ``pair`` of trajectory and estimator, ``factors`` on the sources' figures, on ``duration``
    and on ``amplitude``; empty: all as stated. Setting it moves the sliders."""

    def __init__(self, experiment: Experiment, law: dict[str, Any]) -> None:
        super().__init__(law=law)
        self._stated = experiment

    @property
    def experiment(self) -> Experiment:
        """The experiment as the sliders stand: sources, and the trajectory that is shown."""
        if not self.state:
            return self._stated
        sources = tuple(
            source if factor == 1 else source.resized(float(factor))
            for source, factor in zip(self._stated.sources, self.state["factors"], strict=True)
        )
        name = self.law["pairs"][self.state["pair"]]["trajectory"]
        factors = (float(self.state[motion]) for motion in ("duration", "amplitude"))
        spec = changed(self._stated.trajectories[name], *factors)
        return dataclasses.replace(
            self._stated, sources=sources, trajectories={**self._stated.trajectories, name: spec}, document={}
        )
