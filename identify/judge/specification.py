"""Ordinary least squares beside the fit that uses force and moment: errors that both take for noise move them alike.

The difference of two estimates from one run is no larger than its covariance allows; what the model lacks moves them
apart (Hausman 1978, doi:10.2307/1913827). Ordinary least squares of what the fit leaves are that difference.
"""

from typing import NamedTuple

import numpy as np
import scipy

from identify.judge.evidence import Base, products, spectrum
from identify.judge.findings import Finding, signed
from identify.judge.run_fit import RunFit
from identify.results.residual_cause import ResidualCause
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import significant

CHANCE = 1e-6
"""Chance of as large a difference below which the difference counts."""
SMALL = 0.5
"""Difference over the standard uncertainty of the estimate that is no news."""


class Difference(NamedTuple):
    """Ordinary least squares less the fit."""

    value: np.ndarray
    """Ordinary least squares less the weighted fit, (6,) [kg·m²]."""
    expected: np.ndarray
    """Covariance of ``value`` that noise, the fit's priors and negligible differences explain, (6, 6) [(kg·m²)²]."""

    @property
    def clear(self) -> bool:
        """Whether the difference is larger than chance explains."""
        return bool(scipy.special.chdtrc(6, self.value @ np.linalg.solve(self.expected, self.value)) < CHANCE)

    def cause(self, run: str) -> ResidualCause:
        """Return the difference as a finding on a run."""
        spread = np.sqrt(np.diag(self.expected))
        worst = int(np.argmax(np.abs(self.value) / spread))
        figures = GRAM_METRE * self.value[worst], GRAM_METRE * spread[worst]
        return Finding.LEAST_SQUARES.cause(
            run, axis="", share=0.0, difference=signed(figures[0]), component=COMPONENTS[worst],
            expected=significant(figures[1], 2),
        )  # fmt: skip


def difference(fit: RunFit, standard_uncertainty: np.ndarray) -> Difference:
    """Return by how much ordinary least squares of the moment about r_CG differ from a run's fit.

    Args:
        fit: the run at its best.
        standard_uncertainty: of the estimate that is judged, (6,) [kg·m²].
    """
    at, back = fit.prediction, np.linalg.inv(fit.lines.whitener)
    about_cg = np.eye(3)
    if at.force_from != "none":
        about_cg = np.hstack([-np.cross(np.eye(3), at.x["r_cg"]).T, about_cg])  # M - r × F of a wrench
    moved = np.zeros((*at.regressor.shape[:1], 6, 6))
    moved[:, 3:] = at.regressor - at.regressor.mean(axis=0)
    rows = back @ fit.transformed(moved)
    inverse = np.linalg.inv(products(rows, rows))
    gain = np.einsum("mkp,ki->mip", rows[:, -3:], about_cg @ back) @ inverse
    value = np.einsum("miq,mi->q", gain, fit.residuals)
    base = Base(fit.residuals, fit.columns, fit.prior.counted)
    noise = gain * np.sqrt(spectrum(fit.residuals, 1 - base.leverage))[:, :, None]
    along = products(fit.columns, gain)
    covariance = products(noise, noise) - along.T @ np.linalg.solve(base.normal, along)
    values, vectors = np.linalg.eigh(covariance)
    no_news = np.diag((SMALL * standard_uncertainty) ** 2)
    return Difference(value, (vectors * np.maximum(values, 0.0)) @ vectors.T + no_news)
