"""Averages over components, as the paper's Table 2 and figure 5 state them, with their standard errors."""

from typing import NamedTuple

import numpy as np

from uq.campaign.campaign_result import MonteCarloResult
from uq.sources.quasi_random import of_replicates, standard_error
from uq.trials.trial_loop import finite_trials


class Average(NamedTuple):
    """Averages over some components of the total [kg·m²]."""

    three_sigma: float
    three_sigma_standard_error: float
    mean_error: float
    """Average magnitude of the mean errors."""
    mean_error_standard_error: float


def average(result: MonteCarloResult, trajectory: str, estimator: str, components: tuple[int, ...]) -> Average:
    """Return the average 3σ over components and the average magnitude of their mean errors.

    The standard errors are taken from the trials themselves (each trial's first-order influence on the average; its
    means over replicates of quasi-random trials), so that they hold for components that go together. Trials that failed
    are left out.
    """
    index = list(result.breakdowns[trajectory]).index(estimator)
    errors = result.errors[trajectory][:, index, 0][:, list(components)]
    good, _ = finite_trials(errors)
    if len(good) < 2:
        return Average(np.nan, np.nan, np.nan, np.nan)
    mean, sigma = good.mean(0), good.std(0, ddof=1)
    spread = 3 * ((errors - mean) ** 2 - sigma**2) / np.where(sigma > 0, 2 * sigma, 1)
    influence = np.stack([spread.mean(1), (np.sign(mean) * (errors - mean)).mean(1)], axis=1)
    if result.points == "random":
        figures, _ = finite_trials(influence)
    else:
        figures = of_replicates(lambda trials: finite_trials(trials)[0].mean(0), influence)
    sigma_standard_error, mean_standard_error = map(float, standard_error(figures))
    return Average(3 * float(sigma.mean()), sigma_standard_error, float(np.abs(mean).mean()), mean_standard_error)
