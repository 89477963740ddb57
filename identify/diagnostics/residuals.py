"""A run's residual moment, instant by instant, beside the signals that might explain it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.estimators.offsets import resting
from identify.estimators.regressor_rows import rows_of, usable_rows
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import ALPHA, OMEGA_R_OF_FEATURES
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import gaussian
from identify.signals.gravity_direction import upward
from identify.signals.run import Run

OVER_BAND = 2.0
"""Cut-off of the smoothing of explanatory signals over the motion's highest frequency."""


class Residuals(NamedTuple):
    """Residual moment about the centre of gravity and the signals beside it; samples first, in B, SI."""

    t: Float[np.ndarray, " n"]
    """Instants from the run's first sample [s]."""
    moment: Float[np.ndarray, "n 3"]
    """``M - r × F - Ω i``, less the offset where one was removed [N·m]."""
    rows: Float[np.ndarray, "n 3 6"]
    """``Ω``, less its mean where offsets are estimated."""
    spin: Float[np.ndarray, "n 3"]
    """Moment ``Ω i`` that the motion needs, smoothed [N·m]."""
    force: Float[np.ndarray, "n 3"]
    """Force that the motion makes, fitted to the measured one: weight along the upward direction and mass times
    acceleration [N]."""
    omega: Float[np.ndarray, "n 3"]
    alpha: Float[np.ndarray, "n 3"]
    """Angular acceleration, smoothed [rad/s²]."""
    rate: float
    """Sample rate of the residuals [Hz]."""
    band: float
    """Highest frequency of the motion [Hz]."""


def residuals(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    *,
    offsets: OffsetChoice = "estimate",
    filtered: bool = True,
) -> Residuals:
    """Return a run's residuals about a tensor, in the rows that the estimator uses.

    Args:
        run: the run.
        estimator: differentiator and filter.
        r_cg: centre of gravity from Q, in B [m].
        inertia: packed tensor about the centre of gravity [kg·m²].
        offsets: how constant offsets were removed.
        filtered: whether the estimator's low-pass acts.
    """
    estimator = estimator if filtered else replace(estimator, lowpass=None)
    phi, force, moment = rows_of(run, estimator)[:3]
    lost = estimator.lost(run.rate)
    keep, half = usable_rows(run, len(run.t) - lost), lost // 2
    rows, about_cg = _sides(run, phi, force, moment, r_cg, offsets)
    residual_moment, spin = about_cg - rows @ inertia, rows @ inertia
    if offsets == "estimate":
        spin = spin + np.einsum("kji,k->ji", OMEGA_R_OF_FEATURES, phi.mean(axis=1)) @ inertia
    smooth = _Smoother(run.rate, OVER_BAND * run.band, len(keep))
    alpha = smooth(phi[ALPHA].T)
    fitted = force_of_motion(force.T, upward_by_force(run, r_cg)[half + keep], phi[1:4].T, alpha)
    return Residuals(
        t=run.t[half + keep] - run.t[0], moment=residual_moment, rows=rows, spin=smooth(spin), force=fitted,
        omega=phi[1:4].T, alpha=alpha, rate=run.rate, band=run.band,
    )  # fmt: skip


def residual_moment(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    *,
    offsets: OffsetChoice = "estimate",
) -> Float[np.ndarray, "n 3"]:
    """Return the residual moment of :func:`residuals` alone [N·m]."""
    rows, about_cg = _sides(run, *rows_of(run, estimator)[:3], r_cg, offsets)
    return np.asarray(about_cg - rows @ inertia)


def _sides(
    run: Run, phi: np.ndarray, force: np.ndarray, moment: np.ndarray, r_cg: np.ndarray, offsets: OffsetChoice
) -> tuple[np.ndarray, np.ndarray]:
    """``Ω`` and the moment about the centre of gravity, less their means or the load cell's offset."""
    if offsets == "still":
        force, moment = force - resting(run).force[:, None], moment - resting(run).moment[:, None]
    rows = np.tensordot(phi.T, OMEGA_R_OF_FEATURES, axes=1)
    about_cg = moment.T - np.cross(r_cg, force.T)
    if offsets != "estimate":
        return rows, about_cg
    return rows - rows.mean(axis=0), about_cg - about_cg.mean(axis=0)


def upward_by_force(run: Run, r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 3"]:
    """Return the upward direction in B from gyro and force together: the load cell as an accelerometer.

    The force's own noise is that of the residuals, which would seem to follow it; the gyro's integral is free of it.
    Zeros where there is no force.
    """
    if not np.abs(run.force).max() > 0:
        return np.zeros_like(run.force)
    return upward(replace(run, specific_force=run.force, imu_position=np.asarray(r_cg, float)), r_cg, ())


def force_of_motion(
    force: Float[np.ndarray, "n 3"],
    up: Float[np.ndarray, "n 3"],
    omega: Float[np.ndarray, "n 3"],
    alpha: Float[np.ndarray, "n 3"],
) -> Float[np.ndarray, "n 3"]:
    """Return the force as weight and mass times acceleration of a point of the body, by least squares, less an offset.

    Args:
        force: measured [N].
        up: upward direction in B.
        omega: angular velocity [rad/s].
        alpha: angular acceleration [rad/s²].
    """
    unit = np.eye(3)
    lever = [np.cross(alpha, e) + np.cross(omega, np.cross(omega, e)) for e in unit]
    columns = np.stack([up, *lever, *(np.broadcast_to(e, force.shape) for e in unit)], axis=2)
    solution = np.linalg.lstsq(columns.reshape(-1, 7), force.reshape(-1), rcond=1e-10)[0]
    return columns[:, :, :4] @ solution[:4]


class _Smoother:
    """A Gaussian low-pass that keeps the length; none where the run is too short for it."""

    def __init__(self, rate: float, cutoff: float, count: int) -> None:
        taps = gaussian(rate, cutoff)
        self.taps = taps if 4 * len(taps) < count else np.ones(1)

    def __call__(self, signal: np.ndarray) -> np.ndarray:
        half = len(self.taps) // 2
        padded = np.pad(signal, ((half, half), (0, 0)), mode="edge")
        return np.stack([np.convolve(axis, self.taps, "valid") for axis in padded.T], axis=1)


def gyro_bias_columns(left: Residuals, inertia: Float[np.ndarray, "6"]) -> Float[np.ndarray, "n 3 3"]:
    """Return what a bias of the angular velocity about each axis adds to ``Ω i``: ``e × I omega + omega × I e``."""
    tensor = unpack(inertia)
    unit, momentum = np.eye(3), left.omega @ tensor
    return np.stack([np.cross(e, momentum) + np.cross(left.omega, tensor @ e) for e in unit], axis=2)
