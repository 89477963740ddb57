"""The square root of a covariance, regular, singular, and spoiled by rounding."""

import jax.numpy as jnp
import numpy as np

from uq.gram_sums.covariance_root import covariance_root


def covariance(generator, *, size, rank):
    columns = generator.normal(size=(size, rank)) * 10.0 ** generator.uniform(-3, 3, size=(size, 1))
    return columns @ columns.T


def departure(matrix, root):
    """Of the root's square from the matrix, in units of the standard deviations."""
    scale = np.sqrt(np.diag(matrix))
    scale[scale == 0] = 1
    return np.abs(np.asarray(root @ root.T) - matrix) / np.outer(scale, scale)


def test_a_root_squares_to_its_covariance_also_if_that_is_singular(generator):
    for rank in (13, 4):
        matrix = covariance(generator, size=13, rank=rank)
        matrix[5] = matrix[:, 5] = 0  # an element that is always zero
        root = np.asarray(covariance_root(jnp.asarray(matrix)))
        assert departure(matrix, root).max() < 5e-12  # 1e-12 is added to the diagonal
        assert (root == np.tril(root)).all()
        assert (root[5] == 0).all()


def test_a_singular_covariance_rounded_to_float32_has_a_root_nearly(generator):
    matrix = covariance(generator, size=13, rank=4)
    rounded = np.float64(np.float32(matrix))
    assert np.linalg.eigvalsh(rounded / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix))))[0] < -1e-9
    root = covariance_root(jnp.asarray(rounded))
    assert departure(matrix, root).max() < 1e-2  # the square root of what is rounded
