"""Sums as a polynomial in the delay, against NumPy's polynomials."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial

from uq.monte_carlo.gram_sums.run_sums import RunSums, delay_nodes

LOW, HIGH = -2e-3, 6e-3
CURVE = Polynomial([3.0, -4e2, 5e4, 1e7, -2e9, 3e11, 1e14])  # of order one within the range, of the sixth degree


def interpolated(low=LOW, high=HIGH):
    nodes = delay_nodes(low, high)
    values = CURVE(nodes)[:, None, None, None] * np.array([1.0, 2.0])[:, None, None]
    return RunSums.through(nodes, values, -values)


@pytest.mark.parametrize("delay", [LOW, 0.0, 1.7e-3, HIGH])
def test_a_polynomial_of_their_degree_is_interpolated_with_its_derivatives(delay):
    """Exactly, but for rounding: 91, the condition of seven nodes, times 1e-16."""
    sums = interpolated()
    slope = sums.derivative()
    for order, computed in enumerate((sums, slope, slope.derivative())):
        expected, size = CURVE.deriv(order)(delay) if order else CURVE(delay), (HIGH - LOW) ** -order
        by_two = computed.of_estimator(1).at(delay)
        np.testing.assert_allclose(computed.at(delay).gram[0, 0, 0], expected, atol=1e-12 * size)
        np.testing.assert_allclose(
            [by_two.gram[0, 0], by_two.wrench[0, 0]], [2 * expected, -2 * expected], atol=2e-12 * size
        )


def test_trials_stand_last_and_jax_differentiates_it():
    sums, delays = interpolated().of_estimator(0), jnp.array([-1e-3, 2e-3, 5e-3])
    np.testing.assert_allclose(sums.at(delays).gram, CURVE(delays)[None, None], rtol=1e-12)
    slope = jax.grad(lambda delay: sums.at(delay).gram[0, 0])(2e-3)
    np.testing.assert_allclose(slope, sums.derivative().at(2e-3).gram[0, 0], rtol=1e-12)


def test_without_a_range_all_delays_have_the_same_sums():
    sums = interpolated(0.0, 0.0)
    for delay in (0.0, 1.0):
        np.testing.assert_array_equal(sums.at(delay).gram[0], CURVE(0.0))
    np.testing.assert_array_equal(sums.derivative().at(1.0).gram, 0.0)


def test_a_delay_beyond_the_range_counts_as_its_end():
    sums = interpolated()
    np.testing.assert_allclose([float(sums.nearest(x)) for x in (-1.0, 1e-3, 1.0)], [LOW, 1e-3, HIGH], atol=1e-18)
