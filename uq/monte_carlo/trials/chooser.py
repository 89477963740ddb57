"""The choice of an engine, case by case: sums where they tell what the sources do, samples where not.

Each kind of error says what stands for it in sums beside the sources that act with it, or why there is nothing
(:meth:`uq.sources.source.ErrorKind.beyond_sums`). A case in which nothing is drawn is the same in every trial: where it
needs samples, these are visited once.

One engine for all cases would be simpler, and dear: with a step of the force that is coarse against its noise, 2 of 28
cases of ``many-errors.toml`` need samples, which take 2.3 ms a trial; all 28 by samples take 12.5 ms. So each case has
its engine, and a result says which cases went by samples.

Sums have limits: a trial on sums leaves out the noise's third powers, and takes what it draws as normal
(:mod:`uq.monte_carlo.trials.sums_engine`). Noise of the gyro may be too large for that, or the trials too skewed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.pytree import static_field
from identify.rigid_body.inertia import Body
from uq.monte_carlo.gram_sums.case_equations import NO_NOISE
from uq.monte_carlo.gram_sums.cases import Case, cases_of
from uq.monte_carlo.gram_sums.noise_moments import RunMoments
from uq.monte_carlo.gram_sums.packed_equations import (
    about_cg,
    cell_scatter,
    equations_of_products,
    expected_by_axes,
    packed_equations,
    solution_series,
)
from uq.monte_carlo.trials.engine import Engine, Estimates, TrialSetting
from uq.monte_carlo.trials.samples_engine import SamplesEngine, prepare_samples
from uq.monte_carlo.trials.sums_engine import quasi_random
from uq.monte_carlo.trials.sums_setup import TrueRun, gyro_noises, moments_of, prepare_sums, true_run, white_covariance
from uq.monte_carlo.trials.trial_loop import RUN_ONCE
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing
from uq.sources.noise_filters import WHITE, GyroNoise
from uq.sources.source import EVERY_SAMPLE, SignalRange, Source, normal_noise_variance, signal_variance

EngineName = Literal["sums", "samples"]


class CombinedEngine(Engine):
    """Several engines, each of some cases, and the estimates of cases that are the same in every trial."""

    parts: tuple[Engine, ...]
    same: Float[Array, "estimators same 6"]
    """Estimates of the cases in which nothing is drawn."""
    order: tuple[int, ...] = static_field()
    """Place of each case among those of the parts, one part after the other, and the same ones last."""

    def batch(self, device: jax.Device) -> int:
        """Return the smallest batch of the parts."""
        return min((part.batch(device) for part in self.parts), default=1)

    @property
    def segment(self) -> int:  # type: ignore[override]
        """Return the smallest segment of the parts."""
        return min((part.segment for part in self.parts), default=1)

    def run(self, key: Key[Array, ""], indices: Int[Array, " trials"]) -> Estimates:
        """Return the estimates of all cases, from each part's draws."""
        same = jnp.broadcast_to(self.same, (len(indices), *self.same.shape))
        parts = [*(part.run(key, indices) for part in self.parts), same]
        return jnp.concatenate(parts, axis=2)[:, :, np.array(self.order)]


def engine_of(
    setting: TrialSetting,
    cases: Sequence[Case] | None = None,
    *,
    engine: EngineName = "sums",
    dtype: str = "float64",
    points: tuple[int, int] | None = None,
) -> tuple[Engine, dict[str, Any]]:
    """Return the engine of an experiment on one trajectory, and how each case is computed.

    ``in_sums``: what stands for a source that sums tell only nearly; ``by_samples``: why a case needs samples;
    ``once``: cases that are the same in every trial.

    Args:
        setting: the trajectory.
        cases: sets of sources that act together; None for all of the breakdown.
        engine: ``sums``, but for cases that they do not tell, or ``samples`` for all.
        dtype: precision of noise and signals, where samples are drawn.
        points: number of trials and seed, if those on sums are to be quasi-random.
    """
    cases = tuple(cases or cases_of(setting.sources))
    if engine == "samples":
        return prepare_samples(_with_sources_of(setting, cases), cases, dtype), {}
    run = true_run(setting)
    standing, reasons = _in_sums(run, setting.sources, setting.mixing, cases)
    noises = gyro_noises(tuple(standing.values()), setting.mixing, run.rate)
    moments = moments_of(run, list(noises.values()))
    reasons |= _large_noise(run, moments, noises, standing, setting, [c for c in cases if c.name not in reasons])
    drawn = {s.name for s in setting.sources if s.drawn}
    summed = [case for case in cases if case.name not in reasons]
    sampled = [case for case in cases if case.name in reasons and case.sources & drawn]
    same = [case for case in cases if case.name in reasons and not case.sources & drawn]
    parts: list[Engine] = []
    if summed:
        stand = [standing[s.name] for s in setting.sources if s.name in standing]
        sums = prepare_sums(run, setting._replace(sources=stand), summed, moments)
        parts.append(sums if points is None else quasi_random(sums, *points))
    if sampled:
        parts.append(prepare_samples(_with_sources_of(setting, sampled), sampled, dtype))
    computed = {
        "in_sums": _approximations(setting.sources, summed),
        "by_samples": {case.name: reasons[case.name] for case in sampled},
        "once": [case.name for case in same],
    }
    computed = {key: value for key, value in computed.items() if value}
    if len(parts) == 1 and not same:
        return parts[0], computed
    once = estimates_without_draws(setting, same, dtype) if same else jnp.zeros((len(setting.estimators), 0, 6))
    places = {case: k for k, case in enumerate([*summed, *sampled, *same])}
    order = tuple(places[case] for case in cases)
    return CombinedEngine(cases=cases, parts=tuple(parts), same=once, order=order), computed


def _large_noise(
    run: TrueRun, moments: RunMoments, noises: Mapping[str, GyroNoise], standing: Mapping[str, Source],
    setting: TrialSetting, cases: Sequence[Case],
) -> dict[str, str]:  # fmt: skip
    """Return why the gyro's noise is beyond sums, by the name of each case in which it is."""
    reasons = {}
    for case in cases:
        acting = [noise for name, noise in noises.items() if name in case.sources]
        cell = [s for s in standing.values() if s.white and not s.of_gyro and s.name in case.sources]
        covariance = white_covariance(cell, setting.mixing)
        if acting and (reason := beyond_sums(run, moments, GyroNoise.together(acting), covariance, setting.body)):
            reasons[case.name] = reason
    return reasons


def _approximations(sources: Sequence[Source], cases: Sequence[Case]) -> dict[str, str]:
    """Return the approximation, in words, of each source of these cases that sums tell only nearly."""
    acting = {name for case in cases for name in case.sources}
    return {s.name: s.error_kind.in_sums_as for s in sources if s.error_kind.in_sums_as and s.name in acting}


def estimates_without_draws(
    setting: TrialSetting, cases: Sequence[Case], dtype: str = "float64"
) -> Float[Array, "estimators cases 6"]:
    """Return the estimates of cases in which nothing is drawn, from one pass over the samples."""
    return _first_trial(prepare_samples(_with_sources_of(setting, cases), cases, dtype))


def _with_sources_of(setting: TrialSetting, cases: Sequence[Case]) -> TrialSetting:
    acting = [source for source in setting.sources if any(source.name in case.sources for case in cases)]
    return setting._replace(sources=acting)


def _in_sums(
    run: TrueRun, sources: Sequence[Source], mixing: Sequence[Mixing], cases: Sequence[Case]
) -> tuple[dict[str, Source], dict[str, str]]:
    """Return the source that stands for each in sums, by name, and the reason of each case that needs samples."""
    standing: dict[str, Source] = {}
    reasons: dict[str, str] = {}
    for case in cases:
        acting = [source for source in sources if source.name in case.sources]
        if reason := _sources_beyond_sums(acting, mixing, run) or _noise_beyond_sums(acting, mixing):
            reasons[case.name] = reason
        else:
            standing |= {source.name: _standing(source, run.rate) for source in acting}
    return standing, reasons


def _standing(source: Source, rate: float) -> Source:
    """Source that stands for one in sums: normal white noise where nothing is drawn, but the error acts as noise."""
    variance = source.white_variance(rate)
    if source.drawn or variance is None:
        return source
    return replace(source, kind="precision", sigma=np.sqrt(variance), shape=Normal(0.0, 1.0), settings={})


def _sources_beyond_sums(acting: Sequence[Source], mixing: Sequence[Mixing], run: TrueRun) -> str | None:
    """Return why sums do not tell the effect of a source among those of a case: the first one's reason."""
    for source in acting:
        if reason := _source_beyond_sums(source, acting, mixing, run):
            return f"{source.name} {reason}"
    return None


def _source_beyond_sums(source: Source, acting: Sequence[Source], mixing: Sequence[Mixing], run: TrueRun) -> str | None:
    if source.constant and source.perturbs is None:
        return EVERY_SAMPLE
    if source.perturbs == "gyro_delay" and run.remainder > LARGEST_REMAINDER:
        return "is too long for a polynomial"
    if source.signal is None:
        return None
    others = [other for other in acting if other.name != source.name and other.signal == source.signal]
    mixed = {name for mix in mixing for name in mix.names}
    signal = SignalRange(
        largest=np.abs(run.measured(source.signal)).max(axis=1), variance=signal_variance(others, source.signal),
        noise=np.sqrt(normal_noise_variance((s for s in others if s.name not in mixed), run.rate))[None],
        same_kind=tuple(other for other in others if other.error_kind is source.error_kind),
    )  # fmt: skip
    return source.error_kind.beyond_sums(source, signal)


def _noise_beyond_sums(acting: Sequence[Source], mixing: Sequence[Mixing]) -> str | None:
    """Return why the moments of the sums do not cover the noise of a case; None: they do."""
    noise = [source for source in acting if source.noise]
    for source in noise:
        if source.white and source.of_gyro and not np.all(np.isfinite(source.shape.excess_kurtosis)):
            return f"{source.name} has no fourth moment"
    gyro = {source.name for source in noise if source.of_gyro}
    if any(gyro & set(mix.names) and len({s.name for s in noise} & set(mix.names)) > 1 for mix in mixing):
        return "noise of the gyro is correlated with other noise"
    return None


@partial(jax.jit, compiler_options=RUN_ONCE)
def _first_trial(engine: SamplesEngine) -> Float[Array, "estimators cases 6"]:
    """Return the estimates of one trial: where nothing is drawn, of every trial."""
    return engine.run(jax.random.key(0), jnp.zeros(1, int))[0]


LARGEST_REMAINDER = 1e-4
"""Largest error of sums that are interpolated between delays, in parts of the delay's largest effect."""
LARGEST_NOISE = 0.04
"""Root mean square of the gyro's noise over that of the motion, up to which the noise's third powers count for nothing:
at 0.12 they change 3σ by 8 %, and their effect goes with its square."""
LARGEST_SKEWNESS = 0.1
"""Skewness up to which trials are drawn as normal. Skewness γ moves the ends of a 95 % interval by γ/6 (1.96² - 1) of
the standard uncertainty (Cornish and Fisher), 2.4 % of the half-width."""
SKEWNESS = 4.0
"""Skewness of a sum of squares of noise times √n: √8 of independent ones, 1.36 times as much of differences."""


def beyond_sums(
    run: TrueRun, moments: RunMoments, noise: GyroNoise, cell: Float[np.ndarray, "6 6"], body: Body
) -> str | None:
    """Return why a case needs samples; None: sums tell it.

    Args:
        run: without noise.
        moments: of its sums.
        noise: of the gyro, in this case.
        cell: covariance of the load cell's white noise of one sample, in this case.
        body: that is moved.
    """
    variance = sum(np.trace(size) * moments.omega[f] for f, size in noise.parts.items())
    count = run.valid.sum()
    ratio = np.sqrt(variance / max(np.sum(np.square(run.signals[:3] * run.valid)) / count, 1e-300))
    if ratio > LARGEST_NOISE:
        return f"the gyro's noise is {100 * ratio:.2g} % of the motion"
    if noise.parts.keys() <= {WHITE} and SKEWNESS / np.sqrt(count) <= LARGEST_SKEWNESS:
        return None  # the largest that white noise can cause
    skewness = max(np.max(predicted_skewness(run, moments, noise, cell, body, k)) for k in range(len(run.taps)))
    if skewness > LARGEST_SKEWNESS:
        return f"the squares of the gyro's noise skew the trials by {skewness:.2g}"
    return None


def predicted_skewness(
    run: TrueRun, moments: RunMoments, noise: GyroNoise, cell: Float[np.ndarray, "6 6"], body: Body, estimator: int
) -> Float[np.ndarray, "6"]:
    """Return the approximate largest skewness of each component's estimate that the gyro's noise can cause.

    With effects linear (l) and quadratic (q) in it, the third cumulant is ``6 Jᵀ K H K J + 8 tr (H K)³``: of the size
    of ``√8 σ_q (σ_l² + σ_q²) / √n`` for n independent squares. A random walk has few of them. Beside them the load
    cell's noise counts, other errors not.
    """
    features, r_cg = [*range(10), -3, -2, -1], np.asarray(body.r_cg_from_q)
    # the constant term: the sums at the delay in the middle
    gram = np.asarray(run.sums.gram[0, estimator])[np.ix_(features, features)]
    moment = np.asarray(run.sums.wrench[0, estimator])[features, :6] @ about_cg(r_cg).T
    _, by_equations, _ = solution_series(packed_equations(gram, moment, NO_NOISE))
    by_product = by_equations @ equations_of_products(moments.algebra, estimator, r_cg)
    by_cell = cell_scatter(expected_by_axes(gram, NO_NOISE), cell, r_cg)

    def variance(slope: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        return np.einsum("ik,kl,il->i", slope, covariance, slope)

    linear, squares, third = variance(by_product, moments.linear_covariance(noise)), np.zeros(6), np.zeros(6)
    for filter_, size in noise.parts.items():
        # filter by filter: third cumulants of independent terms add
        part = GyroNoise({filter_: size}, noise.third_cumulant, noise.fourth_cumulant)
        quadratic = variance(by_product, moments.covariance(part) - moments.linear_covariance(part))
        independent = run.valid.sum() if filter_ == WHITE else 2.0
        third += SKEWNESS / np.sqrt(independent) * np.sqrt(np.maximum(quadratic, 0)) * (linear + quadratic)
        squares += quadratic
    total = linear + squares + variance(by_equations, by_cell)
    return np.divide(third, total**1.5, out=np.zeros(6), where=total > 0)
