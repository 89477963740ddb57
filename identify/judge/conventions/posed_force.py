"""Forces with attitudes, and the least-squares fits of one reading of a recording to them.

With specific force f, attitude R from B to axes at rest, a lever's part L b and the load cell's zero,

    F = m f + Rᵀ p + L b + F0(t)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.convention_fit import LEAST_MISFIT, NOT_RIGID
from identify.rigid_body.regressor import FIRST_MOMENT_OF_FEATURES, features
from identify.signals.drift_shapes import drift_shapes

YAWS = 3600
"""Turns about the vertical that are tried where the axes at rest are not those of the wrench.

Numerical: a tenth of a degree apart.
"""

RIDGE = 1e-9
"""Part of the normal matrix that keeps the mass of a single sample determined.

Numerical: rounding of doubles in the solution.
"""

STEPS = 3
"""Linear steps to the delays of a motion sensor.

Numerical: the first is good to a tenth.
"""
LONGEST_LAG = 0.05
"""Time by which a motion sensor may lag [s].

Choice: that of a filter of second order at 5 Hz.
"""
LIFT, ZERO = slice(1, 4), slice(4, 7)
"""Places of p and the zero among the columns of a fit, behind the mass's."""

Rotations = Float[np.ndarray, "n 3 3"]
Smooth = Callable[[np.ndarray], np.ndarray]
"""Filter over the samples, first, of some columns."""


def unchanged(values: np.ndarray) -> np.ndarray:
    """Return the samples as they are: of static poses."""
    return values


@dataclass(frozen=True, eq=False)
class GravityFit:
    """The unknowns of one reading, and what it leaves."""

    values: Float[np.ndarray, " p"]
    """Mass m [kg], p [N], then zero and lever; m is zero where no specific force is given."""
    covariance: Float[np.ndarray, "p p"]
    misfit: float
    """Mean square of what is left of the force, per component [N²]."""

    @property
    def mass(self) -> float:
        """Mass by the specific force [kg]."""
        return float(self.values[0])

    @property
    def sigma_mass(self) -> float:
        """Standard uncertainty of the mass [kg]; infinite where no specific force tells it."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def lift(self) -> Float[np.ndarray, "3"]:
        """The vector p [N]."""
        return self.values[1:4]


class MassStep(NamedTuple):
    """A mass that is another from some sample on."""

    sample: int
    """Index of the first smoothed sample with the other mass."""
    before: float
    """Mass before it [kg]."""
    after: float
    """Mass from it on [kg]."""
    misfit: float
    """Mean square of what is left of the force, per component [N²]."""


@dataclass(frozen=True, eq=False)
class PosedMotion:
    """Attitudes with the specific force, n samples, all in B and SI: columns that the fits of several forces share."""

    to_rest: Rotations
    """Rotations R from B to axes at rest."""
    specific: Float[np.ndarray, "n 3"] | None = None
    """Specific force [m/s²]; None: not known, or of poses at rest, where R tells it."""
    levers: Float[np.ndarray, "n 3 k"] | None = None
    """Specific force of a lever's unit vectors [1/s²]; None: at rest."""
    time: Float[np.ndarray, " n"] | None = None
    """Instants of a run, over which the zero may drift [s]; None: of poses, with a constant zero."""
    smooth: Smooth = unchanged
    independent: float = 1.0
    """Part of the smoothed samples that are independent."""

    @cached_property
    def columns(self) -> np.ndarray:
        """Smoothed columns of m, p, zero and lever, (k, 3, columns)."""
        n = len(self.to_rest)
        specific = np.zeros((n, 3)) if self.specific is None else self.specific
        levers = np.zeros((n, 3, 0)) if self.levers is None else self.levers
        zero = np.broadcast_to(np.eye(3), (n, 3, 3))
        return self.smoothed(np.concatenate([specific[:, :, None], self.to_rest.swapaxes(1, 2), zero, levers], axis=2))

    @cached_property
    def drift(self) -> np.ndarray:
        """Smoothed columns of each zero's drift, (k, 3, columns)."""
        shapes = np.zeros((len(self.to_rest), 0)) if self.time is None else drift_shapes(self.time)
        return np.kron(self.smooth(shapes)[:, None], np.eye(3))

    def smoothed(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (n, 3, p) through the filter."""
        return self.smooth(columns.reshape(len(columns), -1)).reshape(-1, 3, columns.shape[2])


@dataclass(frozen=True, eq=False)
class PosedForce:
    """Forces with attitudes, n samples, all in B and SI."""

    force: Float[np.ndarray, "n 3"]
    motion: PosedMotion

    def turned_back(self, yaw: float) -> "PosedForce":
        """The force as it would be in B, had it been recorded along axes at rest, turned by a yaw from R's."""
        return self._turned_back(np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]))

    def _turned_back(self, turn: np.ndarray) -> "PosedForce":
        return replace(self, force=np.einsum("nji,nj->ni", self.motion.to_rest, self.force @ turn.T))

    def turned_to_rest(self) -> "PosedForce":
        """The force along axes at rest, as it was recorded where it was turned back by mistake."""
        return replace(self, force=np.einsum("nij,nj->ni", self.motion.to_rest, self.force))

    @cached_property
    def _answer(self) -> np.ndarray:
        return self.motion.smooth(self.force)

    @property
    def changes(self) -> float:
        """Variance of the smoothed force, per component [N²]."""
        return float(self._answer.var(axis=0).mean())

    @property
    def independent_values(self) -> float:
        """Number of independent components of force."""
        return self.motion.independent * self._answer.size

    def explained(self, fit: "GravityFit | MassStep") -> bool:
        """Whether a rigid body explains the force, so that something may be named."""
        return fit.misfit < NOT_RIGID**2 * self.changes

    def excess(self, fit: GravityFit, best: GravityFit, *, least: float = LEAST_MISFIT) -> float:
        """Chi-square of a fit over that of the best one, which leaves at least some part of the force's changes."""
        variance = max(best.misfit, least**2 * self.changes)
        return (fit.misfit - best.misfit) * self.independent_values / variance

    def fit(
        self, *, lift: bool = True, zero: bool = True, turned: bool = False, slopes: Sequence[np.ndarray] = ()
    ) -> GravityFit:
        """Fit the force.

        Args:
            lift: whether p is free, otherwise zero.
            zero: whether the load cell's zero F0 is free, beside its drift.
            turned: whether the specific force may also be turned and stretched, by a free matrix instead of m.
            slopes: further columns (n, 3), in the places :attr:`slopes_at` and behind.
        """
        rows, answer = self._rows(lift, zero, turned, slopes), self._answer.reshape(-1)
        values, _, rank, _ = np.linalg.lstsq(rows, answer, rcond=1e-9)
        misfit = float(np.mean((answer - rows @ values) ** 2))
        free = max(1 - rank / self.independent_values, 0.1)
        variance = max(misfit / free, LEAST_MISFIT**2 * self.changes)
        covariance = variance / self.motion.independent * np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
        if self.motion.specific is None:
            covariance[0, 0] = np.inf
        return GravityFit(values, covariance, misfit)

    @property
    def slopes_at(self) -> int:
        """Place of the first slope among the values of a fit."""
        return ZERO.stop + (0 if self.motion.levers is None else self.motion.levers.shape[2])

    def _rows(self, lift: bool, zero: bool, turned: bool, slopes: Sequence[np.ndarray] = ()) -> np.ndarray:
        """Rows of a fit, what is not free as zeros; ``turned``: with nine columns of a matrix on the specific force."""
        columns = self.motion.columns.copy()
        columns[:, :, LIFT] *= lift
        columns[:, :, ZERO] *= zero
        parts = [columns, *(self.motion.smooth(slope)[:, :, None] for slope in slopes), self.motion.drift]
        if turned and self.motion.specific is not None:
            matrix = np.einsum("ij,nk->nijk", np.eye(3), self.motion.specific).reshape(-1, 3, 9)
            parts.append(self.motion.smoothed(matrix))
        rows = np.concatenate(parts, axis=2)
        return rows.reshape(-1, rows.shape[2])

    def mass_step(self) -> MassStep:
        """Fit the force by the load cell's zero and a mass with its lever, both of which change once."""
        rows, unit = np.delete(self.motion.columns, np.r_[LIFT, ZERO], axis=2), np.eye(3)
        count = rows.shape[2]
        answer, n = self._answer, len(rows)
        grams = np.einsum("nij,nik->njk", rows, rows)
        loose = RIDGE * grams.sum(axis=0) * np.eye(count)
        normal, right = np.zeros((n - 1, 2 * count + 3, 2 * count + 3)), np.zeros((n - 1, 2 * count + 3))
        normal[:, -3:, -3:], right[:, -3:] = n * unit, answer.sum(axis=0)
        products = np.einsum("nij,ni->nj", rows, answer)
        totals = [np.cumsum(values, axis=0) for values in (grams, rows, products)]
        parts = [x[:-1] for x in totals], [x[-1] - x[:-1] for x in totals]
        for place, (gram, total, product) in zip((0, count), parts, strict=True):
            here = slice(place, place + count)
            normal[:, here, here], right[:, here] = gram + loose, product
            normal[:, -3:, here], normal[:, here, -3:] = total, total.swapaxes(1, 2)
        values = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
        misfit = ((answer**2).sum() - (right * values).sum(axis=1)) / answer.size
        at = int(np.argmin(misfit))
        return MassStep(at + 1, float(values[at, 0]), float(values[at, count]), float(misfit[at]))

    def in_time(self, *, apart: bool) -> tuple["PosedForce", float]:
        """Return the force beside a motion sensor that lags, set right, and by how long its accelerometer lags alone.

        Args:
            apart: whether the accelerometer may lag behind the gyro.
        """
        posed, motion, delays, at = self, self.motion, np.zeros(2), self.slopes_at
        time, read = motion.time, motion.specific
        assert time is not None and read is not None  # noqa: S101, PT018 - of a run they are known
        specific = read
        for _ in range(STEPS):
            signals = [posed.force, specific][: 1 + apart]
            fit = posed.fit(lift=False, slopes=[np.gradient(values, time, axis=0) for values in signals])
            by_both, by_accelerometer = fit.values[at], fit.values[at + 1] / fit.mass if apart else 0.0
            delays = np.clip(delays + [by_both, by_accelerometer], -LONGEST_LAG, LONGEST_LAG)
            if apart:  # else the motion stays as it is, with its columns
                specific = at_instants(time + delays[1], time, read)
                motion = replace(motion, specific=specific)
            posed = PosedForce(at_instants(time - delays[0], time, self.force), motion)
        return posed, float(delays[1])

    def best_yaw(self) -> float:
        """The yaw from R's axes at rest to those of the wrench under which the force, turned back, fits best [rad]."""
        # the force turned back is linear in (cos, sin, 1) of the yaw, and so is what the rows leave of it
        turns = np.diag([1.0, 1, 0]), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]), np.diag([0.0, 0, 1])
        answers = np.stack([self._turned_back(turn)._answer.reshape(-1) for turn in turns], axis=1)
        rows = self._rows(lift=True, zero=True, turned=False)
        values, *_ = np.linalg.lstsq(rows, answers, rcond=1e-9)
        residuals = answers - rows @ values
        yaws = np.linspace(-np.pi, np.pi, YAWS, endpoint=False)
        directions = np.stack([np.cos(yaws), np.sin(yaws), np.ones(YAWS)])
        misfits = np.einsum("ik,ij,jk->k", directions, residuals.T @ residuals, directions)
        return float(yaws[int(np.argmin(misfits))])


def at_instants(instants: np.ndarray, time: np.ndarray, values: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """Samples of a vector at other instants."""
    return np.stack([np.interp(instants, time, column) for column in values.T], axis=1)


def lever_columns(time: Float[np.ndarray, " n"], omega: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the acceleration by a lever's unit vectors, ``alpha × + omega × (omega ×``, from a rate [rad/s] [1/s²]."""
    motion = features(omega.T, np.gradient(omega, time, axis=0).T)
    return np.einsum("kn,kij->nij", motion, FIRST_MOMENT_OF_FEATURES)
