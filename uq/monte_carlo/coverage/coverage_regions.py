"""Coverage regions of several outputs together (JCGM 102:2011, 7.7).

Each region states its coverage as found on trials that had no part in making it, with its standard error.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from uq.monte_carlo.coverage.coverage_intervals import check_probability, order_error

Draws = Float[np.ndarray, "trials outputs"]


class Figure(NamedTuple):
    """A figure with its standard error."""

    value: float
    standard_error: float


@dataclass(frozen=True)
class EllipsoidalRegion:
    """``(η - y)ᵀ U⁻¹ (η - y) ≤ k²`` (JCGM 102, 7.7.2), U the covariance matrix of the trials."""

    probability: float
    centre: np.ndarray
    covariance: np.ndarray
    factor: Figure
    """k_p, from the trials themselves; of normal outputs it would be :attr:`normal_factor`."""
    coverage: Figure
    """Share of the trials inside the region; region and count come from different halves of the trials."""

    @property
    def normal_factor(self) -> float:
        """k_p of normal outputs: the root of the quantile of χ² (JCGM 102, 6.5.2.3)."""
        return float(np.sqrt(scipy.special.chdtri(len(self.centre), 1 - self.probability)))


def ellipsoidal_region(draws: np.ndarray, probability: float = 0.95) -> EllipsoidalRegion:
    """Return the ellipsoidal coverage region of the trials (JCGM 102, 7.7.2).

    Raises:
        ValueError: fewer than 40 trials an output, outputs of which one follows from the others, or a probability that
            is not between 0 and 1.
    """
    draws = _checked(draws, probability)
    centre, covariance = draws.mean(0), covariance_of(draws)
    factor = quantile(distance(draws, centre, covariance), probability)
    first, second = draws[::2], draws[1::2]
    inside = np.concatenate([_inside(first, second, probability), _inside(second, first, probability)])
    share = float(np.mean(inside))
    coverage = Figure(share, float(np.sqrt(share * (1 - share) / len(inside))))
    return EllipsoidalRegion(
        probability=probability, centre=centre, covariance=covariance, factor=factor, coverage=coverage
    )


def quantile(values: Float[np.ndarray, " trials"], probability: float) -> Figure:
    """Return the quantile of a sample and its standard error, from the values around it."""
    ordered = np.sort(values)
    place = min(int(probability * len(ordered)), len(ordered) - 1)
    return Figure(float(ordered[place]), float(order_error(ordered, place, probability)))


def _checked(draws: np.ndarray, probability: float) -> Draws:
    """Return the trials that are finite, if there are enough and no output follows from the others."""
    draws = np.asarray(draws, float)
    check_probability(probability)
    if draws.ndim != 2:
        raise ValueError(f"Argument `draws` must have the shape (trials, outputs), but has {draws.shape}.")
    draws = draws[np.isfinite(draws).all(axis=1)]
    if len(draws) < 40 * draws.shape[1]:
        raise ValueError(
            f"Argument `draws` must hold {40 * draws.shape[1]} finite trials or more, but has {len(draws)}."
        )
    scale = draws.std(0)
    if not (scale > 0).all() or np.linalg.cond(np.corrcoef(draws, rowvar=False).reshape(len(scale), -1)) > 1e12:
        raise ValueError("Argument `draws` must have outputs that are independent, but one follows from the others.")
    return draws


def distance(points: Draws, centre: np.ndarray, covariance: np.ndarray) -> Float[np.ndarray, " trials"]:
    """Return each point's distance from the centre in standard deviations (Mahalanobis).

    Directions in which the outputs do not scatter count for nothing.
    """
    scale = scatter_of(covariance)
    strength, directions = np.linalg.eigh(covariance / np.outer(scale, scale))
    scattered = strength > 1e-12 * strength[-1]
    along = ((points - centre) / scale) @ directions[:, scattered]
    return np.linalg.norm(along / np.sqrt(strength[scattered]), axis=1)


def scatter_of(covariance: np.ndarray) -> np.ndarray:
    """Return each output's standard deviation, by which its figures are scaled; 1 where it does not scatter."""
    scatter = np.sqrt(np.diag(covariance))
    return np.where(scatter > 0, scatter, 1)


def _inside(draws: Draws, others: Draws, probability: float) -> np.ndarray:
    """Return the mask of the trials that lie in the region of other trials."""
    centre, covariance = others.mean(0), covariance_of(others)
    limit = np.quantile(distance(others, centre, covariance), probability)
    return distance(draws, centre, covariance) <= limit


def covariance_of(draws: Draws) -> Float[np.ndarray, "outputs outputs"]:
    """Return the covariance matrix of the trials, also of a single output."""
    return np.cov(draws, rowvar=False).reshape(draws.shape[1], draws.shape[1])
