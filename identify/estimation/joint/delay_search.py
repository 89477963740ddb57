"""The delay between load cell and IMU to start from: cross-correlation of moment and motion at tried delays.

The joint model is far from linear in a delay of more than a part of the motion's period, so Gauss–Newton starts at the
best of several.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.estimation.joint.priors import Alignment
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, PI_OF_FORCE, features
from identify.signals.band_limited_run import InBand
from identify.signals.resample import UniformSpline

DELAYS_PER_PERIOD = 16
"""Delays that are tried, a period of the motion."""
SAFE_PHASE = 1.0
"""Phase of the motion [rad], three standard uncertainties of the delay, below which none needs to be tried."""


class DelayedTensor(NamedTuple):
    """A tensor by ordinary least squares, the IMU's delay given."""

    delay: float
    """Delay of the IMU against the load cell that is tried [s]."""
    inertia: Float[np.ndarray, "6"]
    """Packed tensor at this delay [kg·m²]."""
    misfit: float
    """Sum of squares of the moment that it leaves [(N·m)²]."""


def search_delay(rows: InBand, alignment: Alignment, turn: Float[np.ndarray, "3 3"]) -> DelayedTensor:
    """Return the delay at which moment and motion agree best, with the tensor there.

    Args:
        rows: the run.
        alignment: delay with its standard uncertainty, as declared.
        turn: rotation from the IMU's axes to B.
    """
    delays = np.array([alignment.delay])
    if 2 * np.pi * rows.band * 3 * alignment.sigma_delay > SAFE_PHASE:
        delays = tried_delays(rows.band, alignment)
    return min((tensor_at_delay(rows, turn, delay) for delay in delays), key=lambda tried: tried.misfit)


def tried_delays(band: float, alignment: Alignment) -> np.ndarray:
    """Return the delays to try [s], within three standard uncertainties of what is declared."""
    half = 3 * alignment.sigma_delay
    count = max(int(np.ceil(2 * half * DELAYS_PER_PERIOD * band)), 2)
    return alignment.delay + np.linspace(-half, half, count + 1 - count % 2)


def tensor_at_delay(rows: InBand, turn: Float[np.ndarray, "3 3"], delay: float) -> DelayedTensor:
    """Return tensor and misfit of (7) by ordinary least squares with r and a constant free."""
    used, phi = rows.used, features_at_delay(rows, turn, delay)
    force, moment = rows.force * used, rows.moment * used
    tensor = np.einsum("kji,kn->jni", OMEGA_R_OF_FEATURES, phi)
    lever, constant = np.einsum("kjl,kn->jnl", PI_OF_FORCE, force), np.einsum("jk,n->jnk", np.eye(3), used)
    matrix = np.concatenate([tensor, lever, constant], axis=2).reshape(-1, 12)
    normal, right = matrix.T @ matrix, matrix.T @ moment.ravel()
    solution = np.linalg.lstsq(normal, right, rcond=1e-12)[0]
    # Pythagoras: |y|² - bᵀ x is what least squares leave, and no residual is formed at a delay that is only tried
    return DelayedTensor(delay, solution[:6], float((moment**2).sum() - right @ solution))


def features_at_delay(rows: InBand, turn: Float[np.ndarray, "3 3"], delay: float) -> Float[np.ndarray, "13 n"]:
    """Return the regressor's features of the motion in B; zero where a row must not be used."""
    value, slope = motion_at_delay(rows, delay)
    phi = features(turn @ value[:3], turn @ slope[:3])
    return np.asarray(phi * rows.used)


def motion_at_delay(rows: InBand, delay: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the IMU's signals, ``delay`` [s] after the rows' instants, and their derivatives."""
    spline, t = UniformSpline(rows.motion, rows.step), rows.t + delay
    return spline(t).T, spline(t, 1).T
