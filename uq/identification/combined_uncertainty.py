"""Type A and the declared sources (type B) together: interval, budget, degrees of freedom."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.estimators.pooling import Pooling
from identify.results.identification_result import ESTIMATE, Identification
from uq.sources.source import Source

SEED = 0
"""Seed of all draws of the declared sources' errors."""


class Systematic(NamedTuple):
    """Errors of a pooled tensor from the systematic sources."""

    sources: tuple[Source, ...]
    common: Float[np.ndarray, "trials 6"]
    """Errors of the tensor from the sources that all runs share [kg·m²]."""
    by_mounting: Float[np.ndarray, "trials 6"]
    """Errors of the tensor from the sources that each mounting draws independently [kg·m²]."""
    alone: Mapping[str, Float[np.ndarray, "trials 6"]]
    """Errors of the tensor from each source alone, by its name [kg·m²]."""
    failed: int = 0
    """Draws with which the tensor could not be solved; they are left out."""


def widened_by_sources(result: Identification, systematic: Systematic) -> Identification:
    """Return a result without type A's pooling with its ends moved out by the sources' errors, in squares."""
    estimate = result.contributions or {ESTIMATE: np.sqrt(np.diag(result.covariance))}
    alone = {name: errors.std(axis=0) for name, errors in systematic.alone.items()}
    if not systematic.sources:
        return replace(result, budget=estimate)
    ends = np.quantile(systematic.common, [0.975, 0.025], axis=0).T
    middle, mean = result.inertia[:, None], systematic.common.mean(axis=0)
    out = np.hypot(result.interval95 - middle, ends - mean[:, None])
    covariance = result.covariance + np.cov(systematic.common.T, ddof=1)
    return replace(
        result.with_tensor_uncertainty(covariance, middle - mean[:, None] + out * [-1, 1]),
        bias=result.bias + mean,
        budget={**estimate, **alone},
    )


def combined_interval(together: Pooling, errors: Float[np.ndarray, "trials 6"]) -> tuple[np.ndarray, np.ndarray]:
    """Return the 2.5 % and 97.5 % quantiles of type A's and the sources' errors together [kg·m²].

    Type A's errors are quantiles of its t distribution at even probabilities, in random order, so that they
    add no sampling noise.
    """
    trials = len(errors)
    rng = np.random.default_rng([SEED, trials])
    even = (np.arange(trials) + 0.5) / trials
    type_a = [
        scale * scipy.special.stdtrit(freedom, rng.permutation(even))
        for scale, freedom in zip(together.scale, together.degrees_of_freedom, strict=True)
    ]
    return tuple(np.quantile(errors + np.transpose(type_a), [0.025, 0.975], axis=0))


def budget_of(together: Pooling, sources: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return contributions to the standard uncertainty [kg·m²]: type A's parts, then each source, largest first."""
    residuals = np.sqrt(np.diag(together.from_residuals))
    scatter = together.predicted_standard_uncertainty * np.sqrt(together.excess**2 - 1)  # exactly none of a single run
    between = "scatter between mountings" if together.mountings > 1 else "scatter between runs"
    parts = {"residuals": residuals} | ({between: scatter} if scatter.any() else {})
    total = {name: float((contribution**2).sum()) for name, contribution in sources.items()}
    return parts | {name: sources[name] for name in sorted(sources, key=lambda name: -total[name])}


def combined_diagnostics(
    together: Pooling,
    covariance: np.ndarray,
    source_covariance: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray],
) -> dict[str, Any]:
    """Return standard uncertainties of type A and B; degrees of freedom by Welch and Satterthwaite (GUM G.4)."""
    combined, type_a = np.diag(covariance), np.diag(together.covariance)
    freedom = combined**2 * together.degrees_of_freedom / np.maximum(type_a, 1e-300) ** 2
    return {
        "standard_uncertainty_type_a": np.sqrt(type_a).tolist(),
        "standard_uncertainty_type_b": np.sqrt(np.diag(source_covariance)).tolist(),
        "effective_degrees_of_freedom": np.minimum(freedom, 1e9).tolist(),
        "coverage_factor": ((ends[1] - ends[0]) / 2 / np.sqrt(np.maximum(combined, 1e-300))).tolist(),
        "scatter_between_runs": together.excess.tolist(),
    }
