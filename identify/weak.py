"""What a weak run leaves open, in words: which components, and why."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.admissible import Admissible
from identify.inertia import COMPONENTS
from identify.reach import PAIRS, UNITS
from identify.run import Run

ONE_AXIS = 1e-3
"""Part of the angular velocity's power below which an axis counts as not turned about."""
WIDE = 0.5
"""Half an interval over the geometric mean of its two moments from which a component counts as hardly known."""


def covariance_of(bounded: Admissible, covariance: Float[np.ndarray, "6 6"]) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of a result: of what is not determined, that of a rectangle; NaN where nothing bounds it.

    A quantity of which nothing is known but that it lies in an interval (GUM 4.3.7).
    """
    open_ended = ~bounded.determined
    found = covariance.copy()
    found[open_ended] = found[:, open_ended] = 0.0
    width = np.ptp(bounded.interval95, axis=1)
    found[open_ended, open_ended] = np.where(np.isfinite(width), width**2 / 12, np.nan)[open_ended]
    return found


def shortcomings(
    bounded: Admissible | None,
    inertia: Float[np.ndarray, "6"],
    covariance: Float[np.ndarray, "6 6"],
    interval95: Float[np.ndarray, "6 2"],
    runs: Sequence[Run],
) -> list[str]:
    """Return a line on each thing that a result's reader must not overlook."""
    found = []
    if bounded is not None and not bounded.determined.all():
        found.append(_undetermined(bounded, covariance, runs))
    elif bounded is not None:
        what = (
            "the estimate is that of the nearest body" if (bounded.inertia != bounded.plain).any() else "kept as it is"
        )
        found.append(f"{bounded.reason}: {what}, its intervals are over bodies only (plain ones: key admissible)")
    names = _hardly_known(bounded, inertia, interval95)
    if names:
        found.append(
            f"{', '.join(names)} hardly known: the interval reaches half of the moments themselves; record for longer, "
            "or rotate more about the other axes"
        )
    return found


def _hardly_known(bounded: Admissible | None, inertia: np.ndarray, interval95: np.ndarray) -> list[str]:
    determined = np.ones(6, bool) if bounded is None else bounded.determined
    moments = np.abs(inertia[[0, 3, 5]])
    scale = np.array([np.sqrt(moments[i] * moments[j]) for i, j in PAIRS])
    wide = np.ptp(interval95, axis=1) / 2 > WIDE * scale
    return [name for name, one in zip(COMPONENTS, wide & determined, strict=True) if one]


def _undetermined(bounded: Admissible, covariance: np.ndarray, runs: Sequence[Run]) -> str:
    names = [name for name, known in zip(COMPONENTS, bounded.determined, strict=True) if not known]
    ranges = [
        _range(name, *ends)
        for name, ends, known in zip(COMPONENTS, 1e3 * bounded.interval95, bounded.determined, strict=True)
        if not known
    ]
    return (
        f"{', '.join(names)} not determined: {_motion(bounded, covariance, runs)}; bodies with the rest have "
        f"{', '.join(ranges)}; rotate about more axes"
    )


def _range(name: str, low: float, high: float) -> str:
    if np.isfinite([low, high]).all():
        return f"{name} from {low:.3g} to {high:.3g} g·m²"
    if np.isfinite(low) or np.isfinite(high):
        return f"{name} {'above' if np.isfinite(low) else 'below'} {low if np.isfinite(low) else high:.3g} g·m²"
    return f"{name} anywhere"


def _motion(bounded: Admissible, covariance: np.ndarray, runs: Sequence[Run]) -> str:
    """How the body turns, and what is known about the one axis."""
    omega = np.concatenate([run.omega[part] for run in runs for part in run.used()])
    power, axes = np.linalg.eigh(omega.T @ omega)
    if power[1] < ONE_AXIS * power[2]:
        axis = axes[:, 2] * np.sign(axes[np.argmax(np.abs(axes[:, 2])), 2])
        about = np.einsum("a,iab,b->i", axis, UNITS, axis)
        value, sigma = 1e3 * about @ bounded.plain, 1e3 * np.sqrt(about @ covariance @ about)
        known = f"about which its moment is {value:.4g} ± {sigma:.2g} g·m²"
        return f"the body turns about one axis only, {_vector(axis)}, {known}"
    if power[0] < ONE_AXIS * power[2]:
        return f"the body turns about axes of one plane only, across {_vector(axes[:, 0])}"
    return "the motion is too slow or too brief"


def _vector(axis: np.ndarray) -> str:
    return f"({', '.join(f'{x + 0.0:.2f}' for x in np.round(axis, 2))})"
