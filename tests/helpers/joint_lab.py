"""Laboratories for the joint estimate: runs of T1 with the paper's noise, static calibrations, misaligned IMUs."""

import dataclasses
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import make_interp_spline

from identify.estimation.joint import gauss_newton
from identify.estimation.joint.priors import STATIC, PriorBlock, Setting
from identify.estimation.joint.single_run import REACH, JointRun, joint_run, prepared, search_start, whitener
from identify.least_squares.gram import solve
from identify.motion.trajectory import sample
from identify.rigid_body.dynamics import wrench
from identify.rigid_body.inertia import Body, pack
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import in_band, low_pass
from identify.signals.resample import uniform_spline
from identify.signals.run import Run
from tests.helpers.gram_lab import accumulate

BAND = 1.553
"""Of T1 [Hz]: Ω + ε of the sphere."""
SIGMA_MASS = 0.05
"""Standard uncertainty of the laboratories' mass [kg]."""


def standard_deviations(experiment):
    """The paper's σ by source name."""
    return {source.name: np.asarray(source.sigma) for source in experiment.sources}


@dataclasses.dataclass
class Laboratory:
    """One body on T1: true signals, and runs with errors."""

    experiment: object
    body: Body

    @cached_property
    def motion(self):
        spec = self.experiment.trajectories["T1"]
        t = jnp.asarray(np.arange(round(spec.duration * spec.rate)) / spec.rate)
        return sample(spec.trajectory, t, r_cg_from_still=np.zeros(3), gravity=self.experiment.gravity)

    @cached_property
    def true(self):
        m = self.motion
        found = jax.vmap(wrench, in_axes=(None, 1, 1, 1))(self.body, m.omega, m.alpha, m.specific_force_cg)
        return np.asarray(found.force), np.asarray(found.moment)

    @cached_property
    def spline(self):
        return make_interp_spline(np.asarray(self.motion.t), np.asarray(self.motion.omega.T), k=5)

    @property
    def static(self):
        """Mass, r_CG, offsets as they are, these being zero."""
        return np.concatenate([[self.body.mass], self.body.r_cg_from_q, np.zeros(6)])

    @property
    def sigma_static(self):
        s = standard_deviations(self.experiment)
        return np.concatenate([[SIGMA_MASS], s["r_cg"], s["F_bias"], s["M_bias"]])

    def run(self, rng, delay=0.0, rotation=(0.0, 0.0, 0.0)):
        """A run whose IMU is late and turned; the load cell has no offset beside what the calibration says."""
        s, t = standard_deviations(self.experiment), np.asarray(self.motion.t)
        late = self.spline(t - delay) if delay else np.asarray(self.motion.omega.T)
        seen = late @ np.asarray(exponential(jnp.asarray(rotation)))  # rows: Eᵀ omega
        force, moment = self.true
        noise = rng.standard_normal((3, len(t), 3))
        return Run(
            t, force + s["F_precision"] * noise[0], moment + s["M_precision"] * noise[1],
            seen + s["omega_precision"] * noise[2] + s["omega_bias"] * rng.standard_normal(3),
        )  # fmt: skip

    def rows(self, rng, delay=0.0, rotation=(0.0, 0.0, 0.0)):
        """The decimated rows of such a run, drawn from their own distribution instead of filtered from every sample.

        What the low-pass makes of white noise is a stationary normal process; a cycle of it is drawn by its spectrum.
        """
        s, silent = standard_deviations(self.experiment), self.silent
        spec = self.experiment.trajectories["T1"]
        taps = low_pass(spec.rate, BAND, silent.factor)
        t = (len(taps) - 1) / 2 / spec.rate + silent.step * np.arange(silent.motion.shape[1] + 1)
        seen = self.spline(t - delay) @ np.asarray(exponential(jnp.asarray(rotation)))
        sigma = np.concatenate([s["F_precision"], s["M_precision"]])
        noise = sigma * _filtered_noise(rng, taps, silent.factor, len(silent.t))
        gyro = s["omega_precision"] * _filtered_noise(rng, taps, silent.factor // silent.stride, len(t), columns=3)
        omega = seen + gyro + s["omega_bias"] * rng.standard_normal(3)
        return dataclasses.replace(
            silent, force=silent.force + noise[:, :3].T, moment=silent.moment + noise[:, 3:].T,
            motion=uniform_spline(omega, silent.step, degree=5).pieces,
        )  # fmt: skip

    @cached_property
    def silent(self):
        """The rows of a run without errors."""
        force, moment = self.true
        run = Run(np.asarray(self.motion.t), force, moment, np.asarray(self.motion.omega.T))
        return in_band(run, BAND, reach=REACH * 0.01)

    def estimate_rows(self, rows, known, alignment):
        """The unknowns and their covariance from rows, the noise being declared."""
        s = standard_deviations(self.experiment)
        sigma = np.concatenate([s["F_precision"], s["M_precision"]])
        setting = Setting({STATIC: known}, alignment, BAND, "still", self.experiment.gravity, 0.1)
        rate = self.experiment.trajectories["T1"].rate
        model, before = prepared(rows, s["omega_precision"] / np.sqrt(rate), np.zeros(3), setting)
        noise = whitener(np.diag(sigma**2) / rows.factor)
        fit = gauss_newton.solve(model, before, noise, search_start(model, before, setting))
        return np.asarray(before.theta(fit.z)), gauss_newton.posterior(fit.information, before)[0]

    def calibration(self, rng, correlated=None):
        """What static poses say of this body: drawn around the truth with the declared covariance."""
        covariance = np.diag(self.sigma_static**2) if correlated is None else correlated
        return PriorBlock(rng.multivariate_normal(self.static, covariance, method="cholesky"), covariance)

    def estimate(self, run, known, alignment) -> JointRun:
        return joint_run(run, Setting({STATIC: known}, alignment, BAND, "still", self.experiment.gravity, 0.1))

    def source_estimate(self, run, r_cg):
        """The paper's estimator with the smoothing differentiator, as the Monte Carlo runs it."""
        spec = self.experiment.estimator("smoothed")
        return np.asarray(_ordinary(*(jnp.asarray(x.T) for x in (run.omega, run.force, run.moment)),
                                    jnp.asarray(spec.taps(run.rate)), jnp.asarray(r_cg)))  # fmt: skip


def _filtered_noise(rng, taps, factor, count, columns=6):
    """Unit white noise behind the low-pass, every ``factor``-th sample: by its spectrum, folded as decimation does."""
    cycle = count + len(taps) // factor + 2  # longer than the filter, so that the ends do not meet
    gain = np.abs(np.fft.fft(taps, cycle * factor)) ** 2
    folded = gain.reshape(factor, cycle).sum(axis=0) / factor
    white = np.fft.rfft(rng.standard_normal((cycle, columns)), axis=0)
    return np.fft.irfft(white * np.sqrt(folded[: len(white), None]), cycle, axis=0)[:count]


@jax.jit
def _ordinary(omega, force, moment, taps, r_cg):
    from identify.signals.differentiate import derivative

    inner = slice(taps.shape[0], omega.shape[1] - taps.shape[0])
    sums = accumulate(omega[:, inner], derivative(omega, taps), force[:, inner], moment[:, inner])
    return solve(sums, r_cg).inertia


def random_body(rng) -> Body:
    """An admissible body of 10 to 30 kg: principal second moments of mass drawn, axes turned anyhow."""
    second = rng.uniform(0.01, 0.2, 3)
    moments = second.sum() - second
    axes = np.asarray(exponential(jnp.asarray(rng.uniform(-2, 2, 3))))
    r_cg = rng.uniform(-0.06, 0.06, 3)
    return Body(
        jnp.asarray(rng.uniform(10.0, 30.0)), jnp.asarray(r_cg), pack(jnp.asarray(axes @ np.diag(moments) @ axes.T))
    )


def shortened(experiment, duration):
    """The experiment with T1 of another duration [s]."""
    spec = experiment.trajectories["T1"]
    ramp = np.array(float(spec.trajectory.ramp) * duration / spec.duration)
    trajectory = dataclasses.replace(spec.trajectory, duration=np.array(duration), ramp=ramp)
    return dataclasses.replace(
        experiment, trajectories={"T1": dataclasses.replace(spec, duration=duration, trajectory=trajectory)}
    )
