"""The consistency verdict: signals that a run's residuals follow, and the causes in the rig or its declaration.

The residual moment is regressed on the sets of signals of known causes; each set less its projection on the columns of
tensor and offsets, which the estimate has absorbed. A set is judged by a Wald test whose covariance allows
for residuals that are correlated in time (Newey and West, doi:10.2307/1913610). The best by Schwarz's criterion
(doi:10.1214/aos/1176344136) is named first; others only for what is left beside it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.diagnostics.residuals import Residuals, gyro_bias_columns, residual_moment, residuals
from identify.diagnostics.spectral_lines import SpectralLine, line
from identify.rounding import significant, with_uncertainty
from identify.signals.correlation_time import correlation_time, score_covariance
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run

SIGNIFICANCE = 1e-5
"""Chance that a clean run's residuals follow one set of signals by accident."""
LEAST = 1e-3
"""Smallest part of the residuals' variance that is reported."""
GENERAL = {"attitude": ("centre of gravity",)}
"""Sets that hold others: named only where they explain more than these by the factor ``BETTER``."""
BETTER = 1.1
ECHO = 0.1
"""Least share, of what the first cause explains, that a further cause must explain: less may be an error of
linearisation."""
MOST = 3
"""Causes that are named of one run."""
SHORTEST = 32
"""Samples below which nothing is judged."""
FEWEST = 10.0
"""Independent residuals a column that a set needs to be judged at all."""


class ResidualCause(NamedTuple):
    """A cause that a run's residuals follow."""

    cause: str
    """Likely cause: delay, rotation, tensor, centre of gravity, attitude, gyro bias, air, drift or resonance;
    repeatability where the scatter of several runs contradicts their residuals."""
    axis: str
    """Axis of the moment on which it shows most, b1, b2 or b3; of repeatability the component."""
    share: float
    """Part of the residuals' variance that it explains; of repeatability the scatter over the predicted one."""
    text: str
    """One line that says so."""
    run: str = ""
    """Name of the run."""


class CauseSignals(NamedTuple):
    """Signals that a cause makes of the residual moment."""

    name: str
    columns: Float[np.ndarray, "n 3 p"]


class CauseFit(NamedTuple):
    """Fit of a cause's signals to the residuals."""

    cause: CauseSignals
    coefficients: Float[np.ndarray, " p"]
    standard_uncertainty: Float[np.ndarray, " p"]
    explained: Float[np.ndarray, "n 3"]
    """The part of the residual moment [N·m]."""
    wald: float
    """``βᵀ V⁻¹ β``, its expectation p where there is nothing."""
    freedom: float
    """Independent residuals less the columns."""

    @property
    def power(self) -> float:
        """Sum of squares of the part that it explains [(N·m)²]."""
        return float((self.explained**2).sum())

    @property
    def chance(self) -> float:
        """Probability of as large a part without a cause."""
        count = len(self.coefficients)
        return float(scipy.special.fdtrc(count, max(self.freedom, 1.0), self.wald / count))

    @property
    def criterion(self) -> float:
        """Schwarz's criterion against no cause: above zero for it."""
        return self.wald - len(self.coefficients) * float(np.log(max(self.freedom, 2.0)))


def consistency(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    *,
    offsets: OffsetChoice = "estimate",
) -> tuple[ResidualCause, ...]:
    """Return what a run's residuals follow; nothing where they are noise.

    Args:
        run: the run.
        estimator: differentiator and filter.
        r_cg: centre of gravity from Q, in B [m].
        inertia: packed tensor about the centre of gravity that the runs gave [kg·m²].
        offsets: how constant offsets were removed.
    """
    left = residuals(run, estimator, r_cg, inertia, offsets=offsets)
    if len(left.t) < SHORTEST:
        return ()
    base = fitted_already(left)
    rest = left.moment - (base @ (base.T @ left.moment.reshape(-1))).reshape(-1, 3)
    total = float((rest**2).sum())
    fits = _followed(rest, causes(left, inertia), base) if total > 0 else []
    plain = estimator.lowpass is None
    whole = left if plain else residuals(run, estimator, r_cg, inertia, offsets=offsets, filtered=False)
    lines = _lines(run, whole.moment - _unfiltered(fits, whole, inertia), left.band)
    return (*(_verdict(fit, total, run.name) for fit in fits), *lines)


def resonances(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    *,
    offsets: OffsetChoice = "estimate",
) -> tuple[ResidualCause, ...]:
    """Return the line in a run's residual moment above the motion's band, if there is one.

    Arguments are those of :func:`consistency`, which looks for it beside what else the residuals follow.
    """
    moment = residual_moment(run, replace(estimator, lowpass=None), r_cg, inertia, offsets=offsets)
    return () if len(moment) < SHORTEST else _lines(run, moment, run.band)


def _lines(run: Run, moment: np.ndarray, band: float) -> tuple[ResidualCause, ...]:
    resonance = line(moment, run.rate, above=OVER_BAND_OF_LINES * band)
    return () if resonance is None or resonance.share < LEAST else (_line_verdict(resonance, run.name),)


def _followed(rest: np.ndarray, open_to: list[CauseSignals], base: np.ndarray) -> list[CauseFit]:
    """The causes that the residuals follow: the best one, then what is left beside it."""
    followed: list[CauseFit] = []
    total = float((rest**2).sum())
    while len(followed) < MOST:
        fits = [fit for cause in open_to if (fit := explain(rest, cause, base)) is not None]
        fits = [
            fit for fit in fits if fit.chance < SIGNIFICANCE and fit.criterion > 0 and _matters(fit, followed, total)
        ]
        if not fits:
            break
        best = max((fit for fit in fits if not _needless(fit, fits)), key=lambda fit: fit.criterion)
        followed.append(best)
        base = _basis(np.concatenate([base, best.cause.columns.reshape(len(base), -1)], axis=1))
        rest = rest - best.explained
        open_to = [cause for cause in open_to if cause.name != best.cause.name]
    return followed


OVER_BAND_OF_LINES = 1.5
"""Part of the motion's band above which a line is sought: below, a cause that follows the motion looks the same."""


def fitted_already(left: Residuals) -> Float[np.ndarray, "m q"]:
    """Return a basis of what is no cause: the tensor's rows, and constants (offsets that were left in, too)."""
    return _basis(np.concatenate([left.rows.reshape(-1, 6), np.tile(np.eye(3), (len(left.t), 1))], axis=1))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span these, by their Gram matrix: two passes, as columns may be nearly dependent."""
    for _ in range(2):
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        values, vectors = np.linalg.eigh(columns.T @ columns)
        good = values > 1e-10 * values[-1]
        columns = columns @ (vectors[:, good] / np.sqrt(values[good]))
    return columns


def _matters(fit: CauseFit, named: list[CauseFit], total: float) -> bool:
    return fit.power / total > max(LEAST, ECHO * named[0].power / total if named else 0.0)


def _needless(fit: CauseFit, others: list[CauseFit]) -> bool:
    """Whether a set that holds another one explains hardly more than it."""
    inside = [other.power for other in others if other.cause.name in GENERAL.get(fit.cause.name, ())]
    return bool(inside) and fit.power < BETTER * max(inside)


def causes(residual: Residuals, inertia: Float[np.ndarray, "6"]) -> list[CauseSignals]:
    """Return the causes that are looked for, each with the signals that it makes."""
    n, unit = len(residual.t), np.eye(3)
    on_every_axis = lambda signal: np.einsum("nk,ij->nikj", signal, unit).reshape(n, 3, 9)  # noqa: E731  every component on every axis
    on_own_axis = lambda signal: np.einsum("ni,ij->nij", signal, unit)  # noqa: E731  each component on its axis
    crossed = lambda signal: np.stack([np.cross(e, signal) for e in unit], axis=2)  # noqa: E731
    change = np.gradient(residual.spin, 1 / residual.rate, axis=0)
    time = np.broadcast_to(2 * residual.t[:, None] / max(residual.t[-1], 1e-300) - 1, (n, 3))
    candidates = [
        CauseSignals("delay", change[:, :, None]),
        CauseSignals("rotation", crossed(residual.spin)),
        CauseSignals("tensor", residual.rows * time[:, :, None]),
        CauseSignals("gyro bias", gyro_bias_columns(residual, inertia)),
        CauseSignals(
            "air",
            np.concatenate([on_own_axis(residual.omega), on_own_axis(np.abs(residual.omega) * residual.omega)], axis=2),
        ),
        CauseSignals("drift", on_own_axis(time)),
    ]
    if np.abs(residual.force).max() > 0:
        candidates += [
            CauseSignals("centre of gravity", crossed(residual.force)),
            CauseSignals("attitude", on_every_axis(residual.force)),
        ]
    return candidates


def explain(moment: np.ndarray, cause: CauseSignals, base: Float[np.ndarray, "m q"]) -> CauseFit | None:
    """Return what a cause explains of the residual moment beside what is in the base; None: too few residuals.

    Args:
        moment: residual moment [N·m].
        cause: its signals.
        base: basis of what is fitted already, samples and axes flattened.
    """
    n, _, count = cause.columns.shape
    columns = cause.columns.reshape(3 * n, count)
    scale = np.sqrt((columns**2).mean(axis=0))
    beside_base = columns - base @ (base.T @ columns)
    independent = np.sqrt((beside_base**2).mean(axis=0)) > 1e-6 * scale
    if not independent.any():
        return None
    values, vectors = np.linalg.eigh(
        beside_base[:, independent].T @ beside_base[:, independent] / np.outer(scale[independent], scale[independent])
    )
    good = values > 1e-8 * values[-1]
    back = vectors[:, good] / np.sqrt(values[good]) / scale[independent][:, None]
    basis, values = beside_base[:, independent] @ back, moment.reshape(-1)
    along = basis.T @ values
    after = (values - basis @ along).reshape(n, 3)
    time = correlation_time(after)
    freedom = 3 * n / time - good.sum()
    if freedom < FEWEST * good.sum():
        return None
    scores = (basis.reshape(n, 3, -1) * after[:, :, None]).sum(axis=1)
    covariance = score_covariance(scores, time)
    wald = float(along @ np.linalg.solve(covariance, along)) if np.linalg.cond(covariance) < 1e12 else 0.0
    coefficients, spread = np.zeros(count), np.full(count, np.inf)
    coefficients[independent] = back @ along
    spread[independent] = np.sqrt(np.einsum("ij,jk,ik->i", back, covariance, back))
    return CauseFit(
        cause=cause, coefficients=coefficients, standard_uncertainty=spread, explained=(basis @ along).reshape(n, 3),
        wald=wald, freedom=freedom,
    )  # fmt: skip


def _unfiltered(fits: list[CauseFit], whole: Residuals, inertia: np.ndarray) -> np.ndarray:
    """Return the part of the residuals that the named causes explain without the estimator's low-pass."""
    again = {cause.name: cause.columns for cause in causes(whole, inertia)} if fits else {}
    total = np.zeros_like(whole.moment)
    for fit in fits:
        total = total + again[fit.cause.name] @ fit.coefficients
    return total


TEXTS = {
    "delay": "angular acceleration: as if the angular velocity came late by {} ms (delay)",
    "rotation": "angular acceleration: as if the IMU were turned against the load cell by ({}) deg (rotation)",
    "tensor": "angular acceleration: as that of a body whose tensor changes during the run (something moves)",
    "gyro bias": "angular velocity: as if the gyro were off by ({}) mrad/s (gyro bias)",
    "air": "angular velocity: as drag of the air or of a cable would",
    "drift": "time: as a load cell would that drifts by ({}) N·m over the run (drift)",
    "centre of gravity": "attitude: as if r_CG were off by ({}) mm (centre of gravity)",
    "attitude": "attitude in a way that no error of r_CG explains (a cable, or the mass)",
}
SCALED = {"delay": 1e3, "rotation": 180 / np.pi, "gyro bias": -1e3, "drift": 2.0, "centre of gravity": 1e3}
"""Factors from a fit's coefficients in SI to the figures in the text."""


def _verdict(fit: CauseFit, total: float, name: str) -> ResidualCause:
    of_axis = (fit.explained**2).sum(axis=0)
    share, rms = float(of_axis.sum()) / total, float(np.sqrt(of_axis.sum() / len(fit.explained)))
    cause = fit.cause.name
    scale = SCALED.get(cause, 1.0)
    pairs = zip(scale * fit.coefficients, abs(scale) * fit.standard_uncertainty, strict=True)
    figures = ", ".join(with_uncertainty(value, sigma) for value, sigma in pairs)
    text = f"{name}: the residual moment follows the {TEXTS[cause].format(figures)}; {significant(rms, 2)} N·m rms"
    return ResidualCause(cause=cause, axis=f"b{int(np.argmax(of_axis)) + 1}", share=share, text=text, run=name)


def _line_verdict(resonance: SpectralLine, name: str) -> ResidualCause:
    axis = f"b{resonance.axis + 1}"
    text = f"{name}: a line at {significant(resonance.frequency)} Hz in the residual moment about {axis} (resonance); "
    return ResidualCause(
        cause="resonance", axis=axis, share=resonance.share, text=f"{text}{significant(resonance.rms, 2)} N·m rms",
        run=name,
    )  # fmt: skip
