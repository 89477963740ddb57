"""Probability of a cause, given the residuals: its coefficients under a prior, against none of it.

The unknowns that a run's fit holds are eliminated under their own priors, so that what a declared uncertainty explains
is no evidence. The evidence is the logarithm of the Bayes factor of two normal distributions (Kass and Raftery,
doi:10.1080/01621459.1995.10476572). The chance of residuals that follow a cause by accident is Hotelling's.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.judge.findings import Finding
from identify.signals.filters import moving_average
from identify.sums.residual_spectrum import leverage
from identify.sums.row_products import inverse, products

SMOOTHED = 10
"""Lines on each side over which the residuals' spectrum is taken.

Choice: 21 lines, whose mean square scatters by a third.
"""
FEWEST = 4.0
"""Residuals a coefficient that a cause needs to be judged at all.

Choice: fewer leave no residuals that Hotelling's chance could be from.
"""


class Cause(NamedTuple):
    """Signals that a cause makes, and the size that it may well have."""

    finding: Finding
    columns: Float[np.ndarray, "n 6 p"]
    """Change of the measured wrench by a unit of each of p coefficients, at n instants."""
    size: Float[np.ndarray, " p"]
    """Typical standard deviation of each coefficient where no care was taken."""


@dataclass(frozen=True)
class Base:
    """The unknowns that a run's estimate has fitted, line by line."""

    residuals: Float[np.ndarray, "m rows"]
    """Residuals of m lines, of force and moment or the moment alone, with the unknowns at their best on these lines."""
    columns: Float[np.ndarray, "m rows q"]
    """Change of the residuals by a unit of each of q unknowns."""
    precision: Float[np.ndarray, " q"]
    """Precision of each unknown's prior."""

    @cached_property
    def normal(self) -> Float[np.ndarray, "q q"]:
        """Matrix of the unknowns' normal equations, with their prior, (q, q)."""
        return products(self.columns, self.columns) + np.diag(self.precision)

    @cached_property
    def leverage(self) -> Float[np.ndarray, "m rows"]:
        """Part of each residual's noise that the unknowns follow."""
        return leverage(self.columns, inverse(self.normal))

    def beside(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what the base does not absorb of some columns, and by how much the unknowns follow each, (q, p)."""
        follows = np.linalg.solve(self.normal, products(self.columns, columns))
        return columns - self.columns @ follows, follows

    def absorbing(self, columns: np.ndarray) -> "Base":
        """Return the base with further unknowns, of a prior of unit size."""
        covariance = np.linalg.inv(products(self.beside(columns)[0], columns) + np.eye(columns.shape[2]))
        coefficients = covariance @ products(columns, self.residuals[:, :, None])[:, 0]
        return self.taking(columns, coefficients)

    def taking(self, columns: np.ndarray, coefficients: np.ndarray) -> "Base":
        """Return the base with a cause in it, its prior of unit size, and the residuals that it leaves."""
        return Base(
            self.residuals - self.beside(columns)[0] @ coefficients,
            np.concatenate([self.columns, columns], axis=2),
            np.concatenate([self.precision, np.ones(columns.shape[2])]),
        )


class Evidence(NamedTuple):
    """Evidence of the residuals for a cause."""

    cause: Cause
    coefficients: Float[np.ndarray, " p"]
    """Coefficients of the cause, in units of its typical size."""
    covariance: Float[np.ndarray, "p p"]
    logarithm: float
    """Logarithm of the Bayes factor in favour of the cause."""
    chance: float
    """Probability of residuals that follow the cause as closely by accident."""
    share: float
    """Part of the residuals' squares that it explains."""
    shift: Float[np.ndarray, " q"]
    """Error that the cause makes in each unknown of the base."""
    columns: Float[np.ndarray, "m rows p"]
    """Lines of the cause's signals, for coefficients in units of its typical size."""

    @property
    def values(self) -> Float[np.ndarray, " p"]:
        """Coefficients of the cause, in SI."""
        return self.cause.size * self.coefficients

    @property
    def added(self) -> Float[np.ndarray, "n 6"]:
        """Change of the measured wrench by the cause [N], [N·m]."""
        return np.asarray(self.cause.columns @ self.values)

    @property
    def explained(self) -> Float[np.ndarray, "m rows"]:
        """Lines of the cause at its coefficients."""
        return np.asarray(self.columns @ self.coefficients)


def evidence(base: Base, cause: Cause, columns: Float[np.ndarray, "m rows p"]) -> Evidence | None:
    """Return what the residuals say of a cause; None: it makes nothing that the estimate does not absorb.

    Args:
        base: what is fitted.
        cause: its signals.
        columns: their lines, for coefficients in units of its size.
    """
    reduced, follows = base.beside(columns)
    normal = products(reduced, columns)
    values, vectors = np.linalg.eigh((normal + normal.T) / 2)
    good = values > 1e-6  # a coefficient of its usual size that changes the residuals by less is not seen
    basis = vectors[:, good]
    signals = reduced @ basis
    taken = (signals**2 / values[good]).sum(axis=2)
    free = 1 - base.leverage - taken
    freedom = float(free.sum())
    if not good.any() or freedom < FEWEST * good.sum():
        return None
    along = basis.T @ products(columns, base.residuals[:, :, None])[:, 0] / values[good]
    after = base.residuals - signals @ along
    # what the residuals' noise adds to a score, by its spectrum, and what the errors of the priors add
    scores = signals * np.sqrt(spectrum(after, free))[:, :, None]
    prior_covariance = basis.T @ (follows.T * base.precision) @ follows @ basis
    spread = (products(scores, scores) + prior_covariance) / np.outer(values[good], values[good])
    total = np.eye(len(along)) + spread
    wald = float(along @ np.linalg.solve(spread, along))
    logarithm = 0.5 * (
        wald - float(along @ np.linalg.solve(total, along)) - np.linalg.slogdet(total)[1] + np.linalg.slogdet(spread)[1]
    )
    weight, count = moving_average(taken, 2 * SMOOTHED + 1), len(along)
    shown = max(float(weight.sum() ** 2 / (weight**2).sum()), count)  # residuals that the spread of the scores is from
    chance = float(scipy.special.fdtrc(count, shown - count + 1, wald * (shown - count + 1) / (shown * count)))
    before = float((base.residuals**2).sum())
    share = (before - float((after**2).sum())) / max(before, 1e-300)
    return Evidence(
        cause=cause, coefficients=basis @ along, covariance=basis @ spread @ basis.T, logarithm=logarithm,
        chance=chance, share=share, shift=follows @ (basis @ along), columns=columns,
    )  # fmt: skip


def spectrum(residuals: Float[np.ndarray, "m rows"], free: Float[np.ndarray, "m rows"]) -> Float[np.ndarray, "m rows"]:
    """Return the mean squares of the noise on the lines about each, each row by itself.

    Args:
        residuals: on the lines.
        free: part of the noise that is left in each of them, as what is fitted follows the rest.
    """
    squares, parts = (moving_average(values, 2 * SMOOTHED + 1) for values in (residuals**2, free))
    return np.asarray(squares / np.maximum(parts, 1e-3))
