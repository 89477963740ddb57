"""Multisines: their rotation, rest at both ends, specific force."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.motion.attitude import attitude
from identify.motion.trajectory import sample
from tests.helpers.multisines import unstaged_multisine


@pytest.fixture(scope="module")
def multisine():
    return unstaged_multisine()


@pytest.mark.slow  # in stages: test_stages.py
def test_a_multisine_turns_as_its_rotation_vector_says(multisine):
    t = jnp.arange(0.0, 20.0, 1 / 400)
    rotation = jax.jit(lambda t: attitude(multisine.omega, t))(t)[::400]
    vectors = jax.jit(jax.vmap(multisine.coordinates))(t)[::400, 3:]
    np.testing.assert_allclose(rotation, Rotation.from_rotvec(np.array(vectors)).as_matrix(), atol=1e-9)


def test_a_multisine_rests_at_both_ends(multisine):
    ends = jnp.array([0.0, 20.0])
    motion = jax.jit(jax.vmap(lambda at: (multisine.coordinates(at), multisine.omega(at), multisine.alpha(at))))
    for values in motion(ends):
        np.testing.assert_allclose(values, 0, atol=1e-30)


def test_a_multisines_specific_force_is_that_of_its_path(multisine):
    """Second differences of where the centre of gravity is, against the campaign's own motion."""
    rate, offset = 2000.0, np.array([0.01, -0.02, 0.11])
    t = jnp.arange(6.0, 8.0, 1 / rate)
    coordinates = np.array(jax.jit(jax.vmap(multisine.coordinates))(t))
    rotation = Rotation.from_rotvec(coordinates[:, 3:])
    place = coordinates[:, :3] + rotation.apply(offset)
    acceleration = (place[2:] - 2 * place[1:-1] + place[:-2]) * rate**2
    expected = rotation[1:-1].inv().apply(acceleration + [0, 0, 9.81])
    whole = jnp.arange(0.0, 8.0, 1 / rate)
    sampled = jax.jit(lambda t: sample(multisine, t, r_cg_from_still=offset, gravity=np.array(9.81)).specific_force_cg)
    np.testing.assert_allclose(sampled(whole).T[12001:-1], expected, atol=2e-5)
