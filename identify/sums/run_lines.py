"""Cosine transform of both sides of a run's regression: all that its estimates need of the samples.

One pass over the samples makes it. The transform is orthogonal (:mod:`identify.sums.residual_spectrum`), so sums of
products over lines are those over samples.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import ALPHA, OMEGA, OMEGA_R_OF_FEATURES
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from identify.sums.regressor_rows import rows_of
from identify.sums.residual_spectrum import Lines, blocks
from identify.sums.residual_trace import thinned

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
