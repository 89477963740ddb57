"""Ordinary least squares beside the fit that uses force and moment: errors that both take for noise move them alike.

What the model lacks moves them apart (:mod:`identify.estimators.hausman`). Ordinary least squares of what the fit
leaves are their difference.
"""

import numpy as np

from identify.estimators.hausman import EstimateDifference
from identify.judge.evidence import Base, spectrum
from identify.judge.findings import MATTERS, Finding, signed
from identify.judge.run_fit import RunFit
from identify.results.declaration import ResidualCause
from identify.rounding import significant
from identify.sums.row_products import products

CHANCE = 1e-6
"""Chance of as large a difference below which the difference counts.

Chance: far below that of the named causes (1e-4), since the covariance counts as known and is from few lines.
"""


def cause(apart: EstimateDifference, run: str) -> ResidualCause:
    """Return the difference as a finding on a run."""
    component, value, expected = apart.largest
    return Finding.LEAST_SQUARES.cause(
        run, axis="", share=0.0, difference=signed(value), component=component, expected=significant(expected, 2)
    )


def difference(fit: RunFit, base: Base, standard_uncertainty: np.ndarray) -> EstimateDifference:
    """Return by how much ordinary least squares of the moment about r_CG differ from a run's fit.

    Args:
        fit: the run at its best.
        base: its unknowns, and what else is declared.
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
    value = np.einsum("miq,mi->q", gain, base.residuals)
    noise = gain * np.sqrt(spectrum(base.residuals, 1 - base.leverage))[:, :, None]
    along = products(base.columns, gain)
    covariance = products(noise, noise) - along.T @ np.linalg.solve(base.normal, along)
    values, vectors = np.linalg.eigh(covariance)
    no_news = np.diag((MATTERS * standard_uncertainty) ** 2)
    return EstimateDifference(value, (vectors * np.maximum(values, 0.0)) @ vectors.T + no_news)
