"""Coverage in result.json: intervals, the ellipsoid of the six components, the principal axes; in g·m²."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from identify.rigid_body.inertia import GRAM_METRE
from uq.campaign.statistics import by_component
from uq.coverage.adaptive_procedure import Stability
from uq.coverage.coverage_intervals import CoverageInterval, shortest_interval, symmetric_interval
from uq.coverage.coverage_regions import EllipsoidalRegion, ellipsoidal_region
from uq.sources.quasi_random import Points

PROBABILITY = 0.95


def coverage_record(errors: np.ndarray, points: Points = "random") -> dict[str, Any]:
    """Return intervals and ellipsoid of a total's errors (trials, 6) [kg·m²]; None for what the trials do not give.

    The ellipsoid's standard errors are those of random trials; of quasi-random ones they are too large.
    """
    return {
        "probability": PROBABILITY,
        "symmetric": _interval(symmetric_interval(errors, PROBABILITY, points)),
        "shortest": _interval(shortest_interval(errors, PROBABILITY, points)),
        "ellipsoid": _ellipsoid(errors),
    }


def stability_record(stability: Mapping[str, Mapping[str, Stability]] | None) -> dict[str, Any] | None:
    """Return what an adaptive campaign was asked and what it reached; None for one that is not adaptive."""
    if stability is None:
        return None
    verdicts = [verdict for trajectory in stability.values() for verdict in trajectory.values()]
    return {
        "digits": verdicts[0].goal.digits if verdicts[0].goal.tolerance is None else None,
        "stable": all(verdict.stable for verdict in verdicts),
        "blocks": verdicts[0].blocks,
        "trajectories": {
            trajectory: {
                name: {"tolerance": by_component(verdict.tolerance), "reached": by_component(verdict.reached)}
                for name, verdict in estimators.items()
            }
            for trajectory, estimators in stability.items()
        },
    }


def _interval(interval: CoverageInterval) -> dict[str, dict[str, float | None]]:
    names = ("low", "low_standard_error", "high", "high_standard_error")
    return {name: by_component(getattr(interval, name)) for name in names}


def _ellipsoid(errors: np.ndarray) -> dict[str, Any] | None:
    try:
        region: EllipsoidalRegion = ellipsoidal_region(errors, PROBABILITY)
    except ValueError:  # too few trials, or components of which one follows from the others
        return None
    return {
        "centre": by_component(region.centre),
        "covariance": (GRAM_METRE**2 * region.covariance).tolist(),
        "factor": region.factor.value,
        "factor_standard_error": region.factor.standard_error,
        "factor_if_normal": region.normal_factor,
        "coverage": region.coverage.value,
        "coverage_standard_error": region.coverage.standard_error,
    }
