"""Quasi-random points against SciPy's, by the property that defines them, and standard errors of few replicates."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy import stats

from tests.helpers.jcgm_distributions import MultivariateNormal
from uq.sources.distributions import Normal, Triangular
from uq.sources.quasi_random import (
    BITS,
    REPLICATES,
    coordinates_of,
    of_replicates,
    sobol_points,
    standard_error,
    values_at,
)


def points(coordinates, trials, seed=0):
    return np.asarray(jax.jit(jax.vmap(sobol_points(coordinates, trials, seed).of_trial))(jnp.arange(trials)))


def test_points_are_scipys_under_a_digital_shift():
    """A replicate differs from SciPy's own scrambling by one pattern of binary digits in each coordinate."""
    theirs = stats.qmc.Sobol(7, bits=BITS, rng=np.random.default_rng([5, 7])).random(128)
    digits = [np.floor(x * 2.0**BITS).astype(np.uint32) for x in (points(7, 1000, seed=5), theirs)]
    patterns = [digits[0][replicate::REPLICATES] ^ digits[1][:125] for replicate in range(REPLICATES)]
    for pattern in patterns:
        np.testing.assert_array_equal(pattern, np.broadcast_to(pattern[0], pattern.shape))
    assert len(np.unique([pattern[0] for pattern in patterns])) == 7 * REPLICATES


def test_every_replicate_is_a_net():
    """After 2^k points each coordinate has one in each of 2^k equal parts of its range."""
    for replicate in np.split(points(20, 64 * REPLICATES).reshape(64, REPLICATES, 20), REPLICATES, axis=1):
        np.testing.assert_array_equal(
            np.sort(np.floor(64 * replicate[:, 0]), axis=0), np.arange(64)[:, None] + np.zeros(20)
        )


def test_a_point_depends_on_seed_and_number_alone():
    np.testing.assert_array_equal(points(5, 3000)[:100], points(5, 100))
    assert (points(5, 100, seed=1) != points(5, 100)).all()
    assert np.isfinite(points(5, 100, seed=-1)).all()


def test_points_are_within_the_open_cube():
    net = sobol_points(2, 8, 0)
    corners = [net._replace(shifts=jnp.full((REPLICATES, 2), word, jnp.uint32)) for word in (0, 2**BITS - 1)]
    for corner in corners:
        point = np.asarray(corner.of_trial(0))
        assert (point > 0).all()
        assert (point < 1).all()


def test_values_take_coordinates_by_name():
    """Names in alphabetical order, as many coordinates as each needs: two of a triangle, one of each joint normal."""
    inputs = {
        "b": Triangular(0.0, 2.0),
        "c": MultivariateNormal(np.zeros(2), np.diag([4.0, 9.0])),
        "a": Normal(1.0, 2.0),
    }
    point = np.array([0.3, 0.1, 0.5, 0.2, 0.6])
    assert coordinates_of(inputs) == 5
    values = values_at(inputs, jnp.asarray(point))
    np.testing.assert_allclose(values["a"], stats.norm(1, 2).ppf(0.3))
    np.testing.assert_allclose(values["b"], 0.6)
    np.testing.assert_allclose(np.abs(values["c"]), np.abs(stats.norm.ppf([0.2, 0.6]) * [2, 3]), rtol=1e-9)


def test_two_standard_errors_are_95_per_cent():
    """Student's t as SciPy has it, for eight figures and for many."""
    for n in (8, 20, 10_000):
        figures = np.random.default_rng(1).normal(size=n)
        widening = standard_error(figures) / (figures.std(ddof=1) / np.sqrt(n))
        assert abs(np.diff(stats.t(n - 1).cdf([-2 * widening, 2 * widening]))[0] - 0.95) < 0.006
    assert np.isnan(standard_error(np.ones(3)))


def test_replicates_take_turns():
    figures = of_replicates(lambda trials: trials.mean(0), np.arange(16.0) % REPLICATES)
    np.testing.assert_array_equal(figures, np.arange(REPLICATES))
