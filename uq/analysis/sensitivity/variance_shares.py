"""Shares of a variance with their standard errors, from each trial's estimates of the effects."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uq.sources.quasi_random import standard_error


class Indices(NamedTuple):
    """Shares of the variance by player and output, and of all outputs together."""

    value: np.ndarray
    """Share of each player in the variance of each output, (players, outputs)."""
    standard_error: np.ndarray
    """Standard error of ``value``, (players, outputs)."""
    generalised: np.ndarray
    """Shares of the trace of the outputs' covariance, (players,): Lamboni, Monod, Makowski 2011,
    doi:10.1016/j.ress.2010.09.002; Gamboa, Janon, Klein, Lagnoux 2014, doi:10.1214/14-EJS895."""
    generalised_standard_error: np.ndarray
    """Standard error of ``generalised``, (players,)."""

    @property
    def sum(self) -> tuple[np.ndarray, float]:
        """Sum over the players: by output, and of all outputs together."""
        return self.value.sum(0), float(self.generalised.sum())

    def widened(self, variance: np.ndarray, generalised: np.ndarray) -> "Indices":
        """Return the same with these variances added to those of the standard errors."""
        error = np.sqrt(self.standard_error**2 + variance)
        return self._replace(
            standard_error=error,
            generalised_standard_error=np.sqrt(self.generalised_standard_error**2 + generalised),
        )


def shares(effects: np.ndarray, variance: np.ndarray, weights: np.ndarray) -> Indices:
    """Return the shares that trials with unbiased estimates of effects and variance give.

    A share is a ratio of means, so that its standard error is that of the mean of its influence values ``(effect -
    share × variance) / mean variance`` (delta method), trials being independent. Its own bias falls as 1/trials. Of
    quasi-random trials the estimates are means over replicates.

    Args:
        effects: one estimate a trial, (trials, players, outputs).
        variance: one estimate of each output's variance a trial, (trials, outputs).
        weights: what each output counts in the generalised share, (outputs,).
    """
    value, error = ratio(effects, variance[:, None])
    generalised, generalised_error = ratio(effects @ weights, (variance @ weights)[:, None])
    return Indices(value, error, generalised, generalised_error)


def ratio(above: np.ndarray, below: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio of means over the leading axis, trials, with its standard error; NaN where below is zero."""
    if len(above) < 2:
        undefined = np.full(np.broadcast_shapes(above.shape[1:], below.shape[1:]), np.nan)
        return undefined, undefined
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(below.mean(0) > 0, below.mean(0), np.nan)
        value = above.mean(0) / mean
        influence = (above - value * below) / mean
    return value, standard_error(influence)


def closure(shared: np.ndarray, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio of two estimates of one variance, with the standard error that it has if they agree.

    The influence values are those at a ratio of one, ``(shared - sample) / mean sample``. At the ratio itself, as
    :func:`ratio` takes them, a ratio that is off by chance has too small an error: that of few trials, whose variances
    have a skew distribution, is then beyond two of them in ten cases of a hundred instead of five.

    Args:
        shared: terms of the variance that the effects share out, (trials, outputs).
        sample: terms of the ordinary sample variance, see :func:`plain_variance`.
    """
    value, _ = ratio(shared, sample)
    if len(sample) < 2:
        return value, value
    with np.errstate(invalid="ignore", divide="ignore"):
        influence = (shared - sample) / np.where(sample.mean(0) > 0, sample.mean(0), np.nan)
    return value, standard_error(influence)


def mean(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean over trials and its standard error; NaN of fewer than two trials."""
    if len(values) < 2:
        undefined = np.full(values.shape[1:], np.nan)
        return undefined, undefined
    return values.mean(0), standard_error(values)


def plain_variance(
    outputs: np.ndarray, averaged: Callable[[np.ndarray], np.ndarray] = lambda trials: trials
) -> np.ndarray:
    """Return terms of the ordinary sample variance of the outputs, averaged over equally distributed cases.

    Args:
        outputs: (trials, cases, outputs), every case with the distribution of Y.
        averaged: from trials to figures that are independent: means over replicates; the trials themselves.

    Returns:
        (figures, outputs), whose mean is the sample variance, unbiased: the scatter about the mean, and the mean's own
        variance.
    """
    groups = averaged(outputs)
    variance_of_mean = groups.var(0) / max(len(groups) - 1, 1)
    return np.asarray((averaged((outputs - groups.mean(0)) ** 2) + variance_of_mean).mean(1))
