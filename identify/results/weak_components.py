"""Components that a weak run does not determine, and why, in words."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.display.rounding import fixed, significant, with_uncertainty
from identify.least_squares.admissible_tensor import (
    CONTRADICTED,
    UNUSUAL,
    Admissible,
    admissible,
    distance_from_bodies,
    margin,
)
from identify.results.identification_result import Identification
from identify.results.ledger import Ledger, Row, tensor_row
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, pack
from identify.rigid_body.pseudo_inertia import UNITS
from identify.signals.run import Run, RunError

ONE_AXIS = 1e-3
"""Part of the angular velocity's power below which an axis counts as not turned about."""
BODIES = "possible bodies"
"""Error of a component of which only the range is known that bodies have."""
NO_BODY = "no mass distribution has this tensor (triangle inequality): check signs, frames and r_CG"
UNDETERMINED = "not determined by this motion"
"""Interval of a component that is not determined, in a table; the warning has the range that bodies have."""
WIDE = 0.5
"""Half an interval over the geometric mean of its two moments from which a component counts as uncertain."""


def _rectangles(bounded: Admissible) -> list[Row]:
    """Row of what is not determined: only the interval is known (GUM 4.3.7); NaN where nothing bounds it."""
    if bounded.determined.all():
        return []
    width = np.ptp(bounded.interval95, axis=1)
    u = np.where(bounded.determined, 0.0, np.where(np.isfinite(width), width / np.sqrt(12), np.nan))
    return [tensor_row(BODIES, np.diag(u))]


def within_bodies(result: Identification, runs: Run | Sequence[Run]) -> Identification:
    """Return a result with the tensor and the intervals that bodies allow, where data are weak; else unchanged.

    Args:
        result: a plain estimate.
        runs: what it was made of.

    Raises:
        RunError: what the motion determines is no body's.
    """
    runs = [runs] if isinstance(runs, Run) else list(runs)
    sigma = np.maximum(result.standard_uncertainty, 1e-300)
    half = Ledger(result.ledger.rows).arms()[4:].mean(axis=1)  # without what is expected
    factor = np.maximum(half / sigma, 1.0)
    bounded = admissible(result.inertia, result.covariance, factor, result.seen)
    if bounded is None:
        if result.seen is not None:
            raise RunError(f"what {runs[0].name} determines is physically impossible: check signs, frames and r_CG")
        return replace(result, warnings=(*result.warnings, *_impossible(result), *_wide_intervals(result)))
    # what is not determined has no covariance with anything, nor lasting errors
    determined = np.concatenate([np.ones(4), bounded.determined])
    ledger = result.ledger.changed(determined[:, None])
    weak = replace(
        result,
        value=np.concatenate([result.value[:4], bounded.inertia]),
        ledger=Ledger((*ledger.rows, *_rectangles(bounded)), np.where(determined > 0, ledger.expected, np.nan)),
        admissible=bounded,
    )
    weakness = [] if bounded.determined.all() else [_undetermined(bounded, result.covariance, runs)]
    unusual = bounded.distance > UNUSUAL and not weakness
    changed = [f"{bounded.reason}: the estimate is the nearest possible tensor"] if unusual else []
    return replace(weak, warnings=(*result.warnings, *weakness, *changed, *_wide_intervals(weak)))


def _impossible(result: Identification) -> list[str]:
    return [] if margin(result.inertia, result.covariance) >= 0 else [NO_BODY]


def contradicts_bodies(inertia: Float[np.ndarray, "6"], covariance: Float[np.ndarray, "6 6"]) -> list[str]:
    """Return the warning of a tensor that lies clearly outside what bodies have; empty where a body may have it.

    Args:
        inertia: the estimate, not held to bodies [kg·m²].
        covariance: of it [(kg·m²)²].
    """
    if margin(inertia, covariance) >= -CONTRADICTED or distance_from_bodies(inertia, covariance) < CONTRADICTED:
        return []
    return [NO_BODY]


def _wide_intervals(result: Identification) -> list[str]:
    moments = np.abs(result.inertia[[0, 3, 5]])
    scale = np.sqrt(pack(np.outer(moments, moments)))
    wide = result.determined & (np.ptp(result.interval95, axis=1) / 2 > WIDE * scale)
    names = [name for name, is_wide in zip(COMPONENTS, wide, strict=True) if is_wide]
    advice = "half the interval exceeds half the moments of those axes; record for longer, or rotate about more axes"
    return [f"{', '.join(names)} poorly determined: {advice}"] if names else []


def _undetermined(bounded: Admissible, covariance: np.ndarray, runs: Sequence[Run]) -> str:
    open_ended = np.flatnonzero(~bounded.determined)
    names = [COMPONENTS[k] for k in open_ended]
    ranges = [_range(COMPONENTS[k], *GRAM_METRE * bounded.interval95[k]) for k in open_ended]
    return (
        f"{', '.join(names)} not determined: {_motion(bounded, covariance, runs)}; possible bodies with the "
        f"other components have {', '.join(ranges)}; rotate about more axes"
    )


def _range(name: str, low: float, high: float) -> str:
    if np.isfinite([low, high]).all():
        return f"{name} from {significant(low)} to {significant(high)} g·m²"
    if np.isfinite(low):
        return f"{name} above {significant(low)} g·m²"
    if np.isfinite(high):
        return f"{name} below {significant(high)} g·m²"
    return f"{name} anywhere"


def _motion(bounded: Admissible, covariance: np.ndarray, runs: Sequence[Run]) -> str:
    """Return a text on the rotation of the body and the moment about a single axis."""
    omega = np.concatenate([run.omega[segment] for run in runs for segment in run.used()])
    power, axes = np.linalg.eigh(omega.T @ omega)
    if power[1] < ONE_AXIS * power[2]:
        axis = axes[:, 2] * np.sign(axes[np.argmax(np.abs(axes[:, 2])), 2])
        about = np.einsum("a,iab,b->i", axis, UNITS, axis)
        value, sigma = GRAM_METRE * about @ bounded.plain, GRAM_METRE * np.sqrt(about @ covariance @ about)
        moment = f"about which its moment is {with_uncertainty(float(value), float(sigma))} g·m²"
        return f"the body turns about one axis only, {_vector(axis)}, {moment}"
    if power[0] < ONE_AXIS * power[2]:
        return f"the body turns only about axes in the plane normal to {_vector(axes[:, 0])}"
    return "the motion is too slow or too brief"


def _vector(axis: np.ndarray) -> str:
    return f"({', '.join(fixed(x, 2) for x in axis)})"
