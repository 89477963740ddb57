"""A run's samples as rows of the regression behind the estimator, and the cosine transform of both its sides.

One pass over the samples leaves all that its estimates need. The transform is orthogonal
(:mod:`identify.least_squares.residual_spectrum`), so sums of products over lines are those over samples.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy
from jaxtyping import Float, Int

from identify.least_squares.residual_spectrum import BLOCK, DRAWN, Lines, blocks, thinned
from identify.rigid_body.regressor import OMEGA, OMEGA_R_OF_FEATURES, ArrayT, features
from identify.signals.differentiate import derivative, highest_band
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import apply
from identify.signals.run import Run, RunError

SPLINE_REACH = 3
"""Samples beside a gap that the interpolation across it touches."""
LONG = 2**18
"""Samples of a segment beyond which its last ones are left out where its transform would take several times as long."""
FEWEST = 24
"""Samples that a run needs: with few more rows than unknowns, the residuals would say that there is no noise."""


ACTING = np.flatnonzero(OMEGA_R_OF_FEATURES.any(axis=(1, 2)))
"""Features that ``Omega_R`` is made of: products of the angular velocity, and angular acceleration."""
ACCELERATION = slice(6, 9)
"""Slice of the angular acceleration among them."""
OMEGA_R_OF_ACTING = OMEGA_R_OF_FEATURES[ACTING]
MOTION, FORCE, MOMENT = (slice(*limits) for limits in ((0, 9), (9, 12), (12, 15)))
"""Slices of the acting features, the force and the moment among a run's signals."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Signals of the instants that count, component first."""

    signals: Float[np.ndarray, "15 n"]
    """Acting features, force on the body [N] and moment on it about Q [N·m]."""
    omega: Float[np.ndarray, "n 3"]
    """Angular velocity behind the filter [rad/s]."""
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
    lost = estimator.lost(run.rate)
    if len(run.t) < lost + 3:
        raise RunError(
            f"{run.name} has {len(run.t)} samples, fewer than the {lost + 3} that estimator '{estimator.name}' needs "
            f"at {run.rate:.6g} Hz: record for longer, or choose a higher band or low-pass"
        )
    count = len(run.t) - lost
    keep = rows_of_lines(run, count)
    if len(keep) < FEWEST:
        raise RunError(
            f"{run.name} has {len(keep)} samples that may be used, fewer than {FEWEST}: "
            f"{run.cure('record without gaps, or choose a longer part')}"
        )
    signals, omega = _in_blocks(run, estimator)
    # slices where every sample counts: nothing is copied
    part, instants = (
        (keep, lost // 2 + keep)
        if run.missing is not None
        else (slice(len(keep)), slice(lost // 2, lost // 2 + len(keep)))
    )
    return Rows(
        signals=signals[:, part], omega=run.omega[instants] if omega is None else omega[:, part].T,
        segments=unbroken(keep), instants=instants,
    )  # fmt: skip


def _in_blocks(run: Run, estimator: EstimatorSpec) -> tuple[Float[np.ndarray, "15 m"], Float[np.ndarray, "3 m"] | None]:
    """Acting features, force and moment, a block at a time to bound memory; the angular velocity, if it is filtered."""
    taps, smoothing, lost = estimator.taps(run.rate), estimator.filter_taps(run.rate), estimator.lost(run.rate)
    count, size = len(run.t) - lost, max(BLOCK, 8 * lost)
    signals, omega = np.empty((MOMENT.stop, count)), None if len(smoothing) == 1 else np.empty((3, count))
    for start in range(0, count, size):
        part, to = slice(start, start + size + lost), slice(start, start + size)
        phi, force, moment = filtered(run.omega[part].T, run.force[part].T, run.moment[part].T, taps, smoothing)
        signals[MOTION, to], signals[FORCE, to], signals[MOMENT, to] = phi[ACTING], force, moment
        if omega is not None:
            omega[:, to] = phi[OMEGA]
    return signals, omega


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


def rows_of_lines(run: Run, rows: int) -> np.ndarray:
    """Return :func:`usable_rows`, of each long segment as many as a fast transform takes: all but 0.6 % at most."""
    keep = usable_rows(run, rows)
    sizes = [(part, part.stop - part.start) for part in unbroken(keep)]
    taken = [keep[part][: scipy.fft.prev_fast_len(size) if size > LONG else size] for part, size in sizes]
    return np.concatenate(taken)


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
    wrench: Float[np.ndarray, "w 6"]
    """Force [N] and moment [N·m] at the first :data:`DRAWN` instants of the longest segment, for figures."""
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
        every = np.empty((len(self), 3))
        for part in self.parts():
            every[part] = self.about_cg(r_cg, part) - self[part] @ inertia
        return every

    def moment(self, r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "w 3"]:
        """Return ``M - r × F`` at the first instants of the longest segment [N·m]."""
        return self.wrench[:, 3:] - np.cross(r_cg, self.wrench[:, :3])

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
    signals, lines = rows.signals, Lines.of(rows.segments, run.rate)
    longest = max(rows.segments, key=lambda segment: segment.stop - segment.start)
    drawn = slice(longest.start, min(longest.stop, longest.start + DRAWN))
    in_time = {
        "means": signals.mean(axis=1), "motion": np.hstack([thinned(rows.omega), thinned(signals[ACCELERATION].T)]),
        "wrench": signals[FORCE.start :, drawn].T.copy(),
    }  # fmt: skip
    lines.transform_rows(signals)
    return RunLines(
        run=run, lines=lines, signals=signals, t=run.t[rows.instants], omega=rows.omega, **in_time,
        removed=np.zeros(len(signals)),
    )  # fmt: skip
