"""The law of propagation for an experiment: every source, group and their total, without a single draw.

White noise of the gyro changes the Gram sums by terms linear and quadratic in it, so their mean is not the noise-free
sums. The law is therefore expanded about the EXPECTED sums; the textbook's, about the noise-free run, stands beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.precision import check_precision
from uq import gram_moments as moments_of
from uq.campaign import prepare_setup
from uq.experiment import Experiment, ExperimentError
from uq.gram_moments import GramMoments, gram_moments, own_products
from uq.law_expansion import OFFSETS, Errors, Propagated, SumMoments, propagate_case
from uq.law_result import LawBreakdown, LawResult, LawStatistics
from uq.sources import Source
from uq.trial import Case, cases_of

_PLACE = {"omega": 0, "F": 3, "M": 6, "r_cg": 9}
"""Where a target's offset stands among the offsets."""


@dataclass(frozen=True)
class PreparedLaw:
    """An experiment's runs summed up: the law for any size of its errors follows in milliseconds."""

    experiment: Experiment
    estimators: tuple[str, ...]
    moments: dict[str, GramMoments]
    """By trajectory."""
    warnings: tuple[str, ...]

    def evaluate(self, sources: Sequence[Source] | None = None) -> LawResult:
        """Return the law for the experiment's sources, or for others in their place."""
        sources = self.experiment.sources if sources is None else tuple(sources)
        cases = cases_of(sources)
        gyro, variances = _gyro_variances(cases, sources)
        errors = _stack([_errors([s for s in sources if s.name in case.sources]) for case in cases])
        body = self.experiment.body
        breakdowns = {}
        for name, moments in self.moments.items():
            found = _evaluate(moments, variances, gyro, errors, body.r_cg_from_q, body.inertia)
            found = jax.tree.map(np.asarray, found)
            breakdowns[name] = {
                estimator: _breakdown(cases, jax.tree.map(lambda leaf: leaf[k], found))  # noqa: B023
                for k, estimator in enumerate(self.estimators)
            }
        return LawResult(np.asarray(body.inertia), breakdowns, self.warnings, self.experiment.inputs())


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
        ExperimentError: no such trajectory or estimator, or nothing to estimate from.
    """
    return prepare_law(experiment, trajectories, estimators).evaluate()


def prepare_law(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> PreparedLaw:
    """Visit every trajectory once; see :func:`law`."""
    warned = check_precision("float64")
    chosen = [experiment.estimator(name) for name in _names(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    moments = {}
    for name in _names(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]:
        name, spec = experiment.select(name)
        moments[name] = gram_moments(prepare_setup(experiment, spec, chosen))
    return PreparedLaw(experiment, tuple(e.name for e in chosen), moments, tuple(warned))


def _names(given: str | Sequence[str] | None) -> list[str]:
    return list(dict.fromkeys([given] if isinstance(given, str) else given or []))


def _gyro_variances(cases: Sequence[Case], sources: Sequence[Source]) -> tuple[Array, Array]:
    """Which variance of the gyro's white noise each case has, and these variances, the first of them zero."""
    white = {s.name: np.square(s.sigma) for s in sources if s.kind == "precision" and s.target == "omega"}
    active = [frozenset(white) & case.sources for case in cases]
    distinct = list(dict.fromkeys([frozenset(), *active]))
    variances = [sum((white[name] for name in names), np.zeros(3)) for names in distinct]
    return jnp.array([distinct.index(names) for names in active]), jnp.asarray(np.array(variances, float))


def _errors(sources: Sequence[Source]) -> Errors:
    """The load cell's noise and the offsets that these sources cause together."""
    wrench, offsets = np.zeros(6), np.zeros(OFFSETS)
    for source in sources:
        if source.kind == "bias":
            place = _PLACE[source.target]
            offsets[place : place + 3] += np.square(source.sigma)
        elif source.target in ("F", "M"):
            place = 3 * "FM".index(source.target)
            wrench[place : place + 3] += np.square(source.sigma)
    return Errors(jnp.asarray(wrench), jnp.asarray(np.diag(np.sqrt(offsets))))


def _stack(trees: Sequence[Errors]) -> Errors:
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)


@jax.jit
def _evaluate(
    moments: GramMoments,
    variances: Float[Array, "variants 3"],
    variant: Array,
    errors: Errors,
    r_cg: Float[Array, "3"],
    nominal: Float[Array, "6"],
) -> Propagated:
    """Every estimator and case of one trajectory, estimators first."""
    variants = jax.lax.map(partial(_gyro, moments), variances)
    estimators = len(moments.alphas)
    of_estimators = []
    for k in range(estimators):
        own = own_products(estimators, k)
        sums = jax.tree.map(lambda leaf: leaf[variant], _own(variants, own))
        of_estimators.append(jax.vmap(propagate_case, (0, 0, None, None))(sums, errors, r_cg, nominal))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *of_estimators)


def _gyro(moments: GramMoments, variance: Float[Array, "3"]) -> SumMoments:
    """The sums of all estimators under white noise of omega, about their mean and about the noise-free run."""
    expected = moments_of.mean(moments, variance)
    change = jax.jvp(partial(moments_of.mean, moments), (jnp.zeros(3),), (variance,))[1]
    return SumMoments(
        jnp.stack([expected, moments.sums]),
        jnp.stack([jnp.zeros_like(change), change]),
        jnp.stack([moments_of.covariance(moments, variance), moments_of.first_order_covariance(moments, variance)]),
    )


def _own(sums: SumMoments, own: np.ndarray) -> SumMoments:
    """Those of one estimator."""
    return SumMoments(sums.point[..., own], sums.change[..., own], sums.covariance[..., own[:, None], own])


def _breakdown(cases: Sequence[Case], found: Propagated) -> LawBreakdown:
    groups: dict[str, LawStatistics] = {}
    sources: dict[str, LawStatistics] = {}
    for k, case in enumerate(cases):
        kind, _, name = case.name.partition(":")
        statistics = LawStatistics(*(leaf[k] for leaf in found))
        (sources if kind == "source" else groups)[name or kind] = statistics
    return LawBreakdown(groups, sources)
