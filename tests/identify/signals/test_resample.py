"""The spline through uniform samples, against SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from identify.signals.resample import uniform_spline


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize("count", [1, 3, 20, 3000])
def test_a_spline_through_uniform_samples_is_scipys(generator, degree, count):
    """Also its derivatives, and through the fewest samples; rounding is that of the coefficients' differences."""
    step, samples = 0.0125, np.cumsum(generator.normal(size=(degree + count, 2)), axis=0)
    t = step * np.arange(len(samples))
    ours, scipys = uniform_spline(samples, step, degree=degree), make_interp_spline(t, samples, k=degree)
    at = np.concatenate([t, generator.uniform(0, t[-1], 200)])
    for order in range(min(degree, 4)):  # the last one jumps at the nodes
        expected = scipys.derivative(order)(at) if order else scipys(at)
        np.testing.assert_allclose(ours(at, order), expected, atol=1e-11 * np.abs(expected).max())
