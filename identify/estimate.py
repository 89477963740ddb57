"""What one recorded run says of the tensor: its normal equations, and how far their noise reaches.

The rows' noise is taken from the residuals. These are correlated in time, the more so behind a filter, so the
covariance of the scores ``Σ Ωᵀu`` is estimated with the Bartlett kernel over four correlation times (Newey and West,
Econometrica 55 (1987) 703, doi:10.2307/1913610), not by the textbook ``σ²(ΩᵀΩ)⁻¹``.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.signal import welch

from identify.differentiate import derivative, gain
from identify.estimator import EstimatorSpec
from identify.filters import apply, motion_band, noise_level, response
from identify.gram import Sums, normal_equations, sums_of
from identify.offsets import OffsetChoice, Offsets, estimated, rested, resting
from identify.regressor import ALPHA, OMEGA, OMEGA_R_OF_FEATURES, features
from identify.run import Run, RunError
from identify.solve import Excitation, excitation
from identify.trace import Trace, trace

SPLINE_REACH = 3
"""Samples beside a gap that the interpolation across it touches."""


@dataclass(frozen=True)
class Information:
    """A run's normal equations and the covariance of their right-hand side."""

    run: Run
    sums: Sums
    """Of the rows; centred when offsets are removed."""
    normal: np.ndarray
    """``ΩᵀΩ``, (6, 6)."""
    noise: np.ndarray
    """What the gyro's noise alone adds to it, expected, (6, 6)."""
    inertia: np.ndarray
    """The run's own estimate [kg·m²]; of least norm where directions are not excited."""
    scores: np.ndarray
    """Covariance of ``Σ Ωᵀu``, (6, 6)."""
    excitation: Excitation
    offsets: Offsets | None
    """Constants of the load cell that were removed; None: not asked for."""
    residual: np.ndarray
    """Standard deviation of the residuals on each axis [N·m]."""
    correlation_time: float
    """Integrated correlation time of the residuals [samples]."""
    rows: int
    """Samples that gave rows."""
    gain_error: float
    """Relative error of the tensor from the differentiator's gain over the motion's spectrum."""
    trace: Trace
    """Residuals and motion, for figures."""

    @property
    def weight(self) -> float:
        """Inverse of the rows' effective noise variance, which weighs this run among others [(N·m)⁻²]."""
        usable = self.excitation.identifiable
        if not usable.any():
            return 1.0
        strength, directions = self.excitation.strength[usable], self.excitation.directions[usable]
        spread = np.einsum("ki,ij,kj->k", directions, self.scores, directions) / strength
        return float(1 / max(np.mean(spread), 1e-300))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the run's own estimate [(kg·m²)²]; meaningless where directions are not excited."""
        inverse = np.linalg.pinv(self.normal, hermitian=True)
        return inverse @ self.scores @ inverse

    @property
    def degrees_of_freedom(self) -> float:
        """Effective number of independent residuals less the parameters, at least 1."""
        return max(3 * self.rows / self.correlation_time - 6 - (0 if self.offsets is None else 3), 1.0)


def information(run: Run, estimator: EstimatorSpec, r_cg: np.ndarray, *, offsets: OffsetChoice) -> Information:
    """Return a run's normal equations (10), with the noise that its residuals show.

    Args:
        run: the run.
        estimator: differentiator and filter.
        r_cg: centre of gravity from Q, in B [m].
        offsets: whether a constant moment (and so a constant force) is estimated along, taken from the body's rest
            (``run.rest``), or not removed.

    Raises:
        RunError: the run is too short for the estimator, or its rate too low for the band.
    """
    try:
        needed = estimator.lost(run.rate) + 3
    except ValueError as error:
        raise RunError(f"{run.name} at {run.rate:.6g} Hz: {error}") from None
    if len(run.t) < needed:
        raise RunError(
            f"{run.name} has {len(run.t)} samples, fewer than the {needed} that estimator '{estimator.name}' needs at "
            f"{run.rate:.6g} Hz: record for longer, or choose a higher band or low-pass"
        )
    phi, force, moment = rows_of(run, estimator)
    half = (len(run.t) - phi.shape[1]) // 2
    keep = kept(run, phi.shape[1])
    phi, force, moment = phi[:, keep], force[:, keep], moment[:, keep]
    count, motion = len(keep), np.asarray(phi)
    if count < 3:
        raise RunError(
            f"{run.name} has fewer than three samples that may be used: record without gaps, or choose a longer part"
        )
    means = [signal.mean(axis=1, keepdims=True) for signal in (phi, force, moment)]
    if offsets == "estimate":
        phi, force, moment = (signal - mean for signal, mean in zip((phi, force, moment), means, strict=True))
    elif offsets == "still":
        force, moment = force - resting(run).force[:, None], moment - resting(run).moment[:, None]
    sums = sums_of(phi, force, moment)
    normal, right = map(np.asarray, normal_equations(sums, jnp.asarray(r_cg)))
    inertia = np.linalg.pinv(normal, hermitian=True) @ right
    rows = np.einsum("kji,kn->nji", OMEGA_R_OF_FEATURES, np.asarray(phi))
    about_cg = np.asarray(moment - jnp.cross(jnp.asarray(r_cg), force, axisb=0, axisc=0))
    residuals = about_cg.T - rows @ inertia
    time = correlation_time(residuals)
    scores = score_covariance(np.einsum("nji,nj->ni", rows, residuals), time)
    sigma = _alpha_noise(run, estimator)
    noise = count * np.einsum("k,kji,kje->ie", sigma**2, OMEGA_R_OF_FEATURES[ALPHA], OMEGA_R_OF_FEATURES[ALPHA])
    removed = None
    if offsets == "estimate":
        spread = np.linalg.pinv(normal, hermitian=True)
        of_mean = np.diag(residuals.var(axis=0)) * time / count
        mean_phi, mean_force, mean_moment = (np.asarray(mean)[:, 0] for mean in means)
        removed = estimated(mean_phi, mean_force, mean_moment, r_cg, inertia, spread @ scores @ spread, of_mean)
    elif offsets == "still":
        removed = rested(resting(run), r_cg)
        total = count * np.einsum("kji,k->ij", OMEGA_R_OF_FEATURES, np.asarray(means[0])[:, 0])
        scores = scores + total @ removed.covariance @ total.T
    return Information(
        run,
        sums,
        normal,
        noise,
        inertia,
        scores,
        excitation(normal, noise),
        removed,
        residuals.std(axis=0),
        time,
        count,
        _gain_error(run, estimator),
        trace(run.t[half + keep], residuals, about_cg.T, motion[OMEGA].T, motion[ALPHA].T),
    )


def rows_of(
    run: Run, estimator: EstimatorSpec
) -> tuple[Float[Array, "13 m"], Float[Array, "3 m"], Float[Array, "3 m"]]:
    """Return features, force [N] and moment [N·m] of the instants that have a derivative, through one filter."""
    signals = [jnp.asarray(signal.T) for signal in (run.omega, run.force, run.moment)]
    return _rows(*signals, jnp.asarray(estimator.taps(run.rate)), jnp.asarray(estimator.filter_taps(run.rate)))


def _alpha_noise(run: Run, estimator: EstimatorSpec) -> np.ndarray:
    """Standard deviation of the rows' alpha on each axis [rad/s²], from the angular velocity's noise."""
    if run.noise is not None:
        return run.noise.alpha(estimator, run.rate)
    return noise_level(*(run.omega[part] for part in run.used())) * estimator.alpha_noise_gain(run.rate)


def kept(run: Run, rows: int) -> np.ndarray:
    """Return the positions of the rows that no gap reaches, through differentiator, filter and the spline's ringing."""
    if run.missing is None:
        return np.arange(rows)
    half = (len(run.t) - rows) // 2
    reach = half + SPLINE_REACH
    touched = np.convolve(run.missing.astype(float), np.ones(2 * reach + 1), "same") > 0.5
    return np.flatnonzero(~touched[half : half + rows])


def longest(run: Run) -> np.ndarray:
    """Return the angular velocity of the longest stretch in which every sample may be used."""
    return run.omega[max(run.used(), key=lambda part: part.stop - part.start)]


def _gain_error(run: Run, estimator: EstimatorSpec) -> float:
    """What the differentiator's gain makes of the tensor: 1/gain - 1, weighed by the spectrum of the rows' alpha."""
    omega = longest(run)
    frequency, power = welch(omega, fs=run.rate, nperseg=max(len(omega) // 4, 8), axis=0, window="blackmanharris")
    inside = frequency <= motion_band(omega, run.rate)
    passed = response(estimator.filter_taps(run.rate), run.rate, frequency[inside])
    weight = (power.sum(axis=1) * frequency**2)[inside] * passed**2
    total = gain(estimator.taps(run.rate), run.rate, frequency[inside])
    if run.noise is not None:  # the angular velocity was differentiated, too
        total = total * gain(run.noise.taps, run.noise.rate, frequency[inside])
    error = 1 / total - 1
    return float(weight @ error / max(weight.sum(), 1e-300))


@jax.jit
def _rows(
    omega: Float[Array, "3 n"], force: Float[Array, "3 n"], moment: Float[Array, "3 n"], taps: Array, smoothing: Array
) -> tuple[Float[Array, "13 m"], Float[Array, "3 m"], Float[Array, "3 m"]]:
    """Features, force and moment of the instants that have a derivative, all through the same filter."""
    inner = slice(taps.shape[0], omega.shape[1] - taps.shape[0])
    phi = features(omega[:, inner], derivative(omega, taps))
    if smoothing.shape[0] == 1:
        return phi, force[:, inner], moment[:, inner]
    filtered = apply(jnp.concatenate([phi, force[:, inner], moment[:, inner]]), smoothing)
    return filtered[:13], filtered[13:16], filtered[16:]


def correlation_time(residuals: np.ndarray) -> float:
    """Return the integrated correlation time [samples] of the axis where it is longest, to the first zero crossing."""
    n = len(residuals)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(residuals, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[:n]
    times = []
    for axis in correlation.T:
        if axis[0] > 0:
            negative = np.flatnonzero(axis <= 0)
            times.append(1 + 2 * axis[1 : negative[0] if len(negative) else n].sum() / axis[0])
    return float(min(max(times, default=1.0), n / 4))


def score_covariance(scores: np.ndarray, correlation_time: float) -> np.ndarray:
    """Return the covariance of a sum of scores (n, k): Bartlett kernel over four correlation times, by moving sums."""
    width = max(1, min(int(np.ceil(4 * correlation_time)), len(scores) // 3))
    padded = np.concatenate([np.zeros((width, scores.shape[1])), np.cumsum(scores, axis=0)])
    padded = np.concatenate([padded, np.repeat(padded[-1:], width - 1, axis=0)])
    sums = padded[width:] - padded[:-width]
    rows = 3 * len(scores) / correlation_time
    return sums.T @ sums / width * rows / max(rows - scores.shape[1], 1.0)
