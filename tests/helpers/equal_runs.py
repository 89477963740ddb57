"""Runs of equal weight and motion, whose pooled tensor is their mean."""

import numpy as np

from identify.least_squares.pooling import Repeat, pooling

NORMAL = np.diag([400.0, 300, 300, 350, 300, 400])
OWN = np.array([1.0, 0.5, 0.5, 0.8, 0.5, 1.0])
"""Standard uncertainty of one run from its residuals."""


def pooled(tensors, mountings):
    """Runs of equal weight and motion: the pooled tensor is their mean."""
    mean, count = tensors.mean(axis=0), len(tensors)
    repeats = [
        Repeat(NORMAL @ (tensor - mean), tensor, OWN, alone=True, mounting=name)
        for tensor, name in zip(tensors, mountings, strict=True)
    ]
    return mean, pooling(repeats, np.linalg.inv(count * NORMAL), np.diag(OWN**2) / count, np.full(6, 1000.0))
