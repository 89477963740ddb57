"""Information of one recorded run on the tensor: its normal equations, the reach of their noise, and its excitation.

The rows' noise is taken from the residuals. These are correlated in time, the more so behind a filter, and across the
axes, so the covariance of the scores ``Σ Ωᵀu`` is taken from their spectrum
(:mod:`identify.least_squares.residual_spectrum`), not by the textbook ``σ²(ΩᵀΩ)⁻¹``.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from identify.choices import OffsetChoice
from identify.least_squares.gram import N_FEATURES, Sums, normal_equations
from identify.least_squares.offsets import Offsets, rested, resting
from identify.least_squares.residual_spectrum import Spectrum, Trace, leverage, spectrum, trace
from identify.least_squares.run_lines import ACTING, FORCE, MOMENT, MOTION, RunLines, run_lines
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import ALPHA, OMEGA_R_OF_FEATURES
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.power_spectrum import correlation_time
from identify.signals.run import Run

Matrix = Float[Array, "6 6"] | Float[np.ndarray, "6 6"]


class Excitation(NamedTuple):
    """The motion's information on the six components: the verdict on identifiability."""

    strength: np.ndarray
    """Eigenvalues of ``ΩᵀΩ``, ascending [s⁻⁴ times the number of samples]."""
    directions: np.ndarray
    """Unit eigenvectors of ``ΩᵀΩ`` in the space of packed tensors, one a row."""
    noise: np.ndarray
    """Expected part of each eigenvalue that the gyro's noise alone contributes."""
    identifiable: np.ndarray
    """Mask of the directions that stand out from noise and rounding."""

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the components that lie, for the greater part, in directions that the motion does not excite."""
        blind = self.directions[~self.identifiable]
        return tuple(name for name, share in zip(COMPONENTS, (blind**2).sum(axis=0), strict=True) if share > 0.4)

    @property
    def blind_direction(self) -> str:
        """The least excited direction in words, such as ``0.58 I11 +0.58 I22 +0.58 I33``."""
        shares = zip(COMPONENTS, self.directions[0], strict=True)
        return " ".join(f"{share:+.2g} {name}" for name, share in shares if abs(share) > 0.1).removeprefix("+")


def excitation(normal: Matrix, noise: Matrix) -> Excitation:
    """Judge which directions of the tensor a motion excites.

    A direction counts as identifiable when its strength is at least ten times what the gyro's noise contributes (less
    would dilute the estimate by more than a tenth) and above 1e-9 of the strongest.

    Args:
        normal: ``ΩᵀΩ``.
        noise: the expected contribution of the gyro's noise to it; zeros when there is none.
    """
    strength, vectors = np.linalg.eigh(np.asarray(normal, float))
    directions = vectors.T
    noise_strength = np.einsum("ki,ij,kj->k", directions, np.asarray(noise, float), directions)
    identifiable = (strength > 10 * noise_strength) & (strength > 1e-9 * strength[-1])
    return Excitation(strength, directions, noise_strength, identifiable)


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
    return information_of_lines(run_lines(run, estimator), estimator, r_cg, offsets=offsets)


def information_of_lines(
    lines: RunLines, estimator: EstimatorSpec, r_cg: np.ndarray, *, offsets: OffsetChoice
) -> Information:
    """Return :func:`information` from what the run leaves behind the estimator."""
    run, count = lines.run, len(lines)
    noise = count * noise_in_normal(alpha_noise(run, estimator))
    used = without_offsets(lines, offsets)
    normal, right, by_centre = _equations(used.products(), r_cg)
    spread = np.linalg.pinv(normal, hermitian=True)
    inertia = spread @ right
    residuals = used.residuals(inertia, r_cg)
    shown = residuals_in_time(residuals, lines, r_cg)
    errors = _spectrum_of(residuals, used, spread, estimator, offsets)
    del residuals  # of a long run, what is not looked at again takes no memory
    scores = by_noise = errors.scores(used)
    removed = None
    if offsets == "estimate":  # what the rows' means leave, so that it takes the tensor's covariance along
        regressor, force = lines.mean_regressor, lines.means[FORCE]
        moment = lines.means[MOMENT] - np.cross(r_cg, force) - regressor @ inertia
        by_tensor = regressor @ spread @ scores @ spread @ regressor.T
        removed = Offsets(moment, by_tensor + errors.at(slice(0, 1))[0] / count, force)
    elif offsets == "still":
        removed = rested(resting(run), r_cg)
        total = count * lines.mean_regressor.T
        scores = scores + total @ removed.covariance @ total.T
    return Information(
        run=run, normal=normal, right=right, right_by_centre=by_centre, noise=noise, inertia=inertia, scores=scores,
        excitation=excitation(normal, noise), offsets=removed, rows=count, gain_error=gain_error(run, estimator),
        degrees_of_freedom=errors.degrees_of_freedom(used, spread, by_noise), **shown,
    )  # fmt: skip


def residuals_in_time(residuals: np.ndarray, lines: RunLines, r_cg: np.ndarray) -> dict[str, Any]:
    """Return size, correlation time and figures of residuals, fields of :class:`Information`, from their lines."""
    samples = lines.lines.samples(residuals)
    return {
        "residual": samples.std(axis=0), "correlation_time": correlation_time(samples),
        "trace": trace(lines.t, samples, lines.moment(r_cg), lines.motion),
    }  # fmt: skip


def without_offsets(lines: RunLines, offsets: OffsetChoice) -> RunLines:
    """Return a run's lines less what stands for constant offsets: the means of all signals, or the wrench at rest."""
    if offsets == "estimate":
        return lines.less(lines.means)
    return lines.less_wrench(resting(lines.run).force, resting(lines.run).moment) if offsets == "still" else lines


def _equations(products: np.ndarray, r_cg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal equations from the signals' products, and the derivative of their right side by the centre of gravity."""
    features, force, moment = np.zeros((N_FEATURES, N_FEATURES)), *np.zeros((2, N_FEATURES, 3))
    features[np.ix_(ACTING, ACTING)] = products[MOTION, MOTION]
    force[ACTING], moment[ACTING] = products[MOTION, FORCE], products[MOTION, MOMENT]
    sums = Sums(features, force, moment)
    normal, right = map(np.asarray, normal_equations(sums, r_cg))
    shifted = [normal_equations(sums, r_cg + unit)[1] for unit in np.eye(3)]
    return normal, right, np.array(shifted).T - right[:, None]


def _spectrum_of(
    residuals: np.ndarray, lines: RunLines, inverse: np.ndarray, estimator: EstimatorSpec, offsets: OffsetChoice
) -> Spectrum:
    """Return the spectrum of the errors as the residuals of least squares show it."""
    at = lines.lines
    free = 1 - leverage(lines, inverse)
    if offsets == "estimate":
        free = np.clip(free - at.constant[:, None] ** 2 / len(residuals), 0, 1)
    return spectrum(residuals, free, at.constants, estimator.passed(lines.run.rate, at.frequency) ** 2)


def alpha_noise(run: Run, estimator: EstimatorSpec) -> np.ndarray:
    """Standard deviation of the rows' alpha on each axis [rad/s²], from the angular velocity's noise."""
    if run.noise is not None:
        return run.noise.alpha(estimator, run.rate)
    return run.white_noise(run.omega) * estimator.alpha_noise_gain(run.rate)


def noise_in_normal(sigma: np.ndarray) -> np.ndarray:
    """Return what white noise of alpha on each axis [rad/s²] adds to ``ΩᵀΩ`` of one row, expected, (6, 6)."""
    alpha_rows = OMEGA_R_OF_FEATURES[ALPHA]
    return np.einsum("k,kji,kje->ie", sigma**2, alpha_rows, alpha_rows)


def gain_error(run: Run, estimator: EstimatorSpec) -> float:
    """Return the tensor's relative error by the differentiator's gain: 1/gain - 1, weighed by the spectrum of alpha."""
    frequency, power = run.motion_spectrum
    power, frequency = power[frequency <= run.band], frequency[frequency <= run.band]
    weight = power.sum(axis=1) * frequency**2 * estimator.passed(run.rate, frequency) ** 2
    total = estimator.gain(run.rate, frequency)
    if run.noise is not None:  # the angular velocity was differentiated, too
        total = total * run.noise.gain(frequency)
    error = 1 / total - 1
    return float(weight @ error / max(weight.sum(), 1e-300))
