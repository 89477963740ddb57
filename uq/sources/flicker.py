"""Flicker noise, of spectrum 1/f: white noise half integrated, with first-order processes for its memory."""

import math
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from uq.sources.draws import BLOCK
from uq.sources.noise_filters import NoiseFilter


def pink_response(lags: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Return how flicker noise of B = 1 answers an impulse of white noise: half an integration, from rest.

    The filter ``(1 - z⁻¹)^(-1/2)`` of Kasdin (doi:10.1109/5.381848), whose response at lag k is ``∏ (j - 1/2) / j``,
    j = 1 … k; its spectrum is ``1 / (2π f)`` well below the sample rate.
    """
    return np.exp([math.lgamma(k + 0.5) - math.lgamma(k + 1) - math.lgamma(0.5) for k in lags])


LONGEST = 2**24
"""Lag up to which the first-order processes stand for the response: 11 hours at 400 Hz."""


def _processes() -> tuple[np.ndarray, np.ndarray]:
    """Decays of first-order processes, a sample, and weights with which they add up to the response from lag 1 on.

    Decay times in a geometric series; weights by least squares of the relative error, which is 3e-6 at most.
    """
    rates = np.exp(np.arange(math.log(4), math.log(0.2 / LONGEST), -0.7))
    lags = np.unique(np.round(np.concatenate([np.arange(1.0, 200), np.geomspace(200, LONGEST, 1500)])))
    regressors = np.exp(-np.outer(lags - 1, rates)) / pink_response(lags)[:, None]
    return np.exp(-rates), np.linalg.lstsq(regressors, np.ones(len(lags)), rcond=None)[0]


DECAYS, WEIGHTS = _processes()
PIECE = 60
"""Samples within which the response is taken as it is; what came before enters by the processes."""


def pink_block(
    white: Float[Array, "3 1200"], processes: Float[Array, "3 processes"]
) -> tuple[Float[Array, "3 1200"], Float[Array, "3 processes"]]:
    """Return a block of flicker noise of B = 1 from white noise of unit variance, and the processes after it.

    Args:
        white: of this block.
        processes: at the last sample of the block before, zero at the run's start.
    """
    dtype, pieces = white.dtype, BLOCK // PIECE
    within, ages = np.subtract.outer(np.arange(PIECE), np.arange(PIECE)), np.arange(PIECE)
    response = np.where(within >= 0, pink_response(np.arange(float(PIECE)))[np.abs(within)], 0)
    fresh = DECAYS[:, None] ** ages[::-1]  # of a piece's samples in the processes at its end
    after = WEIGHTS * DECAYS ** ages[:, None]  # of the processes before a piece in its samples
    since = np.subtract.outer(np.arange(pieces + 1), np.arange(pieces + 1))
    passed = np.where(since >= 0, DECAYS[:, None, None] ** (PIECE * np.maximum(since, 0)), 0)
    samples = white.reshape(3, pieces, PIECE)
    added = (samples @ fresh.T.astype(dtype)).astype(processes.dtype)
    added = jnp.concatenate([processes[:, None], added], axis=1)
    states = jnp.einsum("mij,cjm->cim", passed.astype(processes.dtype), added)
    pink = samples @ response.T.astype(dtype) + states[:, :-1].astype(dtype) @ after.T.astype(dtype)
    return pink.reshape(3, BLOCK), states[:, -1]


def _filtered(
    white: Callable[[Any], Float[Array, "3 1200"]], processes: Float[Array, "3 processes"], dtype: Any
) -> tuple[Float[Array, "3 1200"], Float[Array, "3 processes"]]:
    """Draw and filter in float32, which rounds to less than the filter's 3e-6; the processes keep their type."""
    return pink_block(white(np.dtype("float32")), processes)


FLICKER = NoiseFilter("flicker", pink_response, _filtered, lambda dtype: jnp.zeros((3, len(DECAYS)), dtype))
