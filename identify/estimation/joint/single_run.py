"""One run's joint estimate from its samples: start, noise, solution."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from identify.display.rounding import significant
from identify.estimation.joint.delay_search import features_at_delay, motion_at_delay, search_delay
from identify.estimation.joint.gauss_newton import RunSolution, Transform, linearised, posterior, solve
from identify.estimation.joint.joint_model import COUNT, SLICES, Model, unknowns
from identify.estimation.joint.motion_signals import MotionSignals
from identify.estimation.joint.noise_spectrum import NoiseSpectrum, noise_spectrum
from identify.estimation.joint.priors import Alignment, Prior, Setting, run_prior
from identify.least_squares.residual_spectrum import Lines
from identify.least_squares.run_information import excitation, noise_in_normal
from identify.least_squares.run_lines import unbroken
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, cross_matrices, cross_matrix
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import PASSED, InBand, in_band, low_pass
from identify.signals.run import Run, RunError

LEAST_NOISE = 1e-5
"""Noise of a signal, as a part of its size, below which it counts as that (simulated runs may have none)."""
REACH = 4.0
"""Standard uncertainties of the delay that the margins at a run's ends allow for."""


class SolvedRun(NamedTuple):
    """A run by itself, as it is pooled."""

    run: Run
    prior: Prior
    information: np.ndarray
    """Information of the data on the prior's coordinates, (free, free)."""
    z: np.ndarray
    """The most probable coordinates, (free,)."""


@dataclass(frozen=True)
class JointRun:
    """One run's joint estimate."""

    run: Run
    model: Model
    prior: Prior
    fit: RunSolution
    noise: np.ndarray
    """Covariance of one sample's rows at its mean level over the band: force [N] and moment [N·m], or moment alone."""
    gyro_noise: np.ndarray
    """Standard deviation of the gyro's white noise [rad/s]."""
    degrees_of_freedom: float
    """Effective ones of the tensor's variances by the noise."""

    @property
    def solved(self) -> SolvedRun:
        """The run as it is pooled."""
        return SolvedRun(self.run, self.prior, self.fit.information, self.fit.z)

    @property
    def theta(self) -> np.ndarray:
        """The most probable unknowns, flat."""
        return self.prior.theta(self.fit.z)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the unknowns, given samples and priors."""
        return posterior(self.fit.information, self.prior)[0]


def joint_run(run: Run, setting: Setting) -> JointRun:
    """Estimate all unknowns of one run together.

    The noise of each axis is taken from the samples' fourth differences first, then from what the first solution
    leaves in the motion's band.

    Raises:
        RunError: the run is too short, it has no solution, or its delay is beyond what it leaves room for.
    """
    alignment, kind = setting.alignment, setting.specific_force
    reach = abs(alignment.delay) + REACH * alignment.sigma_delay
    rows = in_band(run, setting.band, reach=reach, accelerometer=kind != "none" and run.specific_force is not None)
    sigma = gyro_noise(run)
    model, prior = prepared(rows, sigma / np.sqrt(run.rate), run.accelerometer_position, setting)
    _check_excitation(run, model, setting, sigma)
    noise = _raw_noise(run, model, prior) / model.rows.factor
    try:
        first = solve(model, prior, search_start(model, prior, setting), whitening(noise))
        _check(run.name, model, prior, first)
        # a step of iteratively reweighted least squares: weights from the residuals of the first solution
        noise = residual_noise(first, prior, model)
        transform, spectrum = _coloured(first, prior, model, whitener(noise))
        fit = solve(model, prior, first.z, transform, weights=spectrum.weights)
        _check(run.name, model, prior, fit)
    except np.linalg.LinAlgError:  # rows that the first solution leaves without noise, or with none that is finite
        raise _without_solution(run.name) from None
    freedom = _freedom(fit, prior, linearised(model, prior, fit.z, transform).columns, spectrum)
    return JointRun(
        run=run, model=model, prior=prior, fit=fit, noise=noise * rows.factor, gyro_noise=sigma,
        degrees_of_freedom=freedom,
    )  # fmt: skip


def _coloured(fit: RunSolution, prior: Prior, model: Model, white: np.ndarray) -> tuple[Transform, NoiseSpectrum]:
    """Return the transform of rows to whitened lines, and the spectrum of a solution's residuals on them."""
    lines = Lines.of(unbroken(np.flatnonzero(model.used)), 1 / model.rows.interval)

    def transform(rows: np.ndarray) -> np.ndarray:
        return lines.transform(np.asarray(white @ rows))

    at = linearised(model, prior, fit.z, transform)
    return transform, noise_spectrum(
        at.residuals, at.columns, prior.counted, white @ least_noise(model) @ white.T,
        inside=int((lines.frequency <= PASSED * model.rows.band).sum()), constants=lines.constants,
        independent=model.specific_force == "still",
    )  # fmt: skip


def _freedom(fit: RunSolution, prior: Prior, columns: np.ndarray, spectrum: NoiseSpectrum) -> float:
    """Effective degrees of freedom of the tensor's variances by the noise, of which the residuals tell the level."""
    covariance = np.linalg.inv(fit.information + np.diag(prior.counted))
    # estimates are gainᵀ Xᵀ r: their variance is a sum over lines, whose effective number Satterthwaite's formula
    # tells
    gain = fit.weights.T @ covariance @ prior.root[SLICES["inertia"]].T
    return float(np.mean(spectrum.degrees_of_freedom(columns, gain)))


def gyro_noise(run: Run) -> np.ndarray:
    """Return the standard deviation of the gyro's white noise on each axis [rad/s], from its fourth differences."""
    return np.maximum(run.white_noise(run.omega), LEAST_NOISE * _size(run.omega))


def prepared(rows: InBand, gyro_density: np.ndarray, imu_position: np.ndarray, setting: Setting) -> tuple[Model, Prior]:
    """Return the model of decimated rows, and the prior of its unknowns."""
    alignment, kind = setting.alignment, setting.specific_force
    to_imu = exponential(np.asarray(alignment.rotation, float)).T
    model = Model(
        rows=rows, up=to_imu[:, 2], gravity=setting.gravity, imu_position=imu_position, specific_force=kind,
        used=rows.used,
    )  # fmt: skip
    if kind == "still" and alignment.sigma_tilt is None:
        model = replace(model, up=start_up(model, to_imu, start_bias(model, to_imu, alignment)))
    return model, run_prior(setting, gyro_density)


def _check_excitation(run: Run, model: Model, setting: Setting, gyro_noise: np.ndarray) -> None:
    """Refuse a run whose motion alone does not determine the tensor."""
    phi = features_at_delay(model.rows, np.eye(3), setting.alignment.delay)
    tensor = np.einsum("kji,kn->jni", OMEGA_R_OF_FEATURES, phi).reshape(-1, 6)
    noise = noise_in_normal(gyro_noise * np.sqrt(alpha_noise_gain(run.rate, model.rows)))
    verdict = excitation(tensor.T @ tensor, float(model.rows.used.sum()) * noise)
    if not verdict.identifiable.all():
        names = ", ".join(verdict.unidentifiable) or verdict.blind_direction
        raise RunError(
            f"the motion in {run.name} alone does not identify {names}: {run.cure('rotate about more axes, or faster')}"
        )


def alpha_noise_gain(rate: float, rows: InBand) -> float:
    """Return the variance of a row's alpha over that of a sample of the angular velocity, its noise white [s⁻²]."""
    taps = low_pass(rate, rows.band, rows.factor)
    # α of decimated rows is the derivative of the low-passed signal: white noise behind the taps' own derivative
    slope = np.gradient(taps) * rate if len(taps) > 1 else np.array([rate / 2] * 2)
    return float((slope**2).sum())


def whitener(covariance: np.ndarray) -> np.ndarray:
    """Return W with ``W C Wᵀ = 1``."""
    return np.linalg.inv(np.linalg.cholesky(covariance))


def whitening(covariance: np.ndarray) -> Transform:
    """Return the function to rows in units of noise of this covariance."""
    white = whitener(covariance)
    return lambda rows: np.asarray(white @ rows)


def least_noise(model: Model) -> np.ndarray:
    """Return the covariance that a run's rows have at least, of :data:`LEAST_NOISE`, (rows, rows)."""
    size = LEAST_NOISE * np.repeat([_size(model.rows.force), _size(model.rows.moment)], 3)
    return np.diag(size[3 * (model.specific_force == "none") :] ** 2) / model.rows.factor


def residual_noise(fit: RunSolution, prior: Prior, model: Model) -> np.ndarray:
    """Return the covariance of the rows' noise, the residuals' mean over the band, (rows, rows).

    Axes are independent, but where the specific force or the measured force puts one noise into several rows. What the
    fit has taken of the residuals (its effective number of unknowns) is put back.
    """
    at = fit.prediction
    counted = at.counted(at.residuals[:, :, None])[:, :, 0]
    residuals = np.zeros((counted.shape[1], len(model.used)))
    residuals[:, model.used] = counted.T
    spectrum = np.fft.rfft(residuals, axis=1)
    share = min(2 * PASSED * model.rows.band * model.rows.interval, 1.0)
    bins = max(int(share * (spectrum.shape[1] - 1)), 1)
    inside = spectrum[:, 1 : bins + 1]
    # trace of the hat matrix: the effective number of unknowns, less than their number where priors hold them
    taken = np.trace(np.linalg.solve(fit.information + np.diag(prior.counted), fit.information))
    freedom = max(2 * inside.size - float(taken), 1.0) / (2 * inside.size)
    # Parseval: mean squares of the lines in the band are the noise's density there
    level = (inside @ inside.conj().T).real / (bins * float(model.rows.used.sum())) / freedom
    level = level + least_noise(model)
    return level if model.specific_force != "still" else np.diag(np.diag(level))


def _check(name: str, model: Model, prior: Prior, fit: RunSolution) -> None:
    theta = prior.theta(fit.z)
    if not (np.isfinite(theta).all() and fit.converged):
        raise _without_solution(name)
    delay = float(theta[SLICES["delay"]][0])
    if abs(delay) > model.rows.reach:
        raise RunError(
            f"the delay of {name} comes to {significant(1e3 * delay)} ms, beyond what is declared of it: declare its "
            "standard uncertainty wider, or check the clocks"
        )


def _without_solution(name: str) -> RunError:
    return RunError(
        f"the joint estimate of {name} does not converge: check signs, frames and cg_motion, or use the method source"
    )


def _size(signal: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(signal))))


def _raw_noise(run: Run, model: Model, prior: Prior) -> np.ndarray:
    """Covariance of one sample's rows from the fourth differences."""
    level = [np.maximum(run.white_noise(signal), LEAST_NOISE * _size(signal)) for signal in (run.force, run.moment)]
    if model.specific_force == "still":
        return np.diag(np.concatenate(level) ** 2)
    mean = prior.mean
    arm = cross_matrix(mean[SLICES["r_cg"]])
    if model.specific_force == "none":
        return np.diag(level[1] ** 2) + arm * level[0] ** 2 @ arm.T
    assert run.specific_force is not None  # noqa: S101 - the choice of the model says so
    accelerometer = np.maximum(run.white_noise(run.specific_force), 1e-6)
    # noise a of the accelerometer enters force and moment together, as m a and r × m a: C + L σ² Lᵀ
    lever = float(mean[SLICES["mass"]][0]) * np.concatenate([np.eye(3), arm])
    return np.diag(np.concatenate(level) ** 2) + lever * accelerometer**2 @ lever.T


def search_start(model: Model, prior: Prior, setting: Setting) -> np.ndarray:
    """Return where the search starts: delay and tensor by cross-correlation, the gyro's bias from the force."""
    alignment = setting.alignment
    turn = exponential(np.asarray(alignment.rotation, float))
    best = search_delay(model.rows, alignment, turn)
    values: dict[str, np.ndarray | float] = {"delay": best.delay, "inertia": best.inertia}
    if model.specific_force == "still":
        values["gyro_bias"] = start_bias(model, turn.T, alignment)
    return prior.coordinates(values)


def start_bias(model: Model, to_imu: np.ndarray, alignment: Alignment) -> np.ndarray:
    """Return the gyro's bias with which gravity, in the IMU's axes, turns as the force does.

    The integral of ``γ' + omega × γ = bias × γ``, γ = F/|F|.
    """
    rows = model.rows
    up = to_imu @ rows.force
    up = (up / np.linalg.norm(up, axis=0)).T
    omega = motion_at_delay(rows, alignment.delay)[0][:3].T
    # integrated, not differentiated: the force's noise would grow with its derivative
    integral = rows.interval * np.cumsum(np.cross(omega, up), axis=0)
    turned = -rows.interval * np.cumsum(cross_matrices(up), axis=0)
    matrix = np.concatenate([turned, np.broadcast_to(np.eye(3), turned.shape)], axis=2).reshape(-1, 6)
    sigma = np.maximum(np.broadcast_to(alignment.sigma_gyro_bias, 3), 1e-9)
    # the declared zero as a prior, in units of a direction's noise of 0.01; the constants of integration have none
    ridge = np.diag(np.concatenate([(0.01 / sigma) ** 2, np.zeros(3)]))
    return np.linalg.solve(matrix.T @ matrix + ridge, matrix.T @ (up + integral).ravel())[:3]


def start_up(model: Model, to_imu: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Return the direction opposite to gravity at the first node: the mean of the force, turned back to it."""
    signals = MotionSignals(model, {**unknowns(np.zeros(COUNT)), "gyro_bias": bias})
    attitude = signals.attitude_at_nodes[model.rows.at_rows]
    # at rest the force is the weight at every sample: turned back to the start, its mean points up
    mean = np.einsum("nij,jn->i", attitude, to_imu @ model.rows.force)
    return mean / np.linalg.norm(mean)
