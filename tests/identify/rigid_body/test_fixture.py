"""The body without its fixture: against point masses, repeated draws, repeated laboratories; the command."""

import numpy as np
import pytest

from identify.exceptions import RunError
from identify.rigid_body.inertial_parameters import InertialParameters
from tests.helpers.point_masses import parameters, subtract, ten


@pytest.fixture
def clouds(generator):
    body, fixture = ((generator.uniform(0.1, 1, 6), generator.normal(size=(6, 3))) for _ in range(2))
    return body, fixture, tuple(np.concatenate(pair) for pair in zip(body, fixture, strict=True))


def test_body_and_fixture_of_point_masses_come_apart(clouds):
    body, fixture, whole = clouds
    left = subtract(parameters(ten(*whole)), parameters(ten(*fixture)))
    np.testing.assert_allclose(left.values, ten(*body), rtol=1e-10, atol=1e-12)


def test_the_covariance_is_that_of_repeated_draws_with_what_is_common(clouds, generator):
    """10,000 draws of both with common errors; first order at 0.03 % of scatter, so 5 standard errors of 1.4 %."""
    _, fixture, whole = clouds
    values = np.concatenate([ten(*whole), ten(*fixture)])
    root = 1e-4 * generator.normal(size=(20, 20))
    spread = root @ root.T
    left = subtract(
        parameters(values[:10], spread[:10, :10]), parameters(values[10:], spread[10:, 10:]), spread[:10, 10:]
    )
    draws = generator.multivariate_normal(values, spread, size=10_000)
    scale = np.sqrt(np.diag(left.covariance))
    error = (np.cov(_subtracted(draws).T) - left.covariance) / np.outer(scale, scale)
    assert np.abs(error).max() < 5 * np.sqrt(2 / 10_000)
    alone = subtract(parameters(values[:10], spread[:10, :10]), parameters(values[10:], spread[10:, 10:]))
    assert np.abs(alone.covariance / left.covariance - 1).max() > 0.1  # what is common does count


def _subtracted(draws):
    """The same by numpy, for many draws (n, 20): through the first and second moments about Q."""
    (m, r, tensor), (own, r_own, tensor_own) = (_about_q(part) for part in (draws[:, :10], draws[:, 10:]))
    left = m - own
    r_left = (m[:, None] * r - own[:, None] * r_own) / left[:, None]
    return np.hstack([left[:, None], r_left, tensor - tensor_own - left[:, None] * _steiner(r_left)])


def _about_q(ten):
    return ten[:, 0], ten[:, 1:4], ten[:, 4:] + ten[:, :1] * _steiner(ten[:, 1:4])


def _steiner(r):
    whole = np.einsum("ni,ni->n", r, r)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", r, r)
    return whole[:, *np.triu_indices(3)]


@pytest.mark.parametrize(
    ("whole", "part", "words"),
    [
        (1.0, 2.0, "the fixture has 2 kg, the body with it 1 kg"),
        (np.nan, 2.0, "no mass of the body with its fixture"),
        (1.0, np.nan, "no mass of the fixture"),
    ],
)
def test_masses_that_cannot_be_subtracted(whole, part, words):
    def of(mass):
        return InertialParameters(mass, np.zeros(3), np.array([1.0, 0, 0, 1, 0, 1]), np.zeros((10, 10)))

    with pytest.raises(RunError, match=words):
        subtract(of(whole), of(part))
