"""Gram sums of plain signals: what the tests hold the solver against."""

import jax

from identify.least_squares.gram import sums_of
from identify.rigid_body.regressor import features


@jax.jit
def accumulate(omega, alpha, force, moment):
    """The sums of one block of samples, component first."""
    return sums_of(features(omega, alpha), force, moment)
