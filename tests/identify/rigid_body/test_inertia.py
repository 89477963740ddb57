"""Packing, frames and admissibility, against sums over point masses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.rigid_body.inertia import pack, parallel_axis, rotate, unpack
from identify.rigid_body.principal_axes import is_admissible, principal


def tensor_of_points(masses, points):
    """∫(δij |ζ|² - ζi ζj) dm of point masses."""
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))


@pytest.fixture
def body(generator):
    masses, points = generator.uniform(0.1, 1, 8), generator.normal(size=(8, 3))
    points -= masses @ points / masses.sum()
    return masses, points


def test_pack_and_unpack_are_inverse(body):
    tensor = jnp.asarray(tensor_of_points(*body))
    assert (unpack(pack(tensor)) == tensor).all()


def test_parallel_axis_is_the_tensor_about_the_other_point(body, generator):
    masses, points = body
    offset = generator.normal(size=3)
    moved = parallel_axis(
        pack(jnp.asarray(tensor_of_points(masses, points))), jnp.asarray(masses.sum()), jnp.asarray(offset)
    )
    np.testing.assert_allclose(unpack(moved), tensor_of_points(masses, points - offset), atol=1e-13)


def test_rotate_is_the_tensor_of_the_rotated_points(body, generator):
    masses, points = body
    rotation = Rotation.random(rng=generator).as_matrix()
    rotated = rotate(pack(jnp.asarray(tensor_of_points(masses, points))), jnp.asarray(rotation))
    np.testing.assert_allclose(unpack(rotated), tensor_of_points(masses, points @ rotation.T), atol=1e-13)


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
def test_principal_axes_diagonalise_and_are_right_handed(body, generator, batch):
    inertia = jnp.broadcast_to(pack(jnp.asarray(tensor_of_points(*body))), (*batch, 6))
    function = principal
    for _ in batch:
        function = jax.vmap(function)
    moments, axes = function(inertia)
    assert moments.shape == (*batch, 3)
    one_moments, one_axes = moments.reshape(-1, 3)[0], axes.reshape(-1, 3, 3)[0]
    tensor = tensor_of_points(*body)
    np.testing.assert_allclose(one_axes @ tensor @ one_axes.T, np.diag(one_moments), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(one_axes), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("moments", "admissible"),
    [((1, 2, 2.9), True), ((1, 2, 3.1), False), ((-0.1, 2, 2), False), ((0, 1, 1), False)],
)
def test_admissible_tensors_obey_the_triangle_inequality(moments, admissible, generator):
    rotation = jnp.asarray(Rotation.random(rng=generator).as_matrix())
    inertia = rotate(pack(jnp.diag(jnp.asarray(moments, float))), rotation)
    if moments[0] == 0:  # on the edge, rounding decides; a clearly negative one does not depend on it
        inertia = inertia - 1e-9 * pack(jnp.eye(3))
    assert bool(is_admissible(inertia)) is admissible


def test_a_body_of_points_is_admissible(body):
    assert is_admissible(pack(jnp.asarray(tensor_of_points(*body))))
