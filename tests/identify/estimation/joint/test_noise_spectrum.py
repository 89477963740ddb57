"""Equations weighed by the noise's spectrum, against White's covariance in its plain form."""

import numpy as np
import pytest

from identify.estimation.joint.noise_spectrum import noise_spectrum

DRAW = np.random.default_rng(5)
COLUMNS, RESIDUALS = DRAW.normal(size=(400, 3, 7)), DRAW.normal(size=(400, 3)) / np.arange(1, 401)[:, None]
SIZES = 10.0 ** np.arange(-3, 4)


def spectrum(independent):
    return noise_spectrum(RESIDUALS, COLUMNS, np.zeros(7), 1e-9 * np.eye(3), inside=150, independent=independent)


@pytest.mark.parametrize("independent", [True, False])
def test_they_tell_the_inverse_of_whites_covariance(independent):
    """Whatever the units of the unknowns; lines above the band count with white noise."""
    noise, columns = spectrum(independent), COLUMNS * SIZES
    rows = np.tile(np.eye(3), (400, 1, 1))
    rows[:150] = noise.values
    if independent:
        assert not noise.values[:, 0, 1].any()
    bread = np.linalg.inv(np.einsum("map,maq->pq", COLUMNS, COLUMNS))
    covariance = bread @ np.einsum("map,mab,mbq->pq", COLUMNS, rows, COLUMNS) @ bread
    told = noise.weights(columns) @ np.einsum("map,maq->pq", columns, columns)
    np.testing.assert_allclose(np.linalg.inv(told * np.outer(1 / SIZES, 1 / SIZES)), covariance, rtol=1e-8, atol=1e-12)


def test_a_column_that_does_nothing_keeps_its_equation():
    """As do white lines: the prior alone tells it."""
    columns = COLUMNS.copy()
    columns[:, :, 4] = 0.0
    weights = spectrum(True).weights(columns)
    np.testing.assert_allclose(weights[4], np.eye(7)[4], atol=1e-12)
    np.testing.assert_allclose(weights[:, 4], np.eye(7)[4], atol=1e-12)
    few = np.delete(columns, 4, axis=2)
    others = np.delete(np.arange(7), 4)
    np.testing.assert_allclose(weights[np.ix_(others, others)], spectrum(True).weights(few), rtol=1e-9)
