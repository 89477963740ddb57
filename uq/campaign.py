"""The Monte Carlo campaign: thousands of trials, batched, on every device; statistics of each case and estimator."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, PartitionSpec

from identify.estimator import EstimatorSpec
from identify.inertia import COMPONENTS
from identify.precision import check_precision
from identify.tables import html_table, text_table, with_error
from identify.trajectory import Motion, sample
from uq.experiment import Experiment, ExperimentError, TrajectorySpec, samples
from uq.measurement import Platform
from uq.provenance import provenance
from uq.sampled import SampledSetup, any_trial, needs_samples, prepare_any
from uq.sources import BLOCK
from uq.trial import Case, Estimator, Sampling, Setup, TrialEstimates

GRAM_METRE = 1e3
"""g·m² in a kg·m²."""

Progress = Callable[[str, int, int], None]
"""Called with the trajectory's name, the trials done and the trials asked for."""


@dataclass(frozen=True)
class Statistics:
    """What the trials of one case say of the six components, in kg·m², in the order of ``COMPONENTS``."""

    mean_error: np.ndarray
    """Mean of estimate minus truth: the bias."""
    mean_error_standard_error: np.ndarray
    three_sigma: np.ndarray
    """Three standard deviations of the estimates: the source's index of uncertainty."""
    three_sigma_standard_error: np.ndarray
    """From the fourth moment of the estimates, so that it holds for any distribution."""

    @classmethod
    def of(cls, errors: np.ndarray) -> "Statistics":
        """Return the statistics of errors, shape (trials, 6), leaving out trials that failed (NaN)."""
        errors = errors[np.isfinite(errors).all(axis=1)]
        n = len(errors)
        if n < 2:
            nothing = np.full(errors.shape[1], np.nan)
            return cls(errors.mean(0) if n else nothing, nothing, nothing, nothing)
        mean = errors.mean(0)
        variance = errors.var(0, ddof=1)
        fourth = ((errors - mean) ** 4).mean(0)
        of_variance = np.maximum(fourth - variance**2 * (n - 3) / (n - 1), 0) / n
        with np.errstate(invalid="ignore", divide="ignore"):
            of_sigma = np.where(variance > 0, np.sqrt(of_variance) / (2 * np.sqrt(variance)), 0.0)
        return cls(mean, np.sqrt(variance / n), 3 * np.sqrt(variance), 3 * of_sigma)

    def to_dict(self) -> dict[str, dict[str, float | None]]:
        """Return the four figures by component, in g·m²; a figure that does not exist is None."""
        return {
            name: {
                component: float(value) * GRAM_METRE if np.isfinite(value) else None
                for component, value in zip(COMPONENTS, getattr(self, name), strict=True)
            }
            for name in ("mean_error", "mean_error_standard_error", "three_sigma", "three_sigma_standard_error")
        }


@dataclass(frozen=True)
class Breakdown:
    """One estimator on one trajectory: what each group and each source does to the answer."""

    groups: Mapping[str, Statistics]
    """``total`` (all sources) and each group alone."""
    sources: Mapping[str, Statistics]
    """Each source alone."""
    failed: int
    """Trials in which some case could not be solved; they are left out of that case."""

    @property
    def total(self) -> Statistics:
        """All sources together."""
        return self.groups["total"]

    def share(self, group: str) -> float:
        """Return a group's (or source's) share: its 3σ alone over the total's, averaged over the components."""
        alone = self.groups[group] if group in self.groups else self.sources[group]
        return float(np.mean(alone.three_sigma / self.total.three_sigma))


@dataclass(frozen=True)
class MonteCarloResult:
    """The outcome of a campaign. ``result["T1", "central"]`` is one :class:`Breakdown`."""

    trials: int
    seed: int
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown]]
    """By trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any] = field(repr=False)
    errors: Mapping[str, np.ndarray] = field(repr=False, compare=False)
    """Estimate minus truth of every trial, by trajectory: (trials, estimators, cases, 6) [kg·m²]."""

    def __getitem__(self, key: tuple[str, str]) -> Breakdown:
        trajectory, estimator = key
        return self.breakdowns[trajectory][estimator]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²."""
        return {
            "trials": self.trials,
            "seed": self.seed,
            "unit": "g*m^2",
            "trajectories": {
                trajectory: {
                    estimator: {
                        "groups": {name: s.to_dict() for name, s in breakdown.groups.items()},
                        "sources": {name: s.to_dict() for name, s in breakdown.sources.items()},
                        "failed_trials": breakdown.failed,
                    }
                    for estimator, breakdown in of_trajectory.items()
                }
                for trajectory, of_trajectory in self.breakdowns.items()
            },
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the summary: mean error and 3σ of each component with standard errors, in g·m²."""
        rows = []
        for trajectory, estimator in self.pairs():
            s = self[trajectory, estimator].total
            mean = map(with_error, GRAM_METRE * s.mean_error, GRAM_METRE * s.mean_error_standard_error)
            sigma = map(with_error, GRAM_METRE * s.three_sigma, GRAM_METRE * s.three_sigma_standard_error)
            rows += [[trajectory, estimator, "mean error", *mean], ["", "", "3σ", *sigma]]
        return ["trajectory", "estimator", "g·m²", *COMPONENTS], rows

    def share_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the breakdown: each group's and source's 3σ alone over the total's, per cent."""
        first = self[self.pairs()[0]]
        names = [name for name in (*first.groups, *first.sources) if name != "total"]
        rows = []
        for trajectory, estimator in self.pairs():
            with np.errstate(invalid="ignore", divide="ignore"):
                shares = [100 * self[trajectory, estimator].share(name) for name in names]
            rows.append([trajectory, estimator, *(f"{round(x, 6):.3g}" if np.isfinite(x) else "–" for x in shares)])
        return ["3σ alone, % of total", "", *(name.replace("_", " ") for name in names)], rows

    def pairs(self) -> list[tuple[str, str]]:
        """Return every trajectory with every estimator."""
        return [(trajectory, estimator) for trajectory, of in self.breakdowns.items() for estimator in of]

    def findings(self) -> list[str]:
        """Return what a reader must not miss: warnings, failed trials, mean errors larger than their 3σ."""
        found = list(self.warnings)
        for trajectory, estimator in self.pairs():
            breakdown = self[trajectory, estimator]
            if breakdown.failed:
                found.append(
                    f"{trajectory}, {estimator}: {breakdown.failed} of {self.trials} trials failed and are left out."
                )
            mean, sigma = np.abs(breakdown.total.mean_error), breakdown.total.three_sigma
            excess = [
                f"{COMPONENTS[k]} {GRAM_METRE * breakdown.total.mean_error[k]:.3g} g·m² "
                f"({mean[k] / sigma[k]:.3g} × 3σ)".replace("-", "−")
                for k in np.flatnonzero(mean > sigma)
            ]
            if excess:
                found.append(f"{trajectory}, {estimator}: the mean error exceeds 3σ: {', '.join(excess)}.")
        return found

    def _title(self) -> str:
        return f"Monte Carlo, {self.trials:,} trials, seed {self.seed}"

    def __repr__(self) -> str:
        found = [f"attention: {text}" for text in self.findings()]
        tables = [text_table(*self.rows()), "", text_table(*self.share_rows())]
        return "\n".join([self._title(), *tables, *([""] if found else []), *found])

    def _repr_html_(self) -> str:
        listed = "".join(f"<li>{escape(text)}</li>" for text in self.findings())
        tables = html_table(*self.rows(), caption=self._title()) + html_table(*self.share_rows())
        return tables + (f"<ul>{listed}</ul>" if listed else "")


def montecarlo(
    experiment: Experiment,
    *,
    trials: int = 10_000,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
    batch: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    progress: Progress | None = None,
) -> MonteCarloResult:
    """Run the Monte Carlo of an experiment.

    Every trial draws each source once and solves every estimator for all sources together, each group alone and each
    source alone, from the same draws. The numbers depend on the seed, the dtype, the sampling and the experiment, not
    on ``batch`` or ``devices``.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trials: number of trials, at least 1.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all. Those that run together use the same samples.
        dtype: precision of the draws and features, ``"float64"`` or ``"float32"``.
        sampling: ``"conditioned"`` draws the load cell's white noise as the sums that it leaves, given the gyro's
            draws; ``"samples"`` draws it sample by sample. The distribution is the same (:mod:`uq.trial`). Sources
            that need every sample (:mod:`uq.sampled`) have it sample by sample, whatever is asked.
        batch: trials that one device computes at a time; None for 1 on a CPU, 64 elsewhere.
        devices: devices to spread the trials over; None for all.
        progress: called after each stretch of trials.

    Raises:
        ExperimentError: no trials, no such trajectory or estimator, or nothing to estimate from.
    """
    if trials < 1:
        raise ExperimentError(f"{trials} trials: ask for one or more")
    if sampling not in get_args(Sampling):
        raise ExperimentError(f"unknown sampling '{sampling}': choose one of {', '.join(get_args(Sampling))}")
    if batch is not None and batch < 1:
        raise ExperimentError(f"batch of {batch}: ask for one or more")
    if needs_samples(experiment.sources, experiment.mixing):
        sampling = "samples"
    warned = check_precision(dtype)
    dtype = "float32" if warned else dtype
    devices = list(devices or jax.devices())
    batch = batch or (1 if devices[0].platform == "cpu" else 64)
    chosen = [experiment.estimator(name) for name in _names(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    names = _names(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]
    breakdowns, errors = {}, {}
    for name in names:
        name, spec = experiment.select(name)
        setup = prepare_setup(experiment, spec, chosen, dtype=dtype, sampling=sampling)
        estimates = run_trials(setup, trials, seed, devices, batch, _named(progress, name))
        errors[name] = np.asarray(estimates.inertia) - np.asarray(experiment.body.inertia)
        breakdowns[name] = {
            e.name: _breakdown(setup.cases, errors[name][:, k], np.asarray(estimates.ok)[:, k])
            for k, e in enumerate(chosen)
        }
    record = provenance(**experiment.inputs(), seed=seed, trials=trials, dtype=dtype, sampling=sampling, batch=batch)
    nominal = np.asarray(experiment.body.inertia)
    return MonteCarloResult(trials, seed, nominal, breakdowns, tuple(warned), record, errors)


def _names(given: str | Sequence[str] | None) -> list[str]:
    """Names without repeats."""
    return list(dict.fromkeys([given] if isinstance(given, str) else given or []))


def prepare_setup(
    experiment: Experiment,
    spec: TrajectorySpec,
    estimators: Sequence[EstimatorSpec],
    *,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
) -> Setup | SampledSetup:
    """Return what :func:`uq.sampled.any_trial` needs for one trajectory of an experiment.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    motion = true_motion(experiment, spec)
    t = motion.t
    body = experiment.body
    fitted = fitted_estimators(estimators, spec, len(t))
    return prepare_any(
        motion,
        body,
        platform_of(experiment, spec),
        experiment.sources,
        fitted,
        mixing=experiment.mixing,
        dtype=dtype,
        sampling=sampling,
    )


def fitted_estimators(estimators: Sequence[EstimatorSpec], spec: TrajectorySpec, n: int) -> list[Estimator]:
    """Return estimators with their taps for a trajectory of ``n`` samples.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    fitted = [_fitted(e, spec.rate) for e in estimators]
    for estimator in fitted:
        needed = 2 * len(estimator.taps) + 2
        if len(estimator.taps) > BLOCK:
            raise ExperimentError(f"estimator '{estimator.name}' has more than {2 * BLOCK} points: give a higher band")
        if n < needed:
            raise ExperimentError(
                f"estimator '{estimator.name}' needs {needed} samples, but the trajectory has {n}: "
                "raise its duration or rate"
            )
    return fitted


def true_motion(experiment: Experiment, spec: TrajectorySpec) -> Motion:
    """Return a trajectory's true motion at its samples."""
    platform = platform_of(experiment, spec)
    return sample(
        spec.trajectory,
        jnp.asarray(samples(spec)),
        r_cg_from_still=platform.r_cg_from_still,
        gravity=platform.gravity,
    )


def platform_of(experiment: Experiment, spec: TrajectorySpec) -> Platform:
    """Return what carries the body on a trajectory."""
    still = np.zeros(3) if spec.still == "cg" else experiment.r_cg_from_omb
    return Platform(spec.trajectory, np.array(experiment.gravity), still)


def _fitted(estimator: EstimatorSpec, rate: float) -> Estimator:
    if estimator.lowpass is not None:
        raise ExperimentError(
            f"estimator '{estimator.name}' has a low-pass, which is for recorded runs: leave it out here"
        )
    try:
        return Estimator(estimator.name, jnp.asarray(estimator.taps(rate)))
    except ValueError as error:
        raise ExperimentError(f"estimator '{estimator.name}': {error}") from None


def run_trials(
    setup: Setup | SampledSetup,
    trials: int,
    seed: int,
    devices: Sequence[jax.Device],
    batch: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> TrialEstimates:
    """Run trials 0 … ``trials`` - 1 spread over devices; return NumPy arrays with the trials on the leading axis."""
    mesh = Mesh(np.array(devices), ("trials",), axis_types=(AxisType.Auto,))
    stretch = min(_stretch(batch), -(-trials // len(devices))) * len(devices)
    parts = []
    for first in range(0, trials, stretch):
        part = _batch(setup, jax.random.key(seed), jnp.arange(first, first + stretch), mesh, batch)
        parts.append(jax.tree.map(np.asarray, part))
        if progress:
            progress(min(first + stretch, trials), trials)
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:trials], *parts)


def _stretch(batch: int) -> int:
    """Trials a device does between two reports of progress: whole batches, some hundred trials."""
    return batch * max(1, 100 // batch)


@eqx.filter_jit
def _batch(setup: Setup | SampledSetup, key: jax.Array, trials: jax.Array, mesh: Mesh, batch: int) -> TrialEstimates:
    def on_one_device(setup, key, mine):
        one = lambda index: any_trial(setup, key, index)  # noqa: E731
        return jax.lax.map(one, mine, batch_size=None if batch == 1 else batch)

    arrays, static = eqx.partition(setup, eqx.is_array)
    everywhere, split = PartitionSpec(), PartitionSpec("trials")
    sharded = jax.shard_map(
        lambda arrays, key, mine: on_one_device(eqx.combine(arrays, static), key, mine),
        mesh=mesh,
        in_specs=(everywhere, everywhere, split),
        out_specs=split,
        check_vma=False,
    )
    return sharded(arrays, key, trials)


def _breakdown(cases: Sequence[Case], errors: np.ndarray, ok: np.ndarray) -> Breakdown:
    groups: dict[str, Statistics] = {}
    sources: dict[str, Statistics] = {}
    for k, case in enumerate(cases):
        kind, _, name = case.name.partition(":")
        (sources if kind == "source" else groups)[name or kind] = Statistics.of(errors[:, k])
    return Breakdown(groups, sources, int(np.sum(~ok.all(axis=1))))


def _named(progress: Progress | None, name: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, asked: progress(name, done, asked)
