"""Inputs of the law of propagation from error sources: variances, correlations, expectations.

Constant errors are numbers that are drawn once; the law needs their expectation and covariance, and how each of them
enters :class:`uq.sources.constant_errors.Errors`, which is linear. Noise is white, with a variance on each axis.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from uq.analysis.propagation.uncovered_sources import Peaks, check_law
from uq.monte_carlo.gram_sums.cases import Case
from uq.sources.constant_errors import PLACES, effect, no_errors
from uq.sources.distributions import Empirical, StudentT
from uq.sources.draws import Mixing
from uq.sources.source import SIGNALS, Source


class Constants(NamedTuple):
    """The D numbers that constant sources draw."""

    errors: np.ndarray
    """Matrix from the numbers to the errors (:class:`uq.sources.constant_errors.Errors`, raveled), (errors, D)."""
    owner: np.ndarray
    """Index of the source that draws each number."""
    mean: np.ndarray
    sigma: np.ndarray
    """Standard deviation of each number."""
    correlation: np.ndarray
    gum_ratio: np.ndarray
    """The GUM's standard uncertainty over the standard deviation: below 1 for Student's t (GUM 4.2, G.3)."""
    freedom: np.ndarray
    """Degrees of freedom of each number."""
    joint: np.ndarray
    """Sets of numbers that share their degrees of freedom: one row a set, 1 where a number belongs to it."""

    def covariance(self, acts: np.ndarray) -> np.ndarray:
        """Return the covariance of the numbers in each case, where some act (:attr:`CaseInputs.acts`)."""
        drawn = acts * self.sigma
        return np.asarray(drawn[:, :, None] * self.correlation * drawn[:, None, :])


class CaseInputs(NamedTuple):
    """Every case's inputs, the cases on the leading axis."""

    acts: np.ndarray
    """Mask of the D numbers that act in each case, 1 or 0."""
    wrench: np.ndarray
    """Covariance of the white noise of force and moment, (cases, 6, 6)."""
    gyro: np.ndarray
    """Variance of omega's white noise [rad²/s²], (cases, 3)."""


def constants_of(sources: Sequence[Source], mixing: Sequence[Mixing]) -> Constants:
    """Return what constant sources draw; each has a finite standard deviation (:func:`check_law`)."""
    constant = [source for source in sources if source.constant]
    sizes = np.array([np.size(source.sigma) for source in constant], int)

    def of_numbers(figure: Callable[[Source], Any]) -> np.ndarray:
        """A figure of each number, from its source."""
        values = [np.broadcast_to(np.asarray(figure(s), float), np.shape(s.sigma)).ravel() for s in constant]
        return np.concatenate([np.zeros(0), *values])

    # Student's t of scale 1 has the standard deviation √(ν/(ν - 2)), of which the GUM takes the 1
    gum_ratio = lambda s: 1 / s.shape.standard_deviation if isinstance(s.shape, StudentT) else 1.0  # noqa: E731
    owner = np.repeat(np.arange(len(constant)), sizes)
    sets = np.where(of_numbers(_rows) > 0, owner, len(constant) + np.arange(len(owner)))
    return Constants(
        errors=_linear_map(constant), owner=np.repeat(np.array([s.name for s in constant], str), sizes),
        mean=of_numbers(lambda s: s.mean), sigma=of_numbers(lambda s: s.standard_deviation),
        correlation=_correlation(constant, sizes, mixing), gum_ratio=of_numbers(gum_ratio),
        freedom=of_numbers(lambda s: s.shape.degrees_of_freedom),
        joint=(np.unique(sets)[:, None] == sets).astype(float),
    )  # fmt: skip


def _rows(source: Source) -> bool:
    return isinstance(source.shape, Empirical) and np.ndim(source.shape.samples) == 2


def _linear_map(constant: Sequence[Source]) -> np.ndarray:
    """Return the matrix from the numbers that are drawn to the errors, unit by unit."""
    units = [
        (source, unit.reshape(np.shape(source.sigma))) for source in constant for unit in np.eye(np.size(source.sigma))
    ]
    matrix = np.zeros((sum(map(np.size, no_errors())), len(units)))
    for column, (source, unit) in zip(matrix.T, units, strict=True):
        column[PLACES[str(source.perturbs)]] = np.ravel(effect(source, unit))
    return matrix


def _correlation(constant: Sequence[Source], sizes: np.ndarray, mixing: Sequence[Mixing]) -> np.ndarray:
    matrix, ends = np.eye(sum(sizes)), np.cumsum(sizes)
    place = {s.name: np.arange(end - n, end) for s, n, end in zip(constant, sizes, ends, strict=True)}
    for source in constant:
        if _rows(source):
            samples: Any = source.shape
            covariance = np.cov(np.array(samples.samples, np.float64), rowvar=False)
            spread = np.sqrt(np.where(np.diag(covariance) > 0, np.diag(covariance), 1))
            matrix[np.ix_(place[source.name], place[source.name])] = covariance / np.outer(spread, spread)
    for mix in mixing:
        if all(name in place for name in mix.names):
            where = np.concatenate([place[name] for name in mix.names])
            matrix[np.ix_(where, where)] = np.asarray(mix.correlation)
    return matrix


def inputs_of_cases(
    cases: Sequence[Case], constants: Constants, sources: Sequence[Source], mixing: Sequence[Mixing], rate: float,
    peaks: Peaks,
) -> CaseInputs:  # fmt: skip
    """Return what acts in each case.

    Args:
        cases: sets of sources.
        constants: what the constant ones draw.
        sources: all of them.
        mixing: which are correlated.
        rate: sample rate [Hz].
        peaks: how far the noise-free signals go.

    Raises:
        BeyondLawError: sources that the law cannot take
        (:func:`uq.analysis.propagation.uncovered_sources.beyond_the_law`).
    """
    check_law(sources, mixing, peaks)
    white = [(s, variance) for s in sources if (variance := s.white_variance(rate)) is not None]
    noisy = [source for source, _ in white]
    sigma = np.sqrt(np.concatenate([np.zeros(0), *(variance for _, variance in white)]))
    signals = np.hstack([np.zeros((9, 0)), *(np.eye(9, 3, -3 * SIGNALS.index(source.target)) for source in noisy)])
    # D ρ Dᵀ, D the standard deviations of the sources that act on each signal: independent noises add, correlated ones
    # cross
    drawn = signals * (sigma * _acting(cases, np.repeat([source.name for source in noisy], 3)))[:, None]
    summed = drawn @ _correlation(noisy, np.full(len(noisy), 3), mixing) @ drawn.swapaxes(1, 2)
    gyro = np.diagonal(summed, axis1=1, axis2=2)[:, 6:]
    return CaseInputs(_acting(cases, constants.owner), summed[:, :6, :6], gyro)


def _acting(cases: Sequence[Case], owner: np.ndarray) -> np.ndarray:
    """Mask of the numbers that act in each case, by the names of the sources that draw them."""
    return np.array([np.isin(owner, list(case.sources)) for case in cases], float)
