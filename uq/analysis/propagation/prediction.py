"""The uncertainty predicted for a motion by the law of propagation: differentiable through the motion itself.

An optimiser needs what :func:`uq.analysis.propagation.experiment_law.law` computes a thousand times over, and its
gradient. So these are the law's first-order covariance and second-order mean, for least squares with a differentiator
that distorts nothing, from as few instants as a motion of limited band allows; each counts for the samples that it
stands for.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from identify.least_squares.covariance_matrices import root_of
from identify.motion.trajectory import Motion, sample
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body, unpack
from identify.rigid_body.regressor import omega_r
from uq.analysis.propagation.expansion import error_maps, mapped_sums, tensor_of
from uq.analysis.propagation.inputs import constants_of, inputs_of_cases
from uq.analysis.propagation.trajectory_sums import jerk_of
from uq.analysis.propagation.uncovered_sources import ANYWHERE, BeyondLawError, beyond_the_prediction
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.monte_carlo.campaign.trial_setup import platform_of
from uq.monte_carlo.gram_sums.case_equations import noise_expectation
from uq.monte_carlo.gram_sums.cases import cases_of
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis, true_elements
from uq.monte_carlo.gram_sums.packed_equations import about_cg, packed_equations
from uq.monte_carlo.gram_sums.run_sums import RunSums
from uq.sources.constant_errors import unravel


class Predicted(NamedTuple):
    """The prediction for a motion."""

    mean_error: Float[Array, "6"]
    """Expected estimate less the truth [kg·m²]."""
    covariance: Float[Array, "6 6"]
    """Covariance of the packed tensor [(kg·m²)²]."""


class Prediction(Pytree):
    """An experiment's errors, ready to be propagated through any motion."""

    body: Body
    platform: Platform
    """Platform that carries the body, whatever the trajectory."""
    expected: Float[Array, " e"]
    """Expectation of the errors that are drawn once, :class:`uq.sources.constant_errors.Errors` raveled."""
    directions: Float[Array, "e d"]
    """Change of these errors by one standard deviation of each of d uncorrelated numbers."""
    wrench: Float[Array, "6 6"]
    """Covariance of the white noise of force and moment at one sample."""
    gyro: Float[Array, "3"]
    """Variance of omega's white noise at one sample [rad²/s²]."""
    rate: float = static_field()
    """Sample rate of the sensors [Hz]."""
    basis: WrenchBasis = static_field()

    @classmethod
    def of(cls, experiment: Experiment, spec: TrajectorySpec) -> "Prediction":
        """Prepare an experiment's sources for motions that are sampled and carried as this one.

        Raises:
            BeyondLawError: sources that the law cannot take, or that are not in the prediction.
        """
        if reasons := beyond_the_prediction(experiment.sources, experiment.mixing, ANYWHERE):
            raise BeyondLawError(reasons)
        constants = constants_of(experiment.sources, experiment.mixing)
        total = [case for case in cases_of(experiment.sources) if case.name == "total"]
        inputs = inputs_of_cases(total, constants, experiment.sources, experiment.mixing, spec.rate, ANYWHERE)
        return cls(
            body=experiment.body, platform=platform_of(experiment, spec),
            expected=jnp.asarray(constants.errors @ constants.mean),
            directions=jnp.asarray((constants.errors * constants.sigma) @ root_of(constants.correlation)),
            wrench=jnp.asarray(inputs.wrench[0]), gyro=jnp.asarray(inputs.gyro[0]), rate=spec.rate,
            basis=WrenchBasis.for_sources(experiment.sources),
        )  # fmt: skip

    @jax.jit
    def moments(
        self,
        motion: Motion,
        jerk: Float[Array, "3 n"],
        gain: Float[Array, ""] | float,
        samples: Float[Array, " #n"] | float | None = None,
    ) -> Predicted:
        """Return mean error and covariance of the tensor predicted for a motion.

        The mean error is ``f(E[S], E[θ]) + ½ tr(H Σ)`` less the truth: white noise of omega adds its own squares to the
        sums S, most of all those of alpha's noise to ``ΩᵀΩ``, so that moments come out too small, however long the run;
        errors θ that are drawn once enter by their expectation and, through the estimate's curvature H, by their
        covariance Σ. First and second derivatives by θ are differences over one standard deviation each way, which cost
        a fraction of exact ones to compile and are off by third derivatives.

        Args:
            motion: at n instants, far fewer than the run's samples; from rest to rest or periodic.
            jerk: derivative of alpha in B [rad/s³].
            gain: standard deviation of alpha's noise by that of omega's (``EstimatorSpec.alpha_noise_gain``) [1/s].
            samples: number that an instant stands for, one number or one an instant, where the motion is one period of
                a longer run, or of each of its stages; None: those between two instants, which are uniform.
        """
        if samples is None:
            samples = (motion.t[-1] - motion.t[0]) / (len(motion.t) - 1) * self.rate
        weights = jnp.broadcast_to(jnp.asarray(samples), motion.t.shape)
        rows = jax.vmap(omega_r, in_axes=(1, 1))(motion.omega, motion.alpha)
        inverse = jnp.linalg.inv(jnp.einsum("n,nij,nik->jk", weights, rows, rows))
        # sandwich (ΩᵀΩ)⁻¹ Ωᵀ C Ω (ΩᵀΩ)⁻¹: least squares with equal weights, whatever the noise's covariance C
        noise = inverse @ (self._of_cell(rows, weights) + self._of_gyro(motion, jerk, weights)) @ inverse
        sums, omega_noise = self._sums(motion, jerk, weights), jnp.diag(self.gyro)
        expectation = noise_expectation(omega_noise, jnp.square(jnp.asarray(gain, float)) * omega_noise)

        def estimate(error):
            maps = error_maps(self.body, self.platform, self.basis, unravel(self.expected + error))
            return tensor_of(packed_equations(*mapped_sums(maps, sums.at(maps.delay)), expectation))

        there = self.directions.T
        value, more, less = jnp.split(
            jax.vmap(estimate)(jnp.concatenate([jnp.zeros_like(self.expected)[None], there, -there])),
            [1, 1 + len(there)],
        )
        # steps of one standard deviation: slopes are columns of J root(Σ), and curvatures add up to tr(H Σ)
        slope, curvature = (more - less) / 2, more + less - 2 * value
        return Predicted(value[0] + curvature.sum(axis=0) / 2 - self.body.inertia, noise + slope.T @ slope)

    @property
    def moment_noise(self) -> Float[Array, "3 3"]:
        """Covariance of the white noise of ``M - r × F`` at one sample [N²·m²]."""
        to_moment = about_cg(jnp.asarray(self.body.r_cg_from_q))
        return to_moment @ self.wrench @ to_moment.T

    def _of_cell(self, rows: Float[Array, "n 3 6"], weights: Float[Array, " n"]) -> Float[Array, "6 6"]:
        """Sum over instants of ``Ωᵀ S Ω``, S the covariance of the noise of ``M - r × F``."""
        return jnp.einsum("n,nij,ik,nkl->jl", weights, rows, self.moment_noise, rows)

    def _of_gyro(self, motion: Motion, jerk: Array, weights: Float[Array, " n"]) -> Float[Array, "6 6"]:
        """Return the covariance by omega's noise in ``Ω i``, the part through alpha by a summation by parts."""
        inertia, tensor = self.body.inertia, unpack(self.body.inertia)

        def of_instant(omega, alpha, jerk):
            rows, slope = jax.jvp(omega_r, (omega, alpha), (alpha, jerk))
            by_omega = jax.jacfwd(lambda w: omega_r(w, alpha) @ inertia)(omega)
            # Abel: Σ Ωᵀ I n′ = -Σ (Ωᵀ)′ I n for noise n of omega, as nothing moves at both ends (or both are the same)
            return rows.T @ by_omega - slope.T @ tensor

        acts = jax.vmap(of_instant, in_axes=(1, 1, 1))(motion.omega, motion.alpha, jerk)
        return jnp.einsum("n,nji,i,nki->jk", weights, acts, self.gyro, acts)

    def _sums(self, motion: Motion, jerk: Array, weights: Float[Array, " n"]) -> RunSums:
        """Sums without noise, and their second order in a delay of the gyro.

        From rest to rest, or over a period, the sums of omega's and alpha's products do not know a delay, and
        ``Σ x'' y = -Σ x' y'``: the second derivative needs no more than the jerk. It is taken of ``M - r × F`` alone.
        """
        t = motion.t - motion.t[0]
        wrench = jnp.concatenate([self.basis.sampled(self.body, motion), jnp.ones((1, len(t)))])

        def features(delay):
            omega, alpha = motion.omega - delay * motion.alpha, motion.alpha - delay * jerk
            return jnp.concatenate([true_elements(omega, alpha, t), alpha])

        def sums(phi):
            return weights[None] * phi @ phi.T, weights[None] * phi @ wrench.T

        phi, slopes = jax.jvp(features, (jnp.zeros(()),), (jnp.ones(()),))
        (gram, with_wrench), slope = jax.jvp(sums, (phi,), (slopes,))
        moment_rate = lambda *at: jax.jvp(lambda w, a: omega_r(w, a) @ self.body.inertia, at[:2], at[1:])[1]  # noqa: E731
        moment = jax.vmap(moment_rate, in_axes=(1, 1, 1), out_axes=1)(motion.omega, motion.alpha, jerk)
        bent = jnp.zeros_like(with_wrench).at[:, 3:6].set(weights[None] * slopes @ moment.T / 2)
        return RunSums(jnp.stack([gram, slope[0], jnp.zeros_like(gram)]), jnp.stack([with_wrench, slope[1], bent]))


def predicted(experiment: Experiment, spec: TrajectorySpec, rate: float, gain: float) -> Predicted:
    """Return mean error and covariance of the tensor predicted for a trajectory over its whole run.

    Args:
        experiment: with platform, body and sources.
        spec: the trajectory.
        rate: of the instants at which the motion is sampled [Hz].
        gain: of the differentiator's noise, as in :meth:`Prediction.moments` [1/s].

    Raises:
        ExperimentError: a source that the law cannot take, or that moves nothing in its first order.
    """
    platform, t = platform_of(experiment, spec), jnp.arange(0.0, spec.duration, 1 / rate)
    motion = sample(spec.trajectory, t, r_cg_from_still=platform.r_cg_from_still, gravity=platform.gravity)
    # an array: a plain number would be compiled in
    return Prediction.of(experiment, spec).moments(motion, jerk_of(spec.trajectory, t), jnp.asarray(gain))
