"""Probability of a cause, given the residuals of all runs: its coefficients under a prior, against none of it.

A run's own unknowns are eliminated in the run, under their priors; those that the runs share, the tensor and the rig's
errors, once, from the sums of all runs. So a prior that all runs share counts once, and what a declared uncertainty
explains is no evidence.

The evidence is the logarithm of a Bayes factor (Kass and Raftery, doi:10.1080/01621459.1995.10476572). The prior is a
mixture of normal distributions about zero, whose tails are heavy: most rigs err by the typical size, a few by many
times as much. The noise is an estimate from the residuals, so that Student's t stands in place of the normal
distribution. The chance of residuals that follow a cause by accident is Hotelling's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.errors.error_model import ErrorModel
from identify.least_squares.residual_spectrum import leverage
from identify.least_squares.row_products import inverse, products, solution
from identify.signals.filters import moving_average

SMOOTHED = 10
"""Lines of one run on each side over which the residuals' spectrum is taken.

Choice: 21 lines, whose mean square scatters by a third.
"""
FEWEST = 4.0
"""Residuals a coefficient that a cause needs to be judged at all.

Choice: fewer leave no residuals that Hotelling's chance could be from.
"""
SCALES = np.array([1.0, 3.0, 10.0, 30.0, 100.0])
"""Standard deviations of the prior's parts, in typical sizes."""
WEIGHTS = np.array([0.9, 0.09, 0.009, 0.0009, 0.0001])
"""Probability of each part.

Choice: one rig in ten errs by three times the typical size, one in a hundred by ten times, and so on: a gain of 6 % is
found, one of 800 % is no gain.
"""


@dataclass(frozen=True, eq=False)
class FittedLines:
    """The lines of one run, and how its own unknowns and those that runs share change them."""

    departure: Float[np.ndarray, "m rows"]
    """Measured less predicted force and moment, or the moment alone, with all unknowns at their prior's mean."""
    frequency: Float[np.ndarray, " m"]
    """Frequency of each line [Hz]."""
    run_columns: Float[np.ndarray, "m rows q"]
    """Change of the residuals by a unit of each of the run's own unknowns."""
    run_precision: Float[np.ndarray, " q"]
    shared: Float[np.ndarray, "m rows s"]
    """Change by a unit of each unknown that runs share."""

    @cached_property
    def normal(self) -> Float[np.ndarray, "q q"]:
        """Matrix of the normal equations of the run's own unknowns, with their prior."""
        return products(self.run_columns, self.run_columns) + np.diag(self.run_precision)

    def project_out_own(self, columns: Float[np.ndarray, "m rows p"]) -> tuple[np.ndarray, np.ndarray]:
        """Return columns with the run's own unknowns projected out, and the coefficients of these, (q, p)."""
        follows = np.linalg.solve(self.normal, products(self.run_columns, columns))
        return columns - self.run_columns @ follows, follows

    @cached_property
    def reduced(self) -> Float[np.ndarray, "m rows s"]:
        """Columns of the shared unknowns, the run's own projected out."""
        return self.project_out_own(self.shared)[0]

    @cached_property
    def information(self) -> Float[np.ndarray, "s s"]:
        """Normal matrix of the shared unknowns by this run, (s, s)."""
        return products(self.reduced, self.shared)


Lines = Sequence[np.ndarray]
"""Lines of some signals in each run, (m, rows, p), where m is the run's; zeros where a run has none of it."""


class Projection(NamedTuple):
    """Signals with the fitted unknowns projected out, (m, rows, p) in each run, and the coefficients of these."""

    remaining: list[np.ndarray]
    by_shared: Float[np.ndarray, "s p"]
    by_run: list[np.ndarray]


@dataclass(frozen=True, eq=False)
class NullModel:
    """The model without a cause, which all runs together have fitted, line by line."""

    runs: tuple[FittedLines, ...]
    precision: Float[np.ndarray, "s s"]
    """Precision of the shared unknowns: of their prior, and of what other runs say of them."""
    ten: Float[np.ndarray, "10 s"]
    """Change of mass, r_CG and tensor by a unit of each shared unknown [kg, m, kg·m²]."""

    @cached_property
    def normal(self) -> Float[np.ndarray, "s s"]:
        """Matrix of the shared unknowns' normal equations."""
        return self.precision + np.sum([run.information for run in self.runs], axis=0)

    @cached_property
    def residuals(self) -> list[np.ndarray]:
        """Residuals of each run with the unknowns at their best, (m, rows)."""
        return [rows[:, :, 0] for rows in self.project_out([run.departure[:, :, None] for run in self.runs]).remaining]

    @cached_property
    def leverage(self) -> list[np.ndarray]:
        """Leverage of each line, the diagonal of the hat matrix, by run, (m, rows)."""
        # diagonal of the hat matrix by blocks: the run's own unknowns, then the shared ones beside them
        by_shared = inverse(self.normal)
        by_run = [((run.run_columns @ inverse(run.normal)) * run.run_columns).sum(axis=2) for run in self.runs]
        return [taken + leverage(run.reduced, by_shared) for taken, run in zip(by_run, self.runs, strict=True)]

    @cached_property
    def order(self) -> np.ndarray:
        """Order of the lines of all runs by frequency."""
        return np.argsort(np.concatenate([run.frequency for run in self.runs]), kind="stable")

    def stacked(self, lines: Lines) -> np.ndarray:
        """Return the lines of all runs in the order of frequency."""
        return lines[0] if len(self.runs) == 1 else np.concatenate(list(lines))[self.order]

    @property
    def width(self) -> int:
        """Lines over which the residuals' spectrum is taken, an odd number."""
        return (2 * SMOOTHED + 1) * len(self.runs) | 1

    @property
    def noise(self) -> list[np.ndarray]:
        """Standard deviation of the noise on the lines of each run, from the residuals of all, (m, rows, 1)."""
        residuals = self.stacked(self.residuals)
        # one spectrum of all runs: a cause of the rig must not differ from run to run by a run's own noise level
        power = np.empty_like(residuals)
        power[self.order] = spectrum(residuals, 1 - self.stacked(self.leverage), self.width)
        deviation = np.sqrt(np.maximum(power, 1e-300))[:, :, None]
        return np.split(deviation, np.cumsum([len(run.frequency) for run in self.runs])[:-1])

    def weighted(self, noise: Lines) -> "NullModel":
        """Return the model with each line in units of its noise, whose standard deviation is given."""
        runs = [
            replace(
                run, departure=run.departure / deviation[:, :, 0], run_columns=run.run_columns / deviation,
                shared=run.shared / deviation,
            )
            for run, deviation in zip(self.runs, noise, strict=True)
        ]  # fmt: skip
        return replace(self, runs=tuple(runs))

    def project_out(self, columns: Lines) -> Projection:
        """Return columns with all fitted unknowns projected out (Frisch, Waugh and Lovell)."""
        # block elimination: first each run's own unknowns, then what all runs share (Schur complement)
        projected_runs = [run.project_out_own(part) for run, part in zip(self.runs, columns, strict=True)]
        right = np.sum([products(run.reduced, part) for run, part in zip(self.runs, columns, strict=True)], axis=0)
        by_shared = np.linalg.solve(self.normal, right)
        pairs = list(zip(self.runs, projected_runs, strict=True))
        return Projection(
            remaining=[part - run.reduced @ by_shared for run, (part, _) in pairs],
            by_shared=by_shared,
            by_run=[by_run - run.project_out_own(run.shared)[1] @ by_shared for run, (_, by_run) in pairs],
        )

    def extended(self, columns: Lines, scale: float = 1.0) -> "NullModel":
        """Return the model with further unknowns that all runs share, of a prior of this size."""
        s, p = len(self.precision), columns[0].shape[2]
        runs = [
            replace(run, shared=np.concatenate([run.shared, column], axis=2))
            for run, column in zip(self.runs, columns, strict=True)
        ]
        precision = np.eye(s + p) / scale**2
        precision[:s, :s] = self.precision
        return NullModel(tuple(runs), precision, np.hstack([self.ten, np.zeros((10, p))]))

    @cached_property
    def single_runs(self) -> list["NullModel"]:
        """Each run by itself, given what the others say of the unknowns that they share."""
        if len(self.runs) == 1:
            return [self]
        rights = [products(run.reduced, run.departure[:, :, None]) for run in self.runs]
        right = np.sum(rights, axis=0)
        bases = []
        for run, right_of_run in zip(self.runs, rights, strict=True):
            # a run given the others: their information is its prior, and their estimate that prior's mean
            precision = self.normal - run.information
            departure = run.departure - (run.shared @ solution(precision, right - right_of_run))[:, :, 0]
            bases.append(replace(self, runs=(replace(run, departure=departure),), precision=precision))
        return bases


class Evidence(NamedTuple):
    """Evidence of the residuals for a cause."""

    error: ErrorModel
    size: Float[np.ndarray, " p"]
    """Typical size of each coefficient, in SI."""
    coefficients: Float[np.ndarray, " p"]
    """Mean of the cause's coefficients, given the residuals, in typical sizes."""
    covariance: Float[np.ndarray, "p p"]
    scale: float
    """Most probable scale of the prior, in typical sizes."""
    logarithm: float
    """Logarithm of the Bayes factor in favour of the cause."""
    chance: float
    """Probability of residuals that follow the cause as closely by accident."""
    predicted: float
    """Probability under the prior of a cause as large as its least-squares estimate."""
    share: float
    """Part of the residuals' squares that it explains."""
    power: float
    """Squares of what it leaves in the lines, the fitted unknowns at their best."""
    effects: Float[np.ndarray, "10 p"]
    """Errors in mass, r_CG and tensor of the fit by a typical size of each coefficient [kg, m, kg·m²]."""
    lines: list[np.ndarray]
    """Lines of the cause by run, for coefficients in typical sizes."""

    @property
    def values(self) -> Float[np.ndarray, " p"]:
        """Coefficients of the cause, in SI."""
        return self.size * self.coefficients

    @property
    def spread(self) -> Float[np.ndarray, " p"]:
        """Standard uncertainties of ``values``."""
        return self.size * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def with_odds(self, other: "Evidence") -> "Evidence":
        """Return the evidence with the odds, and so the coefficients, of the same cause in lines of one noise."""
        return self._replace(
            coefficients=other.coefficients, covariance=other.covariance, scale=other.scale, logarithm=other.logarithm,
            predicted=other.predicted,
        )  # fmt: skip

    @property
    def explained(self) -> Float[np.ndarray, "m rows"]:
        """Lines of the cause at its coefficients, of all runs."""
        return np.concatenate(self.lines) @ self.coefficients


def evidence(
    base: NullModel,
    error: ErrorModel,
    size: Float[np.ndarray, " p"],
    columns: Lines,
    *,
    white: bool = False,
    below: float = np.inf,
) -> Evidence | None:
    """Return what the residuals say of a cause; None: it makes nothing that the estimate does not absorb.

    Args:
        base: what is fitted.
        error: of the rig that it is.
        size: typical size of each coefficient, in SI.
        columns: its lines in each run, for coefficients in units of their size.
        white: whether all lines are in units of their noise; else that is from the residuals that the cause leaves.
        below: chance from which on it is None, too: of most causes in most runs nothing more need be computed.
    """
    # Frisch–Waugh–Lovell: of the cause's lines only what the fitted unknowns leave can show in the residuals
    absorbed, raw = base.project_out(columns), base.stacked(columns)
    residuals = base.stacked(base.residuals)
    reduced = base.stacked(absorbed.remaining)
    normal = products(reduced, raw)
    values, vectors = np.linalg.eigh((normal + normal.T) / 2)
    good = values > 1e-6  # a coefficient of its usual size that changes the residuals by less is not seen
    basis = vectors[:, good]
    signals = reduced @ basis
    taken = (signals**2 / values[good]).sum(axis=2)
    free = 1 - base.stacked(base.leverage) - taken
    if not good.any() or float(free.sum()) < FEWEST * good.sum():
        return None
    # eigenvectors of the normal matrix: each coefficient is its own least squares
    along = basis.T @ products(raw, residuals[:, :, None])[:, 0] / values[good]
    power = np.ones_like(residuals) if white else spectrum(residuals - signals @ along, free, base.width)
    # White's sandwich (doi:10.2307/1912934): scores by the noise's spectrum, and by the errors of the fit's priors
    scores = signals * np.sqrt(power)[:, :, None]
    by_prior = absorbed.by_shared.T @ base.precision @ absorbed.by_shared + np.sum(
        [(by_run.T * run.run_precision) @ by_run for run, by_run in zip(base.runs, absorbed.by_run, strict=True)],
        axis=0,
    )
    spread = (products(scores, scores) + basis.T @ by_prior @ basis) / np.outer(values[good], values[good])
    weight, count = moving_average(taken, base.width), len(along)
    # Kish's effective number, (Σ w)²/Σ w²: so many equal squares would scatter as these weighted ones
    shown = max(float(weight.sum() ** 2 / (weight**2).sum()), count)  # residuals that the spread of the scores is from
    # Hotelling's T²: the spread is itself from some residuals, so that F takes the place of chi-squared
    wald = float(along @ np.linalg.solve(spread, along))
    rest = shown - count + 1
    chance = float(scipy.special.fdtrc(count, rest, wald * rest / (shown * count)))
    if not chance < below:
        return None
    mixture = _mixture(along, spread, max(float(free.sum()), 1.0))
    after = residuals - signals @ mixture.mean
    before = float((residuals**2).sum())
    coefficients = basis @ mixture.mean
    return Evidence(
        error=error, size=size, coefficients=coefficients, covariance=basis @ mixture.covariance @ basis.T,
        scale=mixture.scale, logarithm=mixture.logarithm, chance=chance, predicted=mixture.predicted,
        share=(before - float((after**2).sum())) / max(before, 1e-300),
        power=float(np.square(signals @ mixture.mean).sum()),
        effects=base.ten @ absorbed.by_shared, lines=list(columns),
    )  # fmt: skip


class _Posterior(NamedTuple):
    mean: np.ndarray
    covariance: np.ndarray
    scale: float
    logarithm: float
    predicted: float


def _mixture(along: np.ndarray, spread: np.ndarray, freedom: float) -> _Posterior:
    """Posterior of coefficients with a least-squares estimate, under the mixture of priors; its Bayes factor."""
    count, unit = len(along), np.eye(len(along))
    # normal priors of several widths: together heavy tails, so that a gain of 6 % is found where 0.25 % is typical
    alone = max(float(along @ np.linalg.solve(spread, along)), 0.0)
    means, covariances, factors, tails = [], [], [], []
    for scale in SCALES:
        # the estimate b is N(0, τ² 1 + S) under a part of the prior, N(0, S) under none: the ratio is that part's
        # Bayes factor
        total = scale**2 * unit + spread
        weighed = np.linalg.solve(total, along)
        square = max(float(along @ weighed), 0.0)
        determinants = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(total)[1]
        # Student's t for the normal distribution, since the noise is known from so many residuals alone
        gained = freedom / 2 * (np.log1p(alone / freedom) - np.log1p(square / freedom))
        factors.append(gained + determinants / 2)
        tails.append(float(scipy.special.chdtrc(count, square)))
        # conditional normal distribution, T = τ² 1 + S: mean τ² T⁻¹ b, covariance τ² - τ⁴ T⁻¹ = (τ⁻² + S⁻¹)⁻¹
        # (Woodbury)
        means.append(scale**2 * weighed)
        covariances.append(scale**2 * (unit - scale**2 * np.linalg.inv(total)))
    # the Bayes factor of a mixture is the mean of its parts', and so are the moments of its posterior
    logarithms = np.log(WEIGHTS) + np.array(factors)
    logarithm = float(scipy.special.logsumexp(logarithms))
    part = np.exp(logarithms - logarithm)
    mean = part @ np.array(means)
    covariance = np.sum(
        [p * (c + np.outer(m - mean, m - mean)) for p, c, m in zip(part, covariances, means, strict=True)], axis=0
    )
    return _Posterior(mean, covariance, float(SCALES[np.argmax(part)]), logarithm, float(WEIGHTS @ np.array(tails)))


def spectrum(
    residuals: Float[np.ndarray, "m rows"], free: Float[np.ndarray, "m rows"], width: int = 2 * SMOOTHED + 1
) -> Float[np.ndarray, "m rows"]:
    """Return the mean square of the noise about each line, each row by itself: a smoothed periodogram.

    Args:
        residuals: on the lines, in the order of frequency.
        free: part of the noise that is left in each of them, as what is fitted follows the rest.
        width: lines over which it is taken, an odd number.
    """
    squares, parts = (moving_average(values, width) for values in (residuals**2, free))
    return np.asarray(squares / np.maximum(parts, 1e-3))
