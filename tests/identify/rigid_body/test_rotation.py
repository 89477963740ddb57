"""Rotations as people write them, and gravity of a place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.rigid_body.gravity import normal_gravity
from identify.rigid_body.rotation import (
    closest_rotation,
    from_axes,
    from_quaternion,
    nearest_rotation,
    rotation_vectors,
)


def test_signed_axes_say_which_sensor_axis_each_body_axis_is():
    reading = np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(from_axes("-y, z, -x") @ reading, [-2, 3, -1])
    np.testing.assert_array_equal(from_axes(" Z,+x , y") @ reading, [3, 1, 2])


def test_a_quaternion_is_scipys(generator):
    x, y, z, w = Rotation.random(rng=generator).as_quat()
    np.testing.assert_allclose(from_quaternion(w, x, y, z), Rotation.from_quat([x, y, z, w]).as_matrix(), atol=1e-15)


def test_rotation_vectors_and_the_mean_rotation_are_scipys(generator):
    """Also near no turn and near half a turn, where one part of a quaternion vanishes."""
    angles = [np.zeros(1), 10.0 ** -generator.uniform(1, 17, 50), generator.uniform(0, np.pi, 200)]
    angles = np.concatenate([*angles, np.pi - 10.0 ** -generator.uniform(1, 12, 50)])
    axes = generator.normal(size=(len(angles), 3))
    turns = Rotation.from_rotvec(axes * (angles / np.linalg.norm(axes, axis=1))[:, None])
    np.testing.assert_allclose(rotation_vectors(turns.as_matrix()), turns.as_rotvec(), atol=4e-15)
    mean = closest_rotation(turns.as_matrix().mean(axis=0))
    np.testing.assert_allclose(mean, turns.mean().as_matrix(), atol=1e-14)


def test_a_rounded_matrix_becomes_the_rotation_nearest_to_it(generator):
    true = Rotation.random(rng=generator).as_matrix()
    nearest = nearest_rotation(np.round(true, 4))
    np.testing.assert_allclose(nearest @ nearest.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(nearest, true, atol=1e-4)


@pytest.mark.parametrize(
    ("latitude", "gravity"),
    # The ellipsoid's published values at the equator and at the pole (NIMA TR8350.2, table 3.4).
    [(0.0, 9.7803253359), (90.0, 9.8321849378), (-90.0, 9.8321849378)],
)
def test_gravity_on_the_ellipsoid(latitude, gravity):
    assert normal_gravity(np.deg2rad(latitude)) == pytest.approx(gravity, abs=2e-8)


def test_gravity_falls_with_height_as_in_free_air():
    """-0.3086 mGal/m at mid latitudes."""
    assert normal_gravity(np.pi / 4, 100.0) - normal_gravity(np.pi / 4) == pytest.approx(-30.86e-5, rel=1e-3)
