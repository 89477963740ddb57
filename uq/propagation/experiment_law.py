"""The law of propagation for an experiment: every source, group and their total, without a single draw.

White noise of the gyro changes the Gram sums by terms linear and quadratic in it, so their mean is not the noise-free
sums. The law is therefore expanded about the EXPECTED sums; the textbook's, about the noise-free run, stands beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from identify.floating_point import check_precision
from identify.motion.trajectory import Motion
from uq.campaign.campaign import distinct
from uq.campaign.statistics import Breakdown, large_mean_error
from uq.campaign.trial_setup import fitted_estimators, platform_of, true_motion
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.gram_sums import gram_moments
from uq.gram_sums.error_maps import Columns, true_elements
from uq.gram_sums.gram_moments import products_of_estimator
from uq.gram_sums.setup import Estimator, cases_of
from uq.gram_sums.sums_over_samples import alphas_of, moments_of_signals
from uq.propagation.expansion import (
    NoiseFreeRun,
    Point,
    RunSums,
    TrueSums,
    expand_at,
    of_wrench_noise,
    propagate_case,
    to_equations,
)
from uq.propagation.inputs import CaseInputs, Constants, Peaks, constants_of, inputs_of_cases
from uq.propagation.law_result import LawResult, LawStatistics
from uq.sources.constant_errors import perturbed
from uq.sources.source import Source
from uq.trials.trial import valid_samples


@dataclass(frozen=True)
class PreparedLaw:
    """Sums over an experiment's runs: the law for any size of its errors follows in milliseconds."""

    experiment: Experiment
    estimators: tuple[str, ...]
    runs: dict[str, RunSums]
    """By trajectory."""
    peaks: dict[str, Peaks]
    warnings: tuple[str, ...]

    def evaluate(self, sources: Sequence[Source] | None = None) -> LawResult:
        """Return the law for the experiment's sources, or for others of the same kinds in their place.

        Raises:
            ExperimentError: a source that the law cannot take, or one of a kind that was not prepared for.
        """
        if other := perturbed(sources or ()) - perturbed(self.experiment.sources):
            raise ExperimentError(
                f"errors that the law was not prepared for ({', '.join(sorted(other))}): prepare anew"
            )
        experiment = self.experiment if sources is None else replace(self.experiment, sources=tuple(sources))
        cases = cases_of(experiment.sources)
        constants = constants_of(experiment.sources, experiment.mixing)
        breakdowns, warnings = {}, list(self.warnings)
        for name, run in self.runs.items():
            rate = experiment.trajectories[name].rate
            given = (experiment.sources, experiment.mixing, rate, self.peaks[name])
            statistics = _of_run(run, constants, inputs_of_cases(cases, constants, *given))
            breakdowns[name] = {
                estimator: Breakdown.of(
                    cases, (LawStatistics(*(leaf[k, c] for leaf in statistics)) for c in range(len(cases)))
                )
                for k, estimator in enumerate(self.estimators)
            }
            for estimator, breakdown in breakdowns[name].items():
                warnings += large_mean_error(f"{name}, {estimator}", breakdown.total)
        nominal = np.asarray(experiment.body.inertia)
        return LawResult(nominal, breakdowns, tuple(warnings), experiment.inputs())


def law(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> LawResult:
    """Propagate an experiment's errors by the law of propagation.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all. Those that are asked for together use the samples
            where all of them have a derivative, as in the Monte Carlo.

    Returns:
        Mean error and dispersion of every component for all sources together, each group alone and each source alone.

    Raises:
        ExperimentError: no such trajectory or estimator, nothing to estimate from, or a source beyond the law.
    """
    return prepare_law(experiment, trajectories, estimators).evaluate()


def prepare_law(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> PreparedLaw:
    """Sum over every trajectory once; see :func:`law`."""
    warnings = check_precision("float64")
    chosen = [experiment.estimator(name) for name in distinct(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    runs, peaks = {}, {}
    for name in distinct(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]:
        name, spec = experiment.select(name)
        motion = true_motion(experiment, spec)
        runs[name], peaks[name] = _run_sums(experiment, spec, motion, fitted_estimators(chosen, spec, len(motion.t)))
    return PreparedLaw(experiment, tuple(e.name for e in chosen), runs, peaks, tuple(warnings))


def _run_sums(
    experiment: Experiment, spec: TrajectorySpec, motion: Motion, estimators: Sequence[Estimator]
) -> tuple[RunSums, Peaks]:
    columns, platform = Columns.of(experiment.sources), platform_of(experiment, spec)
    wrench = columns.sampled(experiment.body, motion)
    taps, valid = [e.taps for e in estimators], valid_samples(len(motion.t), estimators)
    alphas = alphas_of(motion.omega, taps)
    moments = moments_of_signals(jnp.concatenate([motion.omega, alphas, wrench[:6]]), valid, taps)
    t = motion.t - motion.t[0]

    def sums(delay):
        omega = jax.vmap(spec.trajectory.omega, out_axes=1)(motion.t - delay)
        return _true_sums(omega, t, wrench, valid, taps)

    if "gyro_delay" in perturbed(experiment.sources):
        slope = lambda delay: jax.jvp(sums, (delay,), (jnp.ones(()),))[1]  # noqa: E731
        derivatives = jax.jit(lambda: jax.jvp(slope, (jnp.zeros(()),), (jnp.ones(()),)))()
    else:
        derivatives = None
    now = _true_sums(motion.omega, t, wrench, valid, taps)
    first, second = derivatives or (jax.tree.map(jnp.zeros_like, now),) * 2
    signals = {"F": wrench[:3], "M": wrench[3:6], "omega": motion.omega}
    peaks = Peaks(
        {name: np.asarray(jnp.max(jnp.abs(signal), axis=1)) for name, signal in signals.items()},
        {name: np.asarray(jnp.sqrt(jnp.mean(jnp.diff(signal) ** 2, axis=1))) for name, signal in signals.items()},
    )
    # without the trajectory, whose type would have the law compiled again
    platform = eqx.tree_at(lambda p: p.trajectory, platform, None)
    return RunSums(NoiseFreeRun(experiment.body, platform, (now, first, second), columns), moments), peaks


@jax.jit
def _true_sums(omega: Array, t: Array, wrench: Array, valid: Array, taps: Sequence[Array]) -> TrueSums:
    phi = jnp.concatenate([true_elements(omega, omega, t), alphas_of(omega, taps)]) * valid[None]
    return TrueSums(phi @ phi.T, phi @ wrench.T)


# --- a single run ---


def _of_run(run: RunSums, constants: Constants, cases: CaseInputs) -> tuple[np.ndarray, ...]:
    """The fields of :class:`LawStatistics`, estimators and cases leading."""
    expected = cases.acts * constants.mean @ constants.errors.T
    quiet = np.zeros_like(cases.gyro)
    points = np.concatenate([np.hstack([expected, cases.gyro]), np.hstack([expected, quiet])])
    distinct, index = np.unique(points, axis=0, return_inverse=True)
    variances, variant = np.unique(cases.gyro, axis=0, return_inverse=True)
    size = expected.shape[1]
    statistics = _evaluate(
        run,
        Point(jnp.asarray(distinct[:, :size]), jnp.asarray(distinct[:, size:])),
        jnp.asarray(index.reshape(2, -1)),
        jnp.asarray(variances),
        jnp.asarray(variant.ravel()),
        jnp.asarray(constants.errors * constants.sigma),
        jnp.asarray(cases.acts[:, :, None] * constants.correlation * cases.acts[:, None, :]),
        jnp.asarray(cases.wrench),
        _Freedom(*map(jnp.asarray, (constants.gum_ratio, constants.freedom, constants.joint))),
    )
    return tuple(np.asarray(leaf) for leaf in statistics)


class _Freedom(NamedTuple):
    """Degrees of freedom of the standard uncertainties (:class:`uq.propagation.inputs.Constants`)."""

    gum_ratio: Float[Array, " d"]
    freedom: Float[Array, " d"]
    joint: Float[Array, "sets d"]

    def of(self, jacobian: Array, correlation: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the GUM's standard uncertainty and its effective degrees of freedom (Welch and Satterthwaite, G.4)."""
        terms = jnp.einsum("ai,ij,aj->aij", jacobian, correlation, jacobian)
        gum_terms = terms * jnp.outer(self.gum_ratio, self.gum_ratio)[None]
        squares = jnp.einsum("si,aij,sj->as", self.joint, gum_terms, self.joint)
        variance = jnp.maximum(jnp.diag(covariance) - jnp.sum(terms - gum_terms, axis=(1, 2)), 0)
        freedom = jnp.min(jnp.where(self.joint > 0, self.freedom[None], jnp.inf), axis=1, initial=jnp.inf)
        denominator = jnp.sum(squares**2 / freedom[None], axis=1)
        effective = variance**2 / jnp.where(denominator > 0, denominator, 1)
        return jnp.sqrt(variance), jnp.where(denominator > 0, effective, jnp.inf)


class _Scatter(NamedTuple):
    """What omega's white noise does to one estimator's sums and normal equations."""

    mean: Float[Array, " products"]
    noise_free: Float[Array, " products"]
    covariance: Float[Array, "27 27"]
    linear: Float[Array, "27 27"]
    """Of the terms linear in the noise alone."""
    change: Float[Array, "27"]
    """Second-order change of the normal equations' mean about the noise-free run."""


def _scatter(run: RunSums, estimator: Int[Array, ""], variance: Float[Array, "3"], equations: Array) -> _Scatter:
    moments = run.moments
    places_of_all = [products_of_estimator(len(moments.alphas), k) for k in range(len(moments.alphas))]
    places = jnp.asarray(places_of_all)[estimator]
    rows = jnp.zeros((len(equations), len(moments.sums))).at[:, places].set(equations)
    return _Scatter(
        gram_moments.mean(moments, variance)[places],
        moments.sums[places],
        gram_moments.covariance(moments, variance, rows),
        gram_moments.first_order_covariance(moments, variance, rows),
        rows @ gram_moments.second_order_change(moments, variance),
    )


@jax.jit
def _evaluate(
    run: RunSums,
    points: Point,
    index: Array,
    variances: Float[Array, "variants 3"],
    variant: Array,
    directions: Float[Array, "e d"],
    correlation: Float[Array, "cases d d"],
    wrench: Float[Array, "cases 6 6"],
    freedom: _Freedom,
) -> tuple[Array, ...]:
    """The fields of :class:`LawStatistics` of every estimator and case of one run, estimators first.

    Args:
        run: its sums and their moments.
        points: where expansions are made.
        index: at which of them each case has its expected sums, and its noise-free run.
        variances: of omega's noise.
        variant: which of them each case has.
        directions: what one standard deviation of each drawn number does to the errors.
        correlation: of the numbers that act in each case.
        wrench: covariance of the load cell's noise in each case.
        freedom: degrees of freedom of the standard uncertainties.
    """
    nominal = jnp.asarray(run.noise_free.body.inertia)

    def of_case(estimator, index, variant, correlation, wrench):
        equations, expansions, scatter = estimator
        at, free = (jax.tree.map(lambda leaf: leaf[k], expansions) for k in index)  # noqa: B023
        noise = jax.tree.map(lambda leaf: leaf[variant], scatter)
        full = noise.covariance + of_wrench_noise(noise.mean, wrench, equations)
        linear = noise.linear + of_wrench_noise(noise.noise_free, wrench, equations)
        moments = propagate_case(at, correlation, full)
        textbook = propagate_case(free, correlation, linear, noise.change)
        uncertainty, degrees = freedom.of(at.jacobian, correlation, moments.covariance)
        errors = [value - nominal for value in (moments.mean, free.value, textbook.mean)]
        return errors[0], moments.covariance, errors[1], errors[2], textbook.first_order, uncertainty, degrees

    def of_estimator(estimator):
        equations = to_equations(jnp.asarray(run.noise_free.body.r_cg_from_q))
        expansions = jax.lax.map(lambda point: expand_at(run, estimator, point, directions), points)
        scatter = jax.lax.map(lambda variance: _scatter(run, estimator, variance, equations), variances)
        cases = jax.vmap(of_case, (None, 1, 0, 0, 0))
        return cases((equations, expansions, scatter), index, variant, correlation, wrench)

    return jax.lax.map(of_estimator, jnp.arange(len(run.moments.alphas)))
