"""Information of one recorded run on the tensor: its normal equations, and the reach of their noise.

The rows' noise is taken from the residuals. These are correlated in time, the more so behind a filter, and across the
axes, so the covariance of the scores ``Σ Ωᵀu`` is taken from their spectrum
(:mod:`identify.signals.residual_spectrum`), not by the textbook ``σ²(ΩᵀΩ)⁻¹``.
"""

from dataclasses import dataclass

import numpy as np

from identify.choices import OffsetChoice
from identify.estimators.gram import Sums, normal_equations, sums_of
from identify.estimators.least_squares import Excitation, excitation
from identify.estimators.offsets import Offsets, estimated, rested, resting
from identify.estimators.regressor_rows import Rows, rows_of
from identify.estimators.residual_trace import Trace, trace
from identify.rigid_body.regressor import ALPHA, OMEGA, OMEGA_R_OF_FEATURES
from identify.signals.correlation_time import correlation_time
from identify.signals.differentiate import gain
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import response
from identify.signals.power_spectrum import noise_level, welch
from identify.signals.residual_spectrum import Lines, Spectrum, leverage, spectrum
from identify.signals.run import Run


@dataclass(frozen=True)
class Information:
    """A run's normal equations and the covariance of their right-hand side."""

    run: Run
    normal: np.ndarray
    """Matrix ``ΩᵀΩ`` of the normal equations, (6, 6), weighted where weights are known."""
    right: np.ndarray
    """Right-hand side ``Ωᵀ(M - r × F)`` of the normal equations, (6,); centred when offsets are removed."""
    right_by_centre: np.ndarray
    """Derivative of ``right`` with respect to r, (6, 3)."""
    noise: np.ndarray
    """Expected contribution of the gyro's noise to ``normal``, (6, 6)."""
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
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom of the variance of each component of the run's own estimate; 1 or more."""
    trace: Trace
    """Residuals and motion, for figures."""
    weighed: np.ndarray | None = None
    """``W Omega_R`` of the first lines of the cosine transform, what is estimated along eliminated, (k, 3, 6): its
    products with ``Omega_R`` and with ``M - r × F`` are the equations; None: it is ``Omega_R`` itself."""

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
    return information_of_rows(run, rows_of(run, estimator), estimator, r_cg, offsets=offsets)


def information_of_rows(
    run: Run, rows: Rows, estimator: EstimatorSpec, r_cg: np.ndarray, *, offsets: OffsetChoice
) -> Information:
    """Return :func:`information` from the rows that the estimator made of the run."""
    phi, force, moment = rows.phi, rows.force, rows.moment
    count, motion = phi.shape[1], phi
    means = [signal.mean(axis=1, keepdims=True) for signal in (phi, force, moment)]
    if offsets == "estimate":
        phi, force, moment = (signal - mean for signal, mean in zip((phi, force, moment), means, strict=True))
    elif offsets == "still":
        force, moment = force - resting(run).force[:, None], moment - resting(run).moment[:, None]
    normal, right, by_centre = _equations(sums_of(phi, force, moment), r_cg)
    inertia = np.linalg.pinv(normal, hermitian=True) @ right
    about_cg = moment - np.cross(r_cg, force, axisb=0, axisc=0)
    residuals = about_cg.T - phi.T @ (OMEGA_R_OF_FEATURES @ inertia)
    transformed = rows.centred if offsets == "estimate" else rows.transformed
    spread = np.linalg.pinv(normal, hermitian=True)
    errors = _spectrum(
        lines=rows.lines, rows=transformed, residuals=residuals, inverse=spread, estimator=estimator, rate=run.rate,
        offsets=offsets,
    )  # fmt: skip
    scores = errors.scores(transformed)
    sigma = alpha_noise(run, estimator)
    noise = count * np.einsum("k,kji,kje->ie", sigma**2, OMEGA_R_OF_FEATURES[ALPHA], OMEGA_R_OF_FEATURES[ALPHA])
    removed = None
    if offsets == "estimate":
        mean_covariance = errors.values[0] / count
        mean_phi, mean_force, mean_moment = (mean[:, 0] for mean in means)
        removed = estimated(
            phi=mean_phi, force=mean_force, moment=mean_moment, r_cg=r_cg, inertia=inertia,
            covariance=spread @ scores @ spread, mean_covariance=mean_covariance,
        )  # fmt: skip
    elif offsets == "still":
        removed = rested(resting(run), r_cg)
        total = count * np.einsum("kji,k->ij", OMEGA_R_OF_FEATURES, means[0][:, 0])
        scores = scores + total @ removed.covariance @ total.T
    return Information(
        run=run, normal=normal, right=right, right_by_centre=by_centre, noise=noise, inertia=inertia, scores=scores,
        excitation=excitation(normal, noise), offsets=removed, residual=residuals.std(axis=0),
        correlation_time=correlation_time(residuals), rows=count, gain_error=gain_error(run, estimator),
        degrees_of_freedom=errors.degrees_of_freedom(transformed @ spread),
        trace=trace(run.t[rows.instants], residuals, about_cg.T, motion[OMEGA].T, motion[ALPHA].T),
    )  # fmt: skip


def _equations(sums: Sums, r_cg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal equations at a centre of gravity, and the derivative of their right side, which is linear in it."""
    normal, right = map(np.asarray, normal_equations(sums, r_cg))
    shifted = [normal_equations(sums, r_cg + unit)[1] for unit in np.eye(3)]
    return normal, right, np.array(shifted).T - right[:, None]


def _spectrum(
    lines: Lines, rows: np.ndarray, residuals: np.ndarray, inverse: np.ndarray, estimator: EstimatorSpec,
    rate: float, offsets: OffsetChoice,
) -> Spectrum:  # fmt: skip
    """The errors' spectrum from the residuals of least squares."""
    free = 1 - leverage(rows, inverse)
    if offsets == "estimate":
        free = np.clip(free - lines.constant[:, None] ** 2 / len(residuals), 0, 1)
    passed = response(estimator.filter_taps(rate), rate, lines.frequency) ** 2
    return spectrum(lines.transform(residuals), free, lines.constants, passed)


def alpha_noise(run: Run, estimator: EstimatorSpec) -> np.ndarray:
    """Standard deviation of the rows' alpha on each axis [rad/s²], from the angular velocity's noise."""
    if run.noise is not None:
        return run.noise.alpha(estimator, run.rate)
    return noise_level(*(run.omega[segment] for segment in run.used())) * estimator.alpha_noise_gain(run.rate)


def gain_error(run: Run, estimator: EstimatorSpec) -> float:
    """Return the tensor's relative error by the differentiator's gain: 1/gain - 1, weighed by the spectrum of alpha."""
    omega = run.omega[run.longest_segment]
    frequency, power = welch(omega, run.rate, max(len(omega) // 4, 8), window="blackmanharris")
    inside = frequency <= run.band
    passed = response(estimator.filter_taps(run.rate), run.rate, frequency[inside])
    weight = (power.sum(axis=1) * frequency**2)[inside] * passed**2
    total = gain(estimator.taps(run.rate), run.rate, frequency[inside])
    if run.noise is not None:  # the angular velocity was differentiated, too
        total = total * gain(run.noise.taps, run.noise.rate, frequency[inside])
    error = 1 / total - 1
    return float(weight @ error / max(weight.sum(), 1e-300))
