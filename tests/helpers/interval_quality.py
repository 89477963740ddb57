"""How good 95 % intervals are: coverage alone does not see that they are too wide."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

FACTOR = 1.959964
"""Half-width of a normal interval of 95 % over its standard uncertainty."""


class Quality(NamedTuple):
    """What intervals hold and how wide they are."""

    held: float
    """Part that holds the truth, in %."""
    error_over_u: float
    """Root mean square of the error over u, half the width over 1.96: 1 is honest, less too wide, more too narrow."""
    score: float
    """Mean interval score over the largest component of the truth, in %."""

    def __str__(self) -> str:
        return f"{self.error_over_u:.2f} | {self.score:.2g}"


def interval_score(ends: Float[np.ndarray, "*n 2"], truth: Float[np.ndarray, "*m"]) -> Float[np.ndarray, "*n"]:
    """Return width plus 2/0.05 times the miss (Gneiting and Raftery 2007, doi:10.1198/016214506000001437, eq. 43)."""
    low, high = np.moveaxis(ends, -1, 0)
    return np.asarray(high - low + 2 / 0.05 * (np.maximum(low - truth, 0) + np.maximum(truth - high, 0)))


def error_over_u(ends: Float[np.ndarray, "*n 2"], truth: Float[np.ndarray, "*m"]) -> float:
    """Return the root mean square of the error over u."""
    half, error = np.ptp(ends, axis=-1) / 2, ends.mean(axis=-1) - truth
    return float(np.sqrt(np.mean((FACTOR * error / half) ** 2)))


def quality(ends: Float[np.ndarray, "*n 6 2"], truth: Float[np.ndarray, "*m 6"]) -> Quality:
    """Return how good the intervals of some tensors are."""
    held = (ends[..., 0] <= truth) & (truth <= ends[..., 1])
    score = interval_score(ends, truth) / np.abs(truth).max(axis=-1, keepdims=True)
    return Quality(100 * float(held.mean()), error_over_u(ends, truth), 100 * float(score.mean()))
