"""Gram sums of plain signals, and of signals with constant offsets: what the tests hold the engines against."""

import jax
import jax.numpy as jnp

from identify.estimators.gram import Sums, offset_features, sums_of
from identify.rigid_body.regressor import features


@jax.jit
def accumulate(omega, alpha, force, moment):
    """The sums of one block of samples, component first."""
    return sums_of(features(omega, alpha), force, moment)


@jax.jit
def with_offsets(sums, omega, force, moment):
    """The sums that would have come of samples with these constants added to omega, force and moment."""
    totals = sums.gram[:, 0]
    return Sums(
        offset_features(offset_features(sums.gram, omega).T, omega),
        offset_features(sums.force + jnp.outer(totals, force), omega),
        offset_features(sums.moment + jnp.outer(totals, moment), omega),
    )
