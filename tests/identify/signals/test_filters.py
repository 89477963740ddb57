"""The filters on both sides."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy

from identify.signals.filters import apply, gaussian, moving_average, response


def test_the_gaussian_has_unit_gain_at_rest_and_minus_3_db_at_its_cutoff():
    rate, cutoff = 1000.0, 10.0
    taps = gaussian(rate, cutoff)
    gain = response(taps, rate, np.array([0.0, cutoff]))[1]
    assert taps.sum() == pytest.approx(1, abs=1e-15)
    assert gain == pytest.approx(1 / np.sqrt(2), rel=2e-4)  # cut at 4 σ


def test_apply_is_numpys_convolution(generator):
    signals, taps = generator.normal(size=(4, 200)), gaussian(100.0, 10.0)
    expected = [np.convolve(signal, taps, "valid") for signal in signals]
    np.testing.assert_allclose(apply(jnp.asarray(signals), jnp.asarray(taps)), expected, atol=1e-13)


def test_too_few_samples_are_refused():
    with pytest.raises(ValueError, match="must have 9 samples or more, but has 5"):
        apply(jnp.ones((1, 5)), jnp.ones(9))


@pytest.mark.parametrize(("count", "width"), [(1, 1), (2, 7), (100, 7), (1000, 40), (1000, 1000)])
@pytest.mark.parametrize(("ends", "mode"), [("symmetric", "reflect"), ("edge", "nearest")])
def test_the_moving_average_is_scipys(generator, count, width, ends, mode):
    signal = generator.normal(size=(count, 3))
    expected = scipy.ndimage.uniform_filter1d(signal, width, axis=0, mode=mode)
    np.testing.assert_allclose(moving_average(signal, width, ends=ends), expected, atol=1e-13)


@pytest.mark.parametrize(("count", "width"), [(1, 1), (2, 7), (100, 7), (1000, 40), (1000, 1000)])
def test_at_the_ends_a_moving_average_may_be_of_fewer_samples(generator, count, width):
    signal = generator.normal(size=(count, 3))
    expected = [signal[max(k - width // 2, 0) : k - width // 2 + width].mean(axis=0) for k in range(count)]
    np.testing.assert_allclose(moving_average(signal, width, ends="fewer"), expected, atol=1e-13)


def test_a_large_signal_does_not_spoil_the_moving_average_of_a_small_one():
    signal = np.repeat([1e9, 1e-9], 1000)
    np.testing.assert_allclose(moving_average(signal, 10)[1010:], 1e-9, rtol=1e-15)
