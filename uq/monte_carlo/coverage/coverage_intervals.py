"""Coverage intervals from the trials of a Monte Carlo (JCGM 101:2008, 7.7), and whether a law's hold (clause 8).

Regions of several outputs together are in :mod:`uq.monte_carlo.coverage.coverage_regions`; how many trials are enough,
in :mod:`uq.monte_carlo.coverage.adaptive_procedure`.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from uq.sources.quasi_random import Points, of_replicates, standard_error

Kind = Literal["symmetric", "shortest"]
Value = Any
"""A number or an array of numbers."""
SUBSAMPLES = 16
"""Parts into which the trials are cut for the standard errors of the shortest interval."""


@dataclass(frozen=True)
class CoverageInterval:
    """Ends of the interval of each output, with the standard errors that the finite number of trials leaves."""

    kind: Kind
    probability: float
    low: np.ndarray
    """Lower ends, of the output's shape; NaN where there are too few trials."""
    high: np.ndarray
    low_standard_error: np.ndarray
    high_standard_error: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """Upper minus lower end."""
        return np.asarray(self.high - self.low)


def symmetric_interval(
    draws: Float[np.ndarray, "trials *outputs"], probability: float = 0.95, points: Points = "random"
) -> CoverageInterval:
    """Return the probabilistically symmetric coverage intervals (JCGM 101, 7.7.2): as much on either side.

    With M trials in order, the ends are ``y_(r)`` and ``y_(r+q)``, q = pM and r = (M - q)/2, rounded as 7.7 has it. The
    standard errors are those of order statistics, from the trials around the ends, whatever the distribution.

    Args:
        draws: outputs of the trials; those that are not finite are left out, output by output.
        probability: coverage probability p, between 0 and 1.
        points: what the trials were drawn from; of quasi-random ones the standard errors are those of replicates.

    Raises:
        ValueError: the probability is not between 0 and 1, or there is no trial axis.
    """
    return _interval("symmetric", draws, probability, points, _symmetric)


def shortest_interval(
    draws: Float[np.ndarray, "trials *outputs"], probability: float = 0.95, points: Points = "random"
) -> CoverageInterval:
    """Return the shortest coverage intervals (JCGM 101, 7.7.4): of all ``[y_(r), y_(r+q)]``, the one of least length.

    The standard errors come from subsamples, scaled with the cube root of the number of trials, the rate at which the
    ends converge inside a smooth distribution (Kim and Pollard 1990, doi:10.1214/aos/1176347498). Where an end stands
    at the edge of the distribution it converges faster, and its standard error is too large.

    Args:
        draws: outputs of the trials; those that are not finite are left out, output by output.
        probability: coverage probability p, between 0 and 1.
        points: what the trials were drawn from; of quasi-random ones the standard errors are those of replicates.

    Raises:
        ValueError: the probability is not between 0 and 1, or there is no trial axis.
    """
    return _interval("shortest", draws, probability, points, _shortest)


def _interval(kind: Kind, draws: np.ndarray, probability: float, points: Points, ends) -> CoverageInterval:
    draws = np.asarray(draws, float)
    check_probability(probability)
    if draws.ndim == 0:
        raise ValueError("Argument `draws` must have the trials on its first axis, but is a single number.")

    def figures(trials: np.ndarray) -> np.ndarray:
        columns = trials.reshape(len(trials), math.prod(trials.shape[1:])).T
        by_output = [ends(column[np.isfinite(column)], probability) for column in columns]
        return np.array(by_output).reshape(-1, 4).T.reshape(4, *trials.shape[1:])

    ends_and_errors = figures(draws)
    if points == "quasi-random":
        ends_and_errors[2:] = standard_error(of_replicates(lambda trials: figures(trials)[:2], draws))
    return CoverageInterval(kind, probability, *map(np.asarray, ends_and_errors))


def check_probability(probability: float) -> None:
    """Refuse a coverage probability that cannot be.

    Raises:
        ValueError: it does not lie between 0 and 1.
    """
    if not 0 < probability < 1:
        raise ValueError(f"Argument `probability` must lie between 0 and 1, but is {probability}.")


def _inside(trials: int, probability: float) -> int:
    """Return q of 7.7.1: how many places the upper end stands above the lower one."""
    return int(probability * trials + 0.5)


def _symmetric(draws: np.ndarray, probability: float) -> tuple[float, ...]:
    y, q = np.sort(draws), _inside(len(draws), probability)
    if q >= len(y) or q < 1:
        return (math.nan,) * 4
    low = max((len(y) - q + 1) // 2 - 1, 0)
    high = min(low + q, len(y) - 1)
    tail = (1 - probability) / 2
    return y[low], y[high], order_error(y, low, tail), order_error(y, high, tail)


def order_error(ordered: np.ndarray, place: int, tail: float) -> float:
    """Return the standard error of an order statistic: the scatter of its rank, √(M p (1 - p)), times the spacing."""
    scatter = math.sqrt(len(ordered) * tail * (1 - tail))
    window = max(int(2 * scatter), 1)
    low, high = max(place - window, 0), min(place + window, len(ordered) - 1)
    return scatter * (ordered[high] - ordered[low]) / (high - low)


def _shortest(draws: np.ndarray, probability: float) -> tuple[float, ...]:
    low, high = _shortest_ends(draws, probability)
    size = len(draws) // SUBSAMPLES
    if _inside(size, probability) >= size:
        return low, high, math.nan, math.nan
    ends = [
        _shortest_ends(subsample, probability) for subsample in draws[: size * SUBSAMPLES].reshape(SUBSAMPLES, size)
    ]
    scatter = np.sqrt(np.mean((np.array(ends) - [low, high]) ** 2, axis=0)) * SUBSAMPLES ** (-1 / 3)
    return low, high, scatter[0], scatter[1]


def _shortest_ends(draws: np.ndarray, probability: float) -> tuple[float, float]:
    y, q = np.sort(draws), _inside(len(draws), probability)
    if q >= len(y) or q < 1:
        return math.nan, math.nan
    low = int(np.argmin(y[q:] - y[:-q]))
    return y[low], y[low + q]


@dataclass(frozen=True)
class Verdict:
    """Whether a law's coverage intervals agree with those of a Monte Carlo (JCGM 101, clause 8), output by output."""

    d_low: np.ndarray
    """Law's lower end minus the Monte Carlo's; the clause compares its magnitude."""
    d_high: np.ndarray
    tolerance: np.ndarray
    """δ, up to which both ends may differ."""
    resolution: np.ndarray
    """Twice the larger standard error of the Monte Carlo's ends: what this many trials can tell."""

    @property
    def distance(self) -> np.ndarray:
        """Distance of the ends that are further apart."""
        return np.asarray(np.maximum(np.abs(self.d_low), np.abs(self.d_high)))

    @property
    def holds(self) -> np.ndarray:
        """Whether both ends of the interval agree, so that the law is validated."""
        return np.asarray(self.distance <= self.tolerance)


def validate(low: Value, high: Value, interval: CoverageInterval, tolerance: Value) -> Verdict:
    """Compare a law's coverage intervals with a Monte Carlo's (JCGM 101, 8.1).

    ``d_low = |y - U_p - y_low|`` and ``d_high = |y + U_p - y_high|`` must both be within the numerical tolerance δ.

    Args:
        low: lower ends of the law's interval, of the output's shape.
        high: upper ends.
        interval: the Monte Carlo's, symmetric or shortest, of the same coverage probability.
        tolerance: δ, in the output's unit, as of
        :func:`uq.monte_carlo.coverage.adaptive_procedure.numerical_tolerance`.

    Raises:
        ValueError: the shapes differ.
    """
    if np.shape(low) != interval.low.shape or np.shape(high) != interval.high.shape:
        raise ValueError(f"Arguments `low` and `high` must have the shape {interval.low.shape} of the Monte Carlo's.")
    return Verdict(
        d_low=np.asarray(low - interval.low), d_high=np.asarray(high - interval.high),
        tolerance=np.broadcast_to(np.asarray(tolerance, float), interval.low.shape),
        resolution=np.asarray(2 * np.maximum(interval.low_standard_error, interval.high_standard_error)),
    )  # fmt: skip
