"""The step, the exponential, and a trajectory of one's own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.exceptions import RunError
from identify.motion.trajectory import Trajectory, step
from identify.rigid_body.rotation import exponential


def test_the_step_is_flat_finite_and_differentiable_everywhere():
    u = jnp.array([-1.0, 0.0, 1e-12, 1e-3, 0.5, 1 - 1e-12, 1.0, 2.0])
    np.testing.assert_allclose(jax.jit(jax.vmap(step))(u), [0, 0, 0, 0, 0.5, 1, 1, 1], atol=1e-12)
    slopes = jax.jit(jax.vmap(jax.grad(step)))(u)
    assert jnp.isfinite(slopes).all()
    np.testing.assert_allclose(slopes[jnp.array([0, 1, 2, 5, 6, 7])], 0)


def test_exponential_is_scipys_also_near_zero(generator):
    for size in (0.0, 1e-9, 1e-5, 1e-4, 1e-3, 1.0, 3.0):
        turn = size * generator.normal(size=3)
        np.testing.assert_allclose(exponential(jnp.asarray(turn)), Rotation.from_rotvec(turn).as_matrix(), atol=1e-14)


def test_one_exponential_is_that_of_many_vectors_in_numpy(generator):
    """Along any leading axes, each with its own branch: a tiny turn beside a large one."""
    turns = generator.normal(size=(3, 4, 3)) * np.array([1e-9, 1e-5, 1e-3, 2.0])[:, None]
    expected = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(3, 4, 3, 3)
    np.testing.assert_allclose(exponential(turns), expected, atol=1e-14)


def test_a_trajectory_of_ones_own_has_no_amplitude_and_says_what_to_do():
    """It needs nothing but its angular velocity; size and band are asked of it only by a rehearsal or a design."""

    class Rest(Trajectory):
        def omega(self, t):
            return jnp.zeros(3)

    with pytest.raises(RunError, match="a rest has no amplitude: rehearse it at a lower speed"):
        Rest().scaled(0.5)
    with pytest.raises(RunError, match="a rest states no highest frequency: choose another trajectory"):
        _ = Rest().highest_frequency
