"""Options of a campaign: the way its trials are drawn, and where they are run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import jax

from rig.exceptions import quoted
from uq.campaign.statistics import Breakdown, Statistics
from uq.coverage.adaptive_procedure import Goal
from uq.experiment.experiment import ExperimentError
from uq.progress_bar import Progress
from uq.sources.quasi_random import REPLICATES, Points
from uq.trials.checkpoint import Checkpoint
from uq.trials.chooser import EngineName

LEAST_QUASI_RANDOM = 16 * REPLICATES
"""Fewer trials are random: a replicate's dispersion would be hardly known."""

ShownFigures = Callable[[str, int, Mapping[str, Breakdown[Statistics]]], None]
"""Called with the trajectory's name, the trials done and the breakdowns by estimator."""


@dataclass(frozen=True)
class SamplingPlan:
    """The way trials are drawn: on it their numbers depend, besides the seed and the experiment."""

    engine: EngineName = "sums"
    """``sums`` draws what the noise of all samples leaves in the sums that an estimate needs
    (:mod:`uq.trials.sums_engine`); cases that sums do not tell are computed by samples (:mod:`uq.trials.chooser`).
    ``samples`` draws every sample (:mod:`uq.trials.samples_engine`)."""
    points: Points = "random"
    """``quasi-random`` (:mod:`uq.sources.quasi_random`) for trials on sums in a number that is given, best 8 × 2^k."""
    dtype: str = "float64"
    """Precision of samples that are drawn, ``float64`` or ``float32``; sums over them have JAX's default precision."""
    goal: Goal | None = None
    """Run blocks of trials until estimate, standard uncertainty and coverage interval of every component, with all
    sources together, are stable for every trajectory and estimator (:mod:`uq.coverage.adaptive_procedure`); None: the
    number of trials is given."""

    def check(self, trials: int) -> None:
        """Refuse what cannot be.

        Raises:
            ExperimentError: no such engine, points that cannot be, too few trials for the goal.
        """
        if self.engine not in get_args(EngineName):
            raise ExperimentError(
                f"unknown engine {quoted(self.engine)}: choose one of {', '.join(get_args(EngineName))}"
            )
        possible = self.engine == "sums" and self.goal is None and trials >= LEAST_QUASI_RANDOM
        if self.points == "quasi-random" and not possible:
            raise ExperimentError(
                f"quasi-random trials are on sums, not adaptive, and {LEAST_QUASI_RANDOM} or more: leave points out"
            )
        if self.goal is not None and trials < 2 * self.goal.least_block:
            raise ExperimentError(f"{trials} trials: an adaptive campaign needs {2 * self.goal.least_block} or more")


@dataclass(frozen=True)
class RunOptions:
    """Options of the run that change no number: devices, batches, a checkpoint, progress."""

    devices: Sequence[jax.Device] | None = None
    """Devices to spread the trials over; None for all."""
    batch: int | None = None
    """Trials that one device computes at a time; None for what suits the engine."""
    checkpoint: Checkpoint | str | Path | None = None
    """Folder that keeps what is done, so that the same call goes on where it was interrupted."""
    progress: Progress | bool | None = None
    """Called after each segment of trials; True: a bar."""
    shown: ShownFigures | None = None
    """Called as a trajectory's figures come: by samples early, after 200 trials, and when it is done; not if
    adaptive."""
