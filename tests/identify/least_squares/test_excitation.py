"""Excitation: the verdict on identifiability."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.least_squares.run_information import excitation
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import omega_r


@pytest.fixture
def rows(generator):
    omega, alpha = (jnp.asarray(generator.normal(size=(400, 3))) for _ in range(2))
    return jax.jit(jax.vmap(omega_r))(omega, alpha)


@pytest.mark.parametrize(
    ("axis", "blind"), [(0, {"I22", "I23", "I33"}), (1, {"I11", "I13", "I33"}), (2, {"I11", "I12", "I22"})]
)
def test_rotation_about_one_axis_leaves_three_components_unseen(axis, blind):
    t = jnp.linspace(0, 20, 2001)
    unit_axis = jnp.zeros((1, 3)).at[0, axis].set(1.0)
    omega, alpha = jnp.sin(t)[:, None] * unit_axis, jnp.cos(t)[:, None] * unit_axis
    rows = np.asarray(jax.jit(jax.vmap(omega_r))(omega, alpha)).reshape(-1, 6)
    verdict = excitation(jnp.asarray(rows.T @ rows), jnp.zeros((6, 6)))
    assert set(verdict.unidentifiable) == blind
    assert verdict.identifiable.sum() == 3


def test_noise_that_would_dilute_by_more_than_a_tenth_does_not_count_as_excitation(rows):
    stacked = np.asarray(rows).reshape(-1, 6)
    normal = jnp.asarray(stacked.T @ stacked)
    assert excitation(normal, 0.01 * normal).identifiable.all()
    assert set(excitation(normal, 0.2 * normal).unidentifiable) == set(COMPONENTS)
