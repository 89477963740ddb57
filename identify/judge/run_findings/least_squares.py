"""Ordinary least squares and the fit of force and moment together disagree, and no cause explains it.

## What it looks like

The tensor that ordinary least squares of the moment about the centre of gravity give differs from that of the fit of
force and moment together, by more than noise lets it.

## Why it matters

Both estimate the same tensor from the same run. Where they differ, the model of the run is wrong in a way that moves
the two apart. The difference is added to covariance, interval and budget.

## How it is decided

After Hausman: the difference against its covariance, which is that of the residuals' spectrum; a difference that would
not matter counts as noise. Only where no cause is named. No error of the simulated laboratory shows in this alone.

## What to do

Look for a wrong r_CG, a cable, cross-talk of the load cell or a flexible mounting, or declare the errors that may act.
"""

import numpy as np

from identify.display.rounding import significant
from identify.judge.evidence import NullModel, spectrum
from identify.judge.findings import Finding, signed
from identify.judge.run_fit import RunFit
from identify.least_squares.hausman import EstimateDifference
from identify.least_squares.row_products import products
from identify.results.declaration import ResidualCause

DIFFERENT = 1e-6
"""Chance of as large a difference of ordinary least squares below which it counts.

Chance: far below that of the named causes (1e-4), since the covariance counts as known and is from few lines.
"""


class TwoEstimates(Finding):
    """A run's tensor by ordinary least squares apart from that by force and moment together."""

    component: str
    difference: float
    """Difference of the component [g·m²]."""
    expected: float
    """Difference that noise makes, a standard deviation [g·m²]."""

    @property
    def looks(self) -> str:
        return (
            "ordinary least squares and the fit of force and moment together differ by "
            f"{signed(self.difference)} g·m² in {self.component}, where {significant(self.expected, 2)} is expected"
        )

    cure = "usually a wrong r_CG, a cable, cross-talk or a flexible mounting"


EXAMPLES = (TwoEstimates(topic="run.mcap", component="I33", difference=-2.31, expected=0.42),)


def least_squares_cause(apart: EstimateDifference, run: str) -> ResidualCause:
    """Return the difference as a finding on a run."""
    component, value, expected = apart.largest
    differ = TwoEstimates(topic=run, component=component, difference=value, expected=expected)
    return differ.verdict(axis="", share=0.0)


def least_squares_difference(fit: RunFit, base: NullModel, no_news: np.ndarray) -> EstimateDifference:
    """Return by how much ordinary least squares of the moment about r_CG differ from a run's fit.

    Args:
        fit: the run at its best.
        base: its unknowns, and what else is declared; of this run alone.
        no_news: standard deviation of a difference of each component that would not matter, (6,) [kg·m²].
    """
    at, back, residuals = fit.prediction, np.linalg.inv(fit.lines.whitener), base.residuals[0]
    about_cg = np.eye(3)
    if at.force_from != "none":
        about_cg = np.hstack([-np.cross(np.eye(3), at.x["r_cg"]).T, about_cg])  # M - r × F of a wrench
    moved = np.zeros((*at.regressor.shape[:1], 6, 6))
    moved[:, 3:] = at.regressor - at.regressor.mean(axis=0)
    rows = back @ fit.transformed(moved)
    inverse = np.linalg.inv(products(rows, rows))
    gain = np.einsum("mkp,ki->mip", rows[:, -3:], about_cg @ back) @ inverse
    value = np.einsum("miq,mi->q", gain, residuals)
    noise = gain * np.sqrt(spectrum(residuals, 1 - base.leverage[0]))[:, :, None]
    taken = products(gain, gain) - products(gain, base.project_out([gain]).remaining[0])
    values, vectors = np.linalg.eigh(products(noise, noise) - taken)
    return EstimateDifference(value, (vectors * np.maximum(values, 0.0)) @ vectors.T + np.diag(no_news**2))
