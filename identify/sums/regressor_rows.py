"""A run's samples as rows of the regression: which instants count, and both sides behind the same filter."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from identify.rigid_body.regressor import ArrayT, features
from identify.signals.differentiate import derivative, highest_band
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import apply
from identify.signals.run import Run, RunError

SPLINE_REACH = 3
"""Samples beside a gap that the interpolation across it touches."""
FEWEST = 24
"""Samples that a run needs: with few more rows than unknowns, the residuals would say that there is no noise."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Features, force and moment of the instants that count, component first."""

    phi: Float[np.ndarray, "13 n"]
    force: Float[np.ndarray, "3 n"]
    """Force on the body [N]."""
    moment: Float[np.ndarray, "3 n"]
    """Moment on the body about Q [N·m]."""
    segments: tuple[slice, ...]
    """Instants that follow one another without a gap."""
    instants: slice | Int[np.ndarray, " n"]
    """Indices of the rows' instants among those of the run."""


def rows_of(run: Run, estimator: EstimatorSpec) -> Rows:
    """Return a run's rows behind an estimator's differentiator and filter.

    Raises:
        RunError: the run is too short for the estimator, or its rate too low for the band.
    """
    check_rate(run, estimator)
    taps, smoothing, needed = estimator.taps(run.rate), estimator.filter_taps(run.rate), estimator.lost(run.rate) + 3
    if len(run.t) < needed:
        raise RunError(
            f"{run.name} has {len(run.t)} samples, fewer than the {needed} that estimator '{estimator.name}' needs at "
            f"{run.rate:.6g} Hz: record for longer, or choose a higher band or low-pass"
        )
    phi, force, moment = filtered(run.omega.T, run.force.T, run.moment.T, taps, smoothing)
    keep = usable_rows(run, phi.shape[1])
    if len(keep) < FEWEST:
        raise RunError(
            f"{run.name} has {len(keep)} samples that may be used, fewer than {FEWEST}: "
            f"{run.cure('record without gaps, or choose a longer part')}"
        )
    half = (len(run.t) - phi.shape[1]) // 2
    if run.missing is None:  # nothing is copied
        every = slice(half, half + len(keep))
        return Rows(phi=phi, force=force, moment=moment, segments=(slice(0, len(keep)),), instants=every)
    return Rows(
        phi=phi[:, keep], force=force[:, keep], moment=moment[:, keep], segments=unbroken(keep), instants=half + keep
    )  # fmt: skip


def check_rate(run: Run, estimator: EstimatorSpec) -> None:
    """Refuse a run whose rate is too low, or too high, for an estimator.

    Raises:
        RunError: so it is.
    """
    try:
        estimator.taps(run.rate), estimator.filter_taps(run.rate)
    except ValueError as error:
        highest = 0.0 if estimator.window or estimator.band is None else highest_band(run.rate)
        if estimator.band is None or not 0 < highest < estimator.band:
            raise RunError(f"{run.name} at {run.rate:.6g} Hz: {error}") from None
        raise RunError(
            f"{run.name} has {run.rate:.6g} Hz, too few to differentiate a motion of {estimator.band:g} Hz, the band "
            f"of estimator '{estimator.name}': record faster, or state the motion's band, here at most {highest:.3g} Hz"
        ) from None


def unbroken(keep: np.ndarray) -> tuple[slice, ...]:
    """Return the parts of some positions that follow one another without a gap."""
    breaks = np.concatenate([[0], np.flatnonzero(np.diff(keep) > 1) + 1, [len(keep)]])
    return tuple(slice(int(a), int(b)) for a, b in pairwise(breaks))


def usable_rows(run: Run, rows: int) -> np.ndarray:
    """Return the positions of the rows that no gap reaches, through differentiator, filter and the spline's ringing."""
    if run.missing is None:
        return np.arange(rows)
    half = (len(run.t) - rows) // 2
    reach = half + SPLINE_REACH
    touched = np.convolve(run.missing.astype(float), np.ones(2 * reach + 1), "same") > 0.5
    return np.flatnonzero(~touched[half : half + rows])


def filtered(
    omega: Float[ArrayT, "3 n"], force: Float[ArrayT, "3 n"], moment: Float[ArrayT, "3 n"],
    taps: np.ndarray, smoothing: np.ndarray,
) -> tuple[Float[ArrayT, "13 m"], Float[ArrayT, "3 m"], Float[ArrayT, "3 m"]]:  # fmt: skip
    """Return features, force and moment of the instants that have a derivative, all through the same filter.

    Of arrays of JAX or of NumPy, component first.
    """
    inner = slice(taps.shape[0], omega.shape[1] - taps.shape[0])
    phi = features(omega[:, inner], derivative(omega, taps))
    if smoothing.shape[0] == 1:
        return phi, force[:, inner], moment[:, inner]
    together = phi.__array_namespace__().concat([phi, force[:, inner], moment[:, inner]])
    behind = apply(together, smoothing)
    return behind[:13], behind[13:16], behind[16:]
