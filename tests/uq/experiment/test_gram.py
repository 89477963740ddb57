"""Sums of the preset's motions are well conditioned."""

import jax
import jax.numpy as jnp
import numpy as np

from identify.least_squares.gram import solve
from identify.rigid_body.regressor import omega_r
from tests.helpers.gram_lab import accumulate
from uq.monte_carlo.campaign.trial_setup import true_motion

R = jnp.array([0.01, -0.02, 0.053])


def test_conditioning_of_the_sums_is_enough_for_the_presets_motion(preset):
    """The normal equations square the condition number: on T1 that costs nothing."""
    motion = true_motion(preset, preset.trajectories["T1"])
    tensor = preset.body.inertia
    rows = jax.jit(jax.vmap(omega_r, in_axes=1))(motion.omega, motion.alpha)
    moment = (rows @ jnp.asarray(tensor)).T
    estimate = jax.jit(solve)(accumulate(motion.omega, motion.alpha, jnp.zeros_like(moment), moment), R)
    np.testing.assert_allclose(estimate.inertia, tensor, atol=1e-11 * tensor.max())
    assert estimate.condition < 100
