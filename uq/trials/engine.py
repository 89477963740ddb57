"""An engine of trials: draws in, tensors out, for every set of sources that act together."""

from abc import abstractmethod
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key

from identify.pytree import Pytree, static_field
from uq.gram_sums.cases import Case


class TrialEstimates(NamedTuple):
    """Estimates of trials."""

    inertia: Float[Array, "*trials estimators cases 6"]
    """Packed tensors [kg·m²]; NaN where a case could not be solved."""
    ok: Bool[Array, "*trials estimators cases"]
    """True where the normal equations could be solved."""

    @classmethod
    def none(cls, estimators: int) -> "TrialEstimates":
        """Return those of no case."""
        return cls(jnp.zeros((estimators, 0, 6)), jnp.zeros((estimators, 0), bool))


class Engine(Pytree):
    """One experiment on one trajectory, prepared: everything that a trial needs besides its key.

    :class:`uq.trials.sums_engine.SumsEngine` draws sums over samples, :class:`uq.trials.samples_engine.SamplesEngine`
    every sample; :func:`uq.trials.chooser.engine_of` chooses.
    """

    cases: tuple[Case, ...] = static_field()
    """The sets of sources that act together."""

    @abstractmethod
    def batch(self, device: jax.Device) -> int:
        """Return how many trials a device does best at a time."""

    @property
    @abstractmethod
    def segment(self) -> int:
        """Number of trials, roughly, that a device does between two reports of progress."""

    @abstractmethod
    def run(self, key: Key[Array, ""], indices: Int[Array, " trials"]) -> TrialEstimates:
        """Return the estimates of a batch of trials; the trials are the leading axis.

        Args:
            key: the campaign's key, from its seed.
            indices: numbers of the trials, on which alone their draws depend.
        """


def run_trials(engine: Engine, key: Key[Array, ""], indices: Int[Array, " trials"]) -> TrialEstimates:
    """Run a batch of trials, for :class:`uq.trials.trial_loop.TrialLoop`."""
    return engine.run(key, indices)
