"""The ten parameters elsewhere: against point masses, a rigid-body library and repeated draws."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.exceptions import RunError
from identify.rigid_body.inertial_parameters import Datum
from identify.rigid_body.principal_axes import principal_axes
from tests.helpers.point_masses import PACKED, parameters, ten


def about_points(masses, points, origin):
    arms = points - origin
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, arms, strict=True))[PACKED]


@pytest.fixture
def cloud(generator):
    return generator.uniform(0.1, 1, 8), generator.normal(size=(8, 3))


def random_covariance(generator, values, part=1e-3):
    root = part * np.abs(values).mean() * generator.normal(size=(10, 10))
    return root @ root.T


def test_about_a_point_is_the_sum_over_point_masses(cloud, generator):
    point = generator.normal(size=3)
    tensor = parameters(ten(*cloud)).about(point)
    np.testing.assert_allclose(tensor.inertia, about_points(*cloud, point), rtol=1e-12)
    np.testing.assert_array_equal(tensor.covariance, 0)


def test_in_a_frame_is_the_sum_over_the_moved_point_masses(cloud, generator):
    masses, points = cloud
    rotation, origin = Rotation.random(rng=generator).as_matrix(), generator.normal(size=3)
    moved = parameters(ten(*cloud)).in_frame(rotation, origin)
    np.testing.assert_allclose(moved.values, ten(masses, (points - origin) @ rotation.T), rtol=1e-12, atol=1e-13)


def test_a_rigid_body_library_agrees_on_the_tensor_in_a_frame(generator):
    """MuJoCo's inertia about the joint's origin (the mass matrix of a ball joint there) is ours about Q."""
    masses, points = generator.uniform(0.1, 1, 8), 0.1 * generator.normal(size=(8, 3))
    values = ten(masses, points)
    i11, i12, i13, i22, i23, i33 = values[4:]
    full = " ".join(f"{x:.17g}" for x in (i11, i22, i33, i12, i13, i23))
    pos = " ".join(f"{x:.17g}" for x in values[1:4])
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><joint type="ball"/><inertial pos="{pos}" mass="{values[0]:.17g}" '
        f'fullinertia="{full}"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    matrix = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, matrix)
    np.testing.assert_allclose(parameters(values).about().inertia, matrix[PACKED], rtol=1e-10, atol=1e-12)


def test_covariances_elsewhere_are_those_of_repeated_draws(cloud, generator):
    """20,000 draws, moved one by one: each covariance in units of the stated one within 5 standard errors (1.6 %).

    First order: the draws scatter by 0.3 % of the values, so that the second order is below 1e-4.
    """
    values = ten(*cloud)
    covariance = random_covariance(generator, values)
    rotation, origin = Rotation.random(rng=generator), generator.normal(size=3)
    pose = 1e-3 * generator.normal(size=(6, 6))
    in_datum = parameters(values, covariance).in_datum(Datum(rotation.as_matrix(), origin, pose @ pose.T))
    about = parameters(values, covariance).about(origin, (pose @ pose.T)[3:, 3:])
    draws = generator.multivariate_normal(values, covariance, size=20_000)
    poses = generator.multivariate_normal(np.zeros(6), pose @ pose.T, size=20_000)
    tensors = np.zeros((20_000, 3, 3))
    tensors[:, *PACKED] = draws[:, 4:]
    tensors = tensors + np.triu(tensors, 1).transpose(0, 2, 1)
    turns = (Rotation.from_rotvec(poses[:, :3]) * rotation).as_matrix()
    arms = draws[:, 1:4] - origin - poses[:, 3:]
    moved = np.hstack([
        draws[:, :1],
        np.einsum("nij,nj->ni", turns, arms),
        (turns @ tensors @ turns.transpose(0, 2, 1))[:, *PACKED],
    ])  # fmt: skip
    steiner = np.einsum("ni,ni->n", arms, arms)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", arms, arms)
    elsewhere = (tensors + draws[:, :1, None] * steiner)[:, *PACKED]
    for drawn, stated in ((moved, in_datum.covariance), (elsewhere, about.covariance)):
        scale = np.sqrt(np.diag(stated))
        error = (np.cov(drawn.T) - stated) / np.outer(scale, scale)
        assert np.abs(error).max() < 5 * np.sqrt(2 / 20_000)


def test_there_and_back_is_where_it_began(cloud, generator):
    values = ten(*cloud)
    first = parameters(values, random_covariance(generator, values))
    rotation, origin = Rotation.random(rng=generator).as_matrix(), generator.normal(size=3)
    back = first.in_frame(rotation, origin).in_frame(rotation.T, -rotation @ origin)
    np.testing.assert_allclose(back.values, first.values, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(back.covariance, first.covariance, rtol=1e-9, atol=1e-15)


def test_principal_moments_and_axes_scatter_as_stated(generator):
    """4,000 draws: standard deviations within 5 standard errors, 1.1 % each, and 1 % of second order."""
    turn = Rotation.random(rng=generator).as_matrix()
    inertia = (turn.T @ np.diag([1.0, 2.0, 2.7]) @ turn)[PACKED]
    root = 4e-3 * generator.normal(size=(6, 6))
    stated = principal_axes(inertia, root @ root.T)
    assert stated.determined.all()
    assert stated.note is None
    draws = generator.multivariate_normal(inertia, root @ root.T, size=4000)
    tensors = np.zeros((4000, 3, 3))
    tensors[:, *PACKED] = draws
    moments, vectors = np.linalg.eigh(tensors, UPLO="U")
    axes = vectors.transpose(0, 2, 1)
    axes = axes * np.sign(np.einsum("nij,ij->ni", axes, stated.axes))[:, :, None]
    angles = Rotation.from_matrix(stated.axes @ axes.transpose(0, 2, 1)).as_rotvec()
    np.testing.assert_allclose(np.std(moments, axis=0), stated.standard_uncertainty, rtol=0.066)
    np.testing.assert_allclose(np.std(angles, axis=0), stated.angles, rtol=0.066)


def test_axes_of_moments_that_are_alike_are_not_determined():
    spread = 1e-4 * np.eye(6)
    rod = principal_axes(np.array([2.0, 0, 0, 2.001, 0, 1.0]), spread)
    assert rod.determined.tolist() == [True, False, False]
    assert rod.note == "the moments 2 and 3 are alike within their uncertainty: the axes 2, 3 are not determined"
    assert rod.to_dict()["axes_standard_uncertainty"][0] is None
    ball = principal_axes(np.array([1.0, 0, 0, 1, 0, 1]), spread)
    assert not ball.determined.any()
    assert "all three" in ball.note


def test_without_a_mass_the_frame_turns_and_the_point_stays(cloud, generator):
    values = ten(*cloud)
    covariance = random_covariance(generator, values)
    covariance[0] = covariance[:, 0] = 0
    covariance[0, 0] = np.nan
    values[0] = np.nan
    without_mass = parameters(values, covariance)
    turned = without_mass.in_frame(Rotation.random(rng=generator).as_matrix())
    assert np.isfinite(turned.covariance[1:, 1:]).all()
    assert np.isnan(turned.standard_uncertainty[0])
    assert turned.to_dict()["about_origin"] is None
    with pytest.raises(RunError, match="needs the mass"):
        without_mass.about()
