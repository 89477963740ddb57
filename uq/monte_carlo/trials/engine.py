"""An engine of trials: draws in, tensors out, for every set of sources that act together."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.motion.trajectory import Motion, Trajectory
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from uq.monte_carlo.gram_sums.cases import Case, Estimator
from uq.monte_carlo.gram_sums.error_maps import Platform
from uq.monte_carlo.trials.trial_loop import TrialLoop
from uq.sources.draws import Mixing
from uq.sources.source import Source


class TrialSetting(NamedTuple):
    """One trajectory of an experiment: all that its engines are prepared from."""

    motion: Motion
    """Samples of the true rotation and its derivatives."""
    trajectory: Trajectory
    """The rotation, which a delayed gyro reads at other instants."""
    body: Body
    platform: Platform
    sources: Sequence[Source]
    mixing: Sequence[Mixing]
    """Sources that are correlated."""
    estimators: Sequence[Estimator]


Estimates = Float[Array | np.ndarray, "trials estimators cases 6"]
"""Packed tensors that trials estimate [kg·m²]; NaN where a case could not be solved."""


class Engine(Pytree):
    """One experiment on one trajectory, prepared: everything that a trial needs besides its key.

    :class:`uq.monte_carlo.trials.sums_engine.SumsEngine` draws sums over samples,
    :class:`uq.monte_carlo.trials.samples_engine.SamplesEngine` every sample;
    :func:`uq.monte_carlo.trials.chooser.engine_of` chooses.
    """

    cases: tuple[Case, ...] = static_field()
    """The sets of sources that act together."""
    segment: ClassVar[int]
    """Number of trials, roughly, that a device does between two reports of progress."""

    @abstractmethod
    def batch(self, device: jax.Device) -> int:
        """Return how many trials a device does best at a time."""

    @abstractmethod
    def run(self, key: Key[Array, ""], indices: Int[Array, " trials"]) -> Estimates:
        """Return the estimates of a batch of trials; the trials are the leading axis.

        Args:
            key: the campaign's key, from its seed.
            indices: numbers of the trials, on which alone their draws depend.
        """

    def loop(
        self,
        seed: int,
        *,
        devices: Sequence[jax.Device] | None = None,
        batch: int | None = None,
        segment: int | None = None,
        **resumed: Any,
    ) -> TrialLoop:
        """Return the loop that runs this engine's trials; what is not given is as suits the engine.

        Args:
            seed: seed of every draw.
            devices: devices to spread the trials over; None for all.
            batch: trials that one device computes at a time.
            segment: about how many it computes between two reports of progress.
            resumed: ``done`` and ``keep`` of :class:`uq.monte_carlo.trials.trial_loop.TrialLoop`.
        """
        devices = list(devices or jax.devices())
        return TrialLoop(
            type(self).run, self, seed, devices=devices, batch=batch or self.batch(devices[0]),
            segment=segment or self.segment, **resumed,
        )  # fmt: skip
