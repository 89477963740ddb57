"""Hausman's test: do two estimates from the same runs differ by more than their common errors allow?

Where the errors are what both estimates take them for, they differ by no more than the covariance of their difference;
a moment that the model lacks moves them apart (Hausman 1978, doi:10.2307/1913827). Here weights are compared with
ordinary least squares, and with the same weights and unknowns for what follows the motion: they decide which estimate
is the answer. :mod:`identify.judge.run_fit` compares ordinary least squares with the joint fit of force and
moment, where no cause was named.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from identify.least_squares.generalised_least_squares import Weighed
from identify.least_squares.pooling import NORMAL, PROBABILITY, Pooled
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE

CHANCE = 3e-3
"""Probability of a difference as large by chance, below which weights are not trusted.

Chance: of one comparison. A false alarm costs no more than the narrower interval.
"""
SMALL = 0.2
"""Difference over the standard uncertainty that counts as expected.

Price: at most 2 % of the standard uncertainty, ``hypot(1, 0.2)``.
"""


class EstimateDifference(NamedTuple):
    """Difference of another estimate from the one that is judged."""

    value: np.ndarray
    """Other estimate less the one that is judged, (6,) [kg·m²]."""
    covariance: np.ndarray
    """Expected covariance of ``value``, (6, 6) [(kg·m²)²]."""
    freedom: float = np.inf
    """Degrees of freedom that ``covariance`` is from."""
    half_width: np.ndarray = np.zeros(6)
    """Half-width of the other estimate's interval of 95 %, from noise and r_CG, (6,) [kg·m²]."""

    @property
    def chance(self) -> float:
        """Probability of a difference at least as large by chance: Hotelling's T², which tends to chi-square."""
        count, square = len(self.value), float(self.value @ np.linalg.solve(self.covariance, self.value))
        if np.isinf(self.freedom):
            return float(scipy.special.chdtrc(count, square))
        rest = self.freedom - count + 1
        return float(scipy.special.fdtrc(count, rest, square * rest / (self.freedom * count)))

    @property
    def largest(self) -> tuple[str, float, float]:
        """Name of the component that differs most for what is expected, its difference, what is expected [g·m²]."""
        spread = np.sqrt(np.diag(self.covariance))
        k = int(np.argmax(np.abs(self.value) / spread))
        return COMPONENTS[k], float(GRAM_METRE * self.value[k]), float(GRAM_METRE * spread[k])


def differences(
    runs: Sequence[Weighed], weighted: Pooled, plain: Pooled, centre_covariance: np.ndarray
) -> tuple[EstimateDifference, ...]:
    """Return the differences of ordinary least squares, and of the estimate with more unknowns, from weighted runs.

    Args:
        runs: with weights.
        weighted: their tensor with weights.
        plain: by ordinary least squares.
        centre_covariance: covariance of r_CG, (3, 3) [m²].

    Returns:
        Both; none where the motion does not determine the whole tensor.
    """
    if not (weighted.excitation.identifiable.all() and plain.excitation.identifiable.all()):
        return ()
    spread = np.linalg.inv(np.sum([run.extended.normal for run in runs], axis=0))
    extended = spread @ np.sum([run.extended.right for run in runs], axis=0)
    extended_by_centre = spread @ np.sum([run.extended.right_by_centre for run in runs], axis=0)
    zero = np.zeros((6, 6))
    others = (
        (
            plain.inertia,
            plain.by_centre,
            [np.hstack([zero, by_right, zero]) for by_right in plain.by_right],
            plain.bias,
        ),
        (extended, extended_by_centre, [np.hstack([zero, zero, spread])] * len(runs), np.zeros(6)),
    )
    return tuple(
        _difference(runs, weighted, other, by_centre, by_right, centre_covariance=centre_covariance, other_bias=bias)
        for other, by_centre, by_right, bias in others
    )


def _difference(
    runs: Sequence[Weighed],
    weighted: Pooled,
    other: np.ndarray,
    other_by_centre: np.ndarray,
    other_by_right: Sequence[np.ndarray],
    *,
    centre_covariance: np.ndarray,
    other_bias: np.ndarray,
) -> EstimateDifference:
    """One difference, from the other estimate, its derivatives by r_CG and by right sides, and its known bias."""
    by_centre = other_by_centre - weighted.by_centre
    by_right = [
        np.hstack([-by_first, by_three[:, 6:]])
        for by_first, by_three in zip(weighted.by_right, other_by_right, strict=True)
    ]

    def covariance(by_right: Sequence[np.ndarray], centre: np.ndarray) -> np.ndarray:
        noise = np.sum([j @ run.scores @ j.T for j, run in zip(by_right, runs, strict=True)], axis=0)
        return noise + centre @ centre_covariance @ centre.T

    value = other - weighted.inertia
    by_errors = np.sum([j @ run.by_errors for j, run in zip(by_right, runs, strict=True)], axis=0)
    # what the gyro's noise does to either is stated with it, and says nothing of the weights
    stated = np.outer(weighted.bias, weighted.bias) + np.outer(other_bias, other_bias)
    no_news = by_errors @ by_errors.T + SMALL**2 * weighted.covariance + stated
    expected = covariance(by_right, by_centre) + no_news
    freedom = max(float(np.min(weighted.together.residual_degrees_of_freedom)), len(value) + 1.0)
    factor = scipy.special.stdtrit(freedom, PROBABILITY)
    half_width = factor * np.sqrt(np.diag(covariance(other_by_right, other_by_centre)))
    return EstimateDifference(value, expected, freedom, half_width)


def reaching(plain: Pooled, weighted: Pooled, every: Sequence[EstimateDifference]) -> Pooled:
    """Return ordinary least squares with an interval that holds those of the other estimates, too.

    What residuals say of its uncertainty is widened for it, which declared sources then join as ever.
    """
    apart = weighted.inertia - plain.inertia
    needed = np.maximum(plain.half_width, np.abs(apart) + weighted.half_width)
    for difference in every:
        needed = np.maximum(needed, np.abs(apart + difference.value) + difference.half_width)
    centre_variance = np.diag(plain.covariance - plain.together.covariance)
    together = plain.together
    noise_half_width = np.sqrt(np.maximum(needed**2 - NORMAL**2 * centre_variance, together.half_width**2))
    student = scipy.special.stdtrit(together.residual_degrees_of_freedom, PROBABILITY)
    wider = noise_half_width / (student * np.sqrt(np.diag(together.from_residuals)))
    residual = together.from_residuals * np.outer(wider, wider)
    together = replace(together, from_residuals=residual)
    return plain._replace(
        covariance=together.covariance + plain.covariance - plain.together.covariance, residual=residual,
        together=together, half_width=np.hypot(together.half_width, NORMAL * np.sqrt(centre_variance)),
    )  # fmt: skip
