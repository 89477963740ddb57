"""The maximum a posteriori fit of one run, beside which causes are judged.

Gauss–Newton on the joint model's rows, on the lines of the cosine transform up to the motion's band: above it the
motion's derivatives hold the gyro's noise, which the residuals hold, too.

Ordinary least squares stand beside it: errors that both take for noise move them alike, what the model lacks moves them
apart (:mod:`identify.least_squares.hausman`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.estimation.joint.gauss_newton import linearised
from identify.estimation.joint.joint_model import SLICES, TEN, Model, SpecificForce, unknowns
from identify.estimation.joint.motion_signals import MotionSignals
from identify.estimation.joint.noise_spectrum import noise_spectrum
from identify.estimation.joint.predicted_wrench import Columns, PredictedWrench, about_centre
from identify.estimation.joint.priors import Alignment, Prior, Setting, indices
from identify.estimation.joint.single_run import gyro_noise, prepared, start_bias, start_up
from identify.judge.evidence import FittedLines, NullModel
from identify.least_squares.row_products import products, solution
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import PASSED, InBand
from identify.signals.run import Run

STEPS = 10
"""Most steps of Gauss–Newton, the first two of which set the weights.

Numerical: ``ENOUGH`` ends the search before.
"""
ENOUGH = 0.1
"""Last change of the unknowns, in standard uncertainties, behind which they are at their best.

Numerical: the change counts, and what it leaves over is of second order.
"""
OVER_BAND = 1.2
"""Highest frequency that is compared, over the motion's.

Choice: smoothers pass it whole; above, derivatives of the motion hold the gyro's noise.
"""


@dataclass(frozen=True)
class TransformedRows:
    """The cosine transform of rows up to the motion's band, in units of their noise."""

    interval: float
    band: float
    whitener: Float[np.ndarray, "rows rows"]

    def __call__(self, columns: Float[np.ndarray, "n rows p"]) -> Float[np.ndarray, "m rows p"]:
        """Return the lines of some columns."""
        count = int(2 * OVER_BAND * self.band * self.interval * len(columns))
        signals = columns.reshape(len(columns), -1)
        acting = signals.any(axis=0)  # most columns change few rows
        lines = np.zeros((count, signals.shape[1]))
        lines[:, acting] = scipy.fft.dct(signals[:, acting], axis=0, norm="ortho")[:count]
        return np.asarray(self.whitener @ lines.reshape(count, *columns.shape[1:]))

    def power_above(self, rows: Float[np.ndarray, "n rows"]) -> Float[np.ndarray, " rows"]:
        """Return the mean square of rows' lines above the motion's band, as far as the run's low-pass is flat."""
        lines = scipy.fft.dct(rows, axis=0, norm="ortho")
        first, last = (int(2 * over * self.band * self.interval * len(rows)) for over in (OVER_BAND, PASSED))
        return np.asarray(np.mean((lines[first:last] @ self.whitener.T) ** 2, axis=0))


class UnitLines(NamedTuple):
    """An error of the rig in one run: what a unit of each of its numbers makes."""

    lines: Float[np.ndarray, "m rows p"]
    size: Float[np.ndarray, " p"]
    """Typical size of each number in this run, in SI."""
    acting: Bool[np.ndarray, " p"]
    """Mask of the numbers that do anything."""


class TensorSums(NamedTuple):
    """A run's normal equations of the tensor (10), by columns that are added to its wrench."""

    normal: Float[np.ndarray, "6 6"]
    right: Float[np.ndarray, "6 p"]


@dataclass(frozen=True, eq=False)
class RunFit:
    """A run at its best."""

    prediction: PredictedWrench
    prior: Prior
    lines: TransformedRows
    residuals: Float[np.ndarray, "m rows"]
    columns: Float[np.ndarray, "m rows q"]
    """Change of the residuals by a unit of each of the prior's q coordinates."""
    z: Float[np.ndarray, " q"]
    """Coordinates at which ``prediction`` was made."""
    best: Float[np.ndarray, " q"]
    """Coordinates that leave ``residuals``."""
    above: Float[np.ndarray, " rows"]
    """Mean square of the residuals above the motion's band, in units of the noise."""
    errors: Mapping[str, UnitLines] = field(default_factory=dict)
    """Errors of the rig that are looked for, by their names."""
    beside: TensorSums | None = None
    """Sums of least squares with the errors that are no unknowns; None: of the joint estimate."""

    def transformed(self, columns: Columns) -> Float[np.ndarray, "m rows p"]:
        """Return the lines of changes of the wrench."""
        return self.lines(self.prediction.counted(columns))

    @property
    def frequency(self) -> Float[np.ndarray, " m"]:
        """Frequency of each line [Hz]."""
        return np.arange(len(self.residuals)) / (2 * self.lines.interval * self.prediction.model.used.sum())

    @cached_property
    def weights(self) -> Float[np.ndarray, "q q"]:
        """Weights of the equations of least squares beside priors, as the joint estimate takes them."""
        # residuals are in units of their noise: a floor against rounding is enough
        noise = noise_spectrum(
            self.residuals, self.columns, self.prior.counted, 1e-10 * np.eye(self.residuals.shape[1]),
            inside=len(self.residuals), independent=self.prediction.force_from == "still",
        )  # fmt: skip
        return noise.weights(self.columns)

    @cached_property
    def base(self) -> NullModel:
        """The model of this run without a cause."""
        return base_of([self], ())

    @property
    def level(self) -> Float[np.ndarray, "6"]:
        """Root mean square of the residuals of each row [N], [N·m]."""
        back = np.linalg.inv(self.lines.whitener)
        return np.asarray(np.sqrt(np.mean((self.residuals @ back.T) ** 2, axis=0)))


def base_of(fits: Sequence[RunFit], shared: Iterable[str]) -> NullModel:
    """Return the model without a cause of some runs together.

    Args:
        fits: of the runs, under one prior.
        shared: names of the unknowns that are the same in all runs, where there are several.
    """
    prior = fits[0].prior
    common = prior.root[indices(shared)].any(axis=0) if len(fits) > 1 else np.ones(len(prior.counted), bool)
    runs = [
        FittedLines(
            departure=fit.residuals + fit.columns @ fit.best, frequency=fit.frequency,
            run_columns=fit.columns[:, :, ~common], run_precision=prior.counted[~common],
            shared=fit.columns[:, :, common],
        )
        for fit in fits
    ]  # fmt: skip
    return NullModel(tuple(runs), np.diag(prior.counted[common]), prior.root[indices(TEN)][:, common])


def fit_run(run: Run, rows: InBand, setting: Setting, start: Mapping[str, np.ndarray]) -> RunFit:
    """Return a run's unknowns at their best.

    Args:
        run: the run.
        rows: that it is reduced to.
        setting: priors, and where the specific force comes from.
        start: unknowns from which the search starts elsewhere than at the prior's mean.
    """
    model, prior = prepared(rows, gyro_noise(run) / np.sqrt(run.rate), run.accelerometer_position, setting)
    z = prior.coordinates(start)
    if setting.specific_force == "none":
        model = with_force_of_motion(model, prior.theta(z), setting.alignment)
    elif setting.specific_force == "still":  # without a bias the attitude turns away, and the first steps are wild
        to_imu = exponential(prior.theta(z)[SLICES["rotation"]]).T
        z = prior.coordinates({**start, "gyro_bias": start_bias(model, to_imu, setting.alignment)})
    model = model.with_fast_transform()
    first = PredictedWrench(model, prior.theta(z)).signals
    wrench = np.hstack([first.force, first.moment])[:, :, None]
    shown = PredictedWrench(model, prior.theta(z)).counted(wrench)[:, :, 0]
    whitener = np.diag(1 / np.maximum(shown.std(axis=0), 1e-12))
    for step in range(STEPS):
        lines = TransformedRows(rows.interval, rows.band, whitener)
        at = linearised(model, prior, z, lines)
        # as the joint estimate: a ridge of 1 for coordinates with a standard normal prior
        normal = products(at.columns, at.columns) + np.diag(prior.counted)
        right = products(at.columns, at.residuals[:, :, None])[:, 0] - prior.counted * z
        change = solution(normal, right)
        remaining = at.residuals - at.columns @ change
        fit = RunFit(
            prediction=at.prediction, prior=prior, lines=lines, residuals=remaining, columns=at.columns, z=z,
            best=z + change, above=np.zeros(len(whitener)),
        )  # fmt: skip
        near = float(change @ normal @ change) < ENOUGH**2 * len(change)
        if step > 1 and (near or setting.specific_force == "none"):
            break
        whitener = np.linalg.inv(np.linalg.cholesky(_covariance(remaining, whitener, setting.specific_force, len(z))))
        if setting.specific_force != "none":  # else linear in what acts, but for what the estimate tells already
            z = z + change
    rows_of_best = at.prediction.counted(at.prediction.residuals[:, :, None])[:, :, 0]
    return replace(fit, above=lines.power_above(rows_of_best))


def with_force_of_motion(model: Model, theta: np.ndarray, alignment: Alignment) -> Model:
    """Return a run whose force is weight along the upward direction and mass times acceleration, by least squares.

    Where only moments about r_CG are compared: a cause's signals hold the force, and the measured one has noise that
    the residuals ``M - r × F`` hold, too, so that they would seem to follow the cause. The moment changes along, so
    that the moment about r_CG stays as it is.

    Args:
        model: the run; unchanged where there is no force.
        theta: unknowns, whose r_CG is that of the moment.
        alignment: prior of delay and rotation.
    """
    rows = model.rows
    if not np.linalg.norm(rows.force, axis=0).min() > 0:
        return model
    x, to_imu = unknowns(theta), exponential(np.asarray(alignment.rotation, float)).T
    bias = start_bias(model, to_imu, alignment)
    everywhere = replace(model, up=start_up(model, to_imu, bias), used=np.ones_like(rows.used))
    signals = MotionSignals(everywhere, {**x, "gyro_bias": bias})
    unit = np.broadcast_to(np.eye(3), (len(rows.t), 3, 3))
    columns = np.concatenate([signals.up[:, :, None], signals.levers, unit], axis=2)
    used = columns[rows.used].reshape(-1, 7)
    coefficients = np.linalg.lstsq(used, rows.force.T[rows.used].ravel(), rcond=1e-10)[0]
    force = (columns @ coefficients).T
    moment = rows.moment + np.cross(x["r_cg"], force - rows.force, axisb=0).T
    return replace(model, rows=replace(rows, force=force, moment=moment))


def _covariance(
    remaining: np.ndarray, whitener: np.ndarray, force_from: SpecificForce, count: int
) -> Float[np.ndarray, "rows rows"]:
    """Covariance of the rows' noise, from what remains on the lines; independent rows where nothing joins them."""
    rows = remaining @ np.linalg.inv(whitener).T
    covariance = rows.T @ rows / max(len(rows) - count / len(whitener), 1.0)
    covariance = covariance + 1e-10 * np.diag(np.diag(covariance)) + 1e-24 * np.eye(len(whitener))
    return np.diag(np.diag(covariance)) if force_from == "still" else covariance


def tensor_change(
    fits: Sequence[RunFit], weights: Sequence[float], added: Sequence[np.ndarray], *, offsets: bool = True
) -> Float[np.ndarray, "6 p"]:
    """Return the change of the tensor of (10) by columns (n, 6, p) that are added to the wrench of each run.

    The force counts as measured: least squares fit the moment about r_CG, less its mean where offsets are estimated.
    """
    return pooled_tensor([tensor_sums(*pair, offsets=offsets) for pair in zip(fits, added, strict=True)], weights)


def tensor_sums(fit: RunFit, columns: Float[np.ndarray, "n 6 p"], *, offsets: bool) -> TensorSums:
    """Return the sums of :func:`tensor_change` of one run."""
    rows, moment = fit.prediction.regressor, about_centre(columns, fit.prediction.x["r_cg"])
    if offsets:
        rows, moment = rows - rows.mean(axis=0), moment - moment.mean(axis=0)
    # first order: least squares are linear in the wrench, so that their change is their estimate of what is added
    return TensorSums(products(rows, rows), products(rows, moment))


def pooled_tensor(sums: Sequence[TensorSums], weights: Sequence[float]) -> Float[np.ndarray, "6 p"]:
    """Return the tensor's change by the sums of all runs, and the weight of each."""
    normal = np.sum([weight * part.normal for weight, part in zip(weights, sums, strict=True)], axis=0)
    right = np.sum([weight * part.right for weight, part in zip(weights, sums, strict=True)], axis=0)
    return solution(normal, right)
