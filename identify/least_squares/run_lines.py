"""A run's samples as rows of the regression behind the estimator, and the cosine transform of both its sides.

One pass over the samples leaves all that its estimates need. The transform is orthogonal
(:mod:`identify.least_squares.residual_spectrum`), so sums of products over lines are those over samples.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from identify.least_squares.residual_spectrum import Lines, blocks, thinned
from identify.rigid_body.regressor import ALPHA, OMEGA, OMEGA_R_OF_FEATURES, ArrayT, features
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
    # slices where every sample counts: nothing is copied
    part, instants = (keep, half + keep) if run.missing is not None else (slice(None), slice(half, half + len(keep)))
    return Rows(
        phi=phi[:, part], force=force[:, part], moment=moment[:, part], segments=unbroken(keep), instants=instants
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
            f"{run.name} has {run.rate:.6g} Hz, too few to differentiate a motion of {estimator.band:.3g} Hz "
            f"(estimator '{estimator.name}'): record faster, or state a band, here at most {highest:.3g} Hz"
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


ACTING = np.flatnonzero(OMEGA_R_OF_FEATURES.any(axis=(1, 2)))
"""Features that ``Omega_R`` is made of: products of the angular velocity, and angular acceleration."""
OMEGA_R_OF_ACTING = OMEGA_R_OF_FEATURES[ACTING]
MOTION, FORCE, MOMENT = slice(0, len(ACTING)), slice(len(ACTING), len(ACTING) + 3), slice(len(ACTING) + 3, None)
"""Slices of the acting features, the force and the moment among a run's signals."""


@dataclass(frozen=True, eq=False)
class RunLines:
    """Lines of a run's acting features, force and moment; slices of it are lines of ``Omega_R``, (k, 3, 6)."""

    run: Run
    lines: Lines
    signals: Float[np.ndarray, "15 m"]
    """Cosine transform of acting features, force [N] and moment [N·m]."""
    means: Float[np.ndarray, "15"]
    """Means of the signals over the instants."""
    t: Float[np.ndarray, " m"]
    """Instants of the samples that count [s]."""
    omega: Float[np.ndarray, "m 3"]
    """Angular velocity behind the filter [rad/s]."""
    motion: Float[np.ndarray, "p 6"]
    """Angular velocity [rad/s] and acceleration [rad/s²], thinned for figures."""
    removed: Float[np.ndarray, "15"]
    """Constants that are taken off the signals."""

    def __len__(self) -> int:
        return self.signals.shape[1]

    def __getitem__(self, part: slice) -> Float[np.ndarray, "k 3 6"]:
        return np.tensordot(self.signals_at(part)[MOTION], OMEGA_R_OF_ACTING, axes=(0, 0))

    def parts(self) -> Iterator[slice]:
        """Yield slices of a bounded size that cover all lines."""
        return blocks(len(self))

    def signals_at(self, part: slice) -> Float[np.ndarray, "15 k"]:
        """Return some lines of the signals, less the constants that are taken off."""
        return self.signals[:, part] - np.multiply.outer(self.removed, self.lines.constant[part])

    def less(self, removed: Float[np.ndarray, "15"]) -> "RunLines":
        """Return the lines of the signals less further constants."""
        return replace(self, removed=self.removed + removed)

    def less_wrench(self, force: Float[np.ndarray, "3"], moment: Float[np.ndarray, "3"]) -> "RunLines":
        """Return the lines of the signals less a constant force [N] and moment about Q [N·m]."""
        return self.less(np.concatenate([np.zeros(len(ACTING)), force, moment]))

    def products(self) -> Float[np.ndarray, "15 15"]:
        """Return the sums over all samples of the signals' products."""
        return sum((part @ part.T for part in map(self.signals_at, self.parts())), np.zeros((15, 15)))

    def about_cg(self, r_cg: Float[np.ndarray, "3"], part: slice) -> Float[np.ndarray, "k 3"]:
        """Return some lines of ``M - r × F`` [N·m]."""
        signals = self.signals_at(part)
        return signals[MOMENT].T - np.cross(r_cg, signals[FORCE].T)

    def residuals(self, inertia: Float[np.ndarray, "6"], r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "m 3"]:
        """Return all lines of ``M - r × F - Omega_R i`` of a packed tensor [N·m]."""
        return np.concatenate([self.about_cg(r_cg, part) - self[part] @ inertia for part in self.parts()])

    def moment_in_time(self, r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "m 3"]:
        """Return ``M - r × F`` at each instant [N·m]."""
        return self.lines.samples(np.concatenate([self.about_cg(r_cg, part) for part in self.parts()]))

    @property
    def mean_regressor(self) -> Float[np.ndarray, "3 6"]:
        """Mean of ``Omega_R`` over the instants."""
        return np.tensordot(self.means[MOTION], OMEGA_R_OF_ACTING, axes=1)


def run_lines(run: Run, estimator: EstimatorSpec) -> RunLines:
    """Return the lines of a run behind an estimator's differentiator and filter.

    Raises:
        RunError: the run is too short for the estimator, or its rate too low for the band.
    """
    rows = rows_of(run, estimator)
    signals = [*rows.phi[ACTING], *rows.force, *rows.moment]
    lines = Lines.of(rows.segments, run.rate)
    transformed = np.empty((len(signals), rows.phi.shape[1]))
    for line, signal in zip(transformed, signals, strict=True):
        line[:] = lines.transform(signal)
    omega = run.omega[rows.instants] if estimator.lowpass is None else rows.phi[OMEGA].T.copy()
    return RunLines(
        run=run, lines=lines, signals=transformed, means=np.array([signal.mean() for signal in signals]),
        t=run.t[rows.instants], omega=omega,
        motion=np.hstack([thinned(rows.phi[part].T) for part in (OMEGA, ALPHA)]), removed=np.zeros(len(signals)),
    )  # fmt: skip
