"""Averages over components, as the source's Table 2 and figure 5 state them, with their standard errors."""

from typing import NamedTuple

import numpy as np

from uq.campaign.campaign import MonteCarloResult


class Average(NamedTuple):
    """Averages over some components of the total [kg·m²]."""

    three_sigma: float
    three_sigma_standard_error: float
    mean_error: float
    """Average magnitude of the mean errors."""
    mean_error_standard_error: float


def average(result: MonteCarloResult, trajectory: str, estimator: str, components: tuple[int, ...]) -> Average:
    """Return the average 3σ over components and the average magnitude of their mean errors.

    The standard errors are taken from the trials themselves (each trial's first-order influence on the average), so
    that they hold for components that go together. Trials that failed are left out.
    """
    index = list(result.breakdowns[trajectory]).index(estimator)
    errors = result.errors[trajectory][:, index, 0][:, list(components)]
    errors = errors[np.isfinite(errors).all(axis=1)]
    if len(errors) < 2:
        return Average(np.nan, np.nan, np.nan, np.nan)
    mean, sigma = errors.mean(0), errors.std(0, ddof=1)
    spread = 3 * ((errors - mean) ** 2 - sigma**2) / np.where(sigma > 0, 2 * sigma, 1)
    root = np.sqrt(len(errors))
    return Average(
        3 * float(sigma.mean()),
        float(spread.mean(1).std(ddof=1) / root),
        float(np.abs(mean).mean()),
        float((np.sign(mean) * (errors - mean)).mean(1).std(ddof=1) / root),
    )
