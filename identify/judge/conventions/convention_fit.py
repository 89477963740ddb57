"""The mechanics of a run in a few sums, and Newton's and Euler's equations as least squares on them.

One smoothing filter over force, moment, specific force and the thirteen features of the motion
(:mod:`identify.rigid_body.regressor`), products taken before, keeps the equations exact and takes the noise off; every
hypothesis about signs, axes, units and zeros is then a small least-squares problem on the same sums. NumPy only:
``inertia inspect`` starts without JAX. With the wrench (F, M) on the body at Q, specific force f and angular velocity ω
at the IMU, all in one frame,

    F = m f + α × b + ω × (ω × b) + F0                b = m (r_CG − r_IMU)
    M = r × F + q × f + I α + ω × I ω + M0            q: only where weight is missing in F but not in M

whose columns are those of the regressor. Each is linear in its unknowns; a fit has them with covariance and misfit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from identify.judge.conventions.carried_attitude import carried_gravity
from identify.rigid_body import regressor
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import (
    FEATURES,
    FIRST_MOMENT_OF_FEATURES,
    OMEGA_R_OF_FEATURES,
    PAIRS,
    PI_OF_FORCE,
    cross_matrix,
)
from identify.signals.filters import means

SMOOTHING = 0.05
"""Standard deviation of the Gaussian filter [s].

Choice: half the power at 2.6 Hz, where most motions have theirs.
"""
STEP = 0.05
"""Time between the instants of the sums [s].

Numerical: one standard deviation of the filter, which nothing passes that varies faster.
"""
WINDOW = 2 * np.sqrt(np.pi) * SMOOTHING
"""Time between instants that are independent behind the filter [s].

Definition: of a Gaussian filter, its equivalent width for the variance.
"""
LEAST_SECONDS = 3.0
"""Seconds below which there is too little to judge.

Choice: 17 independent instants behind the filter.
"""
MOST_SAMPLES = 1_000_000
"""Samples of a sensor behind which its conventions, which do not change, are no longer judged.

Choice: a quarter of an hour at 1 kHz; seconds of computing and 0.5 GB of memory.
"""
LEAST_RATE = 100.0
"""Rate that is left of a run whose conventions are judged [Hz].

Choice: forty times the frequency of half the power. Means over the samples between two instants have their zeros where
the filter's band would be folded from.
"""
FORCE, MOMENT, SPECIFIC, GRAVITY = (slice(3 * i, 3 * i + 3) for i in range(4))
MOTION = slice(12, 12 + len(FEATURES))
WIDTH = MOTION.stop
CONSTANT = MOTION.start + FEATURES.index("1")
ALPHA = slice(MOTION.start + regressor.ALPHA.start, MOTION.start + regressor.ALPHA.stop)


class WrenchSignal(NamedTuple):
    """The load cell's signals, n samples."""

    time: Float[np.ndarray, " n"]
    """Instants of the samples [s], on the same clock as the IMU's."""
    force: Float[np.ndarray, "n 3"]
    """Force on the body [N]."""
    moment: Float[np.ndarray, "n 3"]
    """Moment on the body [N·m]."""


class ImuSignal(NamedTuple):
    """The IMU's signals, n samples."""

    time: Float[np.ndarray, " n"]
    """Instants of the samples [s], on the same clock as the load cell's."""
    angular_velocity: Float[np.ndarray, "n 3"]
    """Angular velocity of the body [rad/s]."""
    specific_force: Float[np.ndarray, "n 3"]
    """Specific force at the IMU [m/s²]."""


SignalsT = TypeVar("SignalsT", WrenchSignal, ImuSignal)


@dataclass(frozen=True, eq=False)
class ConventionSums:
    """Means of the products of all columns, (25, 25), and how many independent instants they stand for.

    The columns: force [N], moment [N·m], specific force [m/s²], gravity as the gyro carries it along [m/s²], the
    thirteen features of the motion. Several hypotheses of the same instants stand side by side, leading.
    """

    gram: Float[np.ndarray, "*m 25 25"]
    instants: float
    noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of the noise that the filter removed from force [N] and moment [N·m]."""
    white: float = 0.0
    """Part of white noise's variance that passes the filter."""

    @classmethod
    def stacked(cls, several: Sequence["ConventionSums"]) -> "ConventionSums":
        """Hypotheses of the same instants, side by side."""
        return replace(several[0], gram=np.stack([sums.gram for sums in several]))

    def mean(self, columns: slice) -> Float[np.ndarray, "*m k"]:
        """The mean of some columns."""
        return self.gram[..., columns, CONSTANT]

    def covariance(self, columns: slice) -> Float[np.ndarray, "*m k k"]:
        """The covariance of some columns over the run."""
        mean = self.mean(columns)
        return self.gram[..., columns, columns] - mean[..., :, None] * mean[..., None, :]

    def changes(self, columns: slice) -> Float[np.ndarray, "*m"]:
        """The variance of a vector over the run, per component."""
        return np.asarray(np.trace(self.covariance(columns), axis1=-2, axis2=-1) / 3)

    def size(self, columns: slice) -> float:
        """The root mean square of a vector's size, of sums without leading axes."""
        return float(np.sqrt(max(np.trace(self.gram[columns, columns]), 0.0)))

    @cached_property
    def centre(self) -> "CentreFit":
        """The centre of gravity that force and moment show, of sums without leading axes."""
        return fit_centre(self)

    @property
    def tilts(self) -> bool:
        """Whether gravity turns so far in the body, as on a robot arm, that its mean is the smaller part."""
        return 2 * float(np.linalg.norm(self.mean(SPECIFIC))) ** 2 < self.size(SPECIFIC) ** 2

    def turned(
        self, *, wrench: Float[np.ndarray, "3 3"] | None = None, imu: Float[np.ndarray, "*m 3 3"] | None = None
    ) -> "ConventionSums":
        """The sums with the axes of the wrench or of the IMU turned (or mirrored) by a matrix, or by each of some."""
        change = np.broadcast_to(np.eye(WIDTH), (*(() if imu is None else imu.shape[:-2]), WIDTH, WIDTH)).copy()
        if wrench is not None:
            change[..., FORCE, FORCE] = change[..., MOMENT, MOMENT] = wrench
        if imu is not None:
            change[..., SPECIFIC, SPECIFIC] = change[..., GRAVITY, GRAVITY] = imu
            change[..., MOTION, MOTION] = _turned_features(imu)
        return replace(self, gram=change @ self.gram @ np.swapaxes(change, -1, -2))

    def mirrored(self, point: Float[np.ndarray, "3"]) -> "ConventionSums":
        """The sums with the other sign of force and specific force, the moment taken at this point [m]."""
        change = np.eye(WIDTH)
        change[MOMENT, FORCE] = -2 * cross_matrix(point)
        for columns in (FORCE, SPECIFIC, GRAVITY):
            change[columns, columns] *= -1
        return replace(self, gram=change @ self.gram @ change.T)

    def scaled(self, columns: slice, factor: float) -> "ConventionSums":
        """The sums with some of the columns multiplied."""
        change = np.ones(WIDTH)
        change[columns] = factor
        noise = self.noise[0] * change[FORCE.start], self.noise[1] * change[MOMENT.start]
        return replace(self, gram=self.gram * np.outer(change, change), noise=noise)


def _turned_features(matrix: np.ndarray) -> Float[np.ndarray, "*m 13 13"]:
    """``T`` with ``features(matrix @ omega, matrix @ alpha) == T @ features(omega, alpha)``."""
    count = len(FEATURES)
    change = np.broadcast_to(np.eye(count), (*matrix.shape[:-2], count, count)).copy()
    change[..., regressor.OMEGA, regressor.OMEGA] = change[..., regressor.ALPHA, regressor.ALPHA] = matrix
    i, j = np.array(PAIRS).T
    entries = lambda rows, columns: matrix[..., rows[:, None], columns]  # noqa: E731
    products = entries(i, i) * entries(j, j) + entries(i, j) * entries(j, i)
    change[..., regressor.PRODUCTS, regressor.PRODUCTS] = products / np.where(i == j, 2.0, 1.0)
    return change


def samples_per_mean(time: Float[np.ndarray, " n"]) -> int:
    """Return the odd number of samples whose means are judged: odd, so that a sample stands in the middle of them."""
    period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return max(1, 2 * int((1 / (LEAST_RATE * period) - 1) / 2) + 1) if period > 0 else 1


def reduced(signals: SignalsT) -> SignalsT:
    """Return a sensor's signals by means: enough for what looks at them a dozen times."""
    count = samples_per_mean(signals.time)
    return type(signals)(*(means(values, count) for values in signals))


def convention_sums(wrench: WrenchSignal, imu: ImuSignal) -> ConventionSums | None:
    """The sums of a run in SI; None where the sensors have too little time in common, or a sample is not finite."""
    period = max(float(np.median(np.diff(signal.time))) for signal in (wrench, imu))
    start, stop = max(wrench.time[0], imu.time[0]), min(wrench.time[-1], imu.time[-1])
    step = max(period, 0.002)
    if not 0 < step <= SMOOTHING or stop - start < LEAST_SECONDS:
        return None
    grid = np.arange(0.0, stop - start, step)
    wrenches = _on_grid(wrench.time - start, np.concatenate([wrench.force, wrench.moment], axis=1), grid)
    motion = _on_grid(imu.time - start, np.concatenate([imu.specific_force, imu.angular_velocity], axis=1), grid)
    if not (np.isfinite(wrenches).all() and np.isfinite(motion).all()):
        return None
    return _smoothed_sums(step, wrenches, motion[:, :3], motion[:, 3:])


def _smoothed_sums(step: float, wrenches: np.ndarray, specific: np.ndarray, omega: np.ndarray) -> ConventionSums:
    """The sums of signals on one grid; where the features have alpha stands omega, filtered by the filter's slope."""
    bell, slope, every = _filter(step)
    half = len(bell) // 2
    gravity, motion = carried_gravity(step, omega, specific), regressor.features(omega.T, omega.T)
    smooth = _filtered(np.vstack([wrenches.T, specific.T, gravity.T, motion]), bell, every)
    smooth[ALPHA] = _filtered(omega.T, slope, every)
    rough = wrenches[half : len(wrenches) - half] - _filtered(wrenches.T, bell, 1).T
    noise = float(np.sqrt((rough[:, FORCE] ** 2).mean())), float(np.sqrt((rough[:, MOMENT] ** 2).mean()))
    count = smooth.shape[1]
    return ConventionSums(smooth @ smooth.T / count, count * STEP / WINDOW, noise, step / WINDOW)


def smoothed(step: float, values: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "m k"]:
    """Return uniform samples through the filter of the sums, at instants ``STEP`` apart."""
    bell, _, every = _filter(step)
    return _filtered(values.T, bell, every).T


def _filtered(signals: Float[np.ndarray, "k n"], taps: np.ndarray, every: int) -> Float[np.ndarray, "k m"]:
    """Signals through a filter, at every so many-th instant that has all its neighbours."""
    return np.asarray(sliding_window_view(signals, len(taps), axis=1)[:, ::every] @ taps[::-1])


def _filter(step: float) -> tuple[np.ndarray, np.ndarray, int]:
    """The filter, its derivative, and the samples between the instants that are kept."""
    half = round(4 * SMOOTHING / step)
    time = np.arange(-half, half + 1) * step
    bell = np.exp(-0.5 * (time / SMOOTHING) ** 2)
    bell /= bell.sum()
    return bell, -time * bell / (bell @ time**2), max(1, round(STEP / step))


def _on_grid(time: np.ndarray, values: np.ndarray, grid: np.ndarray) -> Float[np.ndarray, "m k"]:
    """Values at the instants of the grid [s]; a faster sensor's are averaged over its step first."""
    width = max(1, round(float(grid[1] - grid[0]) / max(float(np.median(np.diff(time))), 1e-9)) | 1)
    box = np.ones(width) / width
    smooth = [np.convolve(column, box, mode="same") if width > 1 else column for column in values.T]
    return np.stack([np.interp(grid, time, column) for column in smooth], axis=1)


Vector = Float[np.ndarray, "3"]
Matrix = Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class DeclaredRig:
    """The experiment's statements of body and rig; None: not stated. SI units, body frame, from Q.

    Of body and sensors: ``wrench_point``, where the moment was taken, rotations from each sensor's axes to the body's.
    ``removed``: mass whose weight the driver removed. ``weighed``: whether the body's weight should be in the force,
    which it is not where the zero was taken with it. ``measured``: whether the specific force is an accelerometer's.
    ``units``: newtons and newton metres in the declared units of force and moment. ``rate_unit``: rad/s in that of the
    angular velocity. ``quaternion``: matrix from a quaternion to its recorded fields. ``calibration``: matrix from the
    load cell's raw channels to force and moment.
    ``turn``: standard uncertainty of a small turn between IMU and load cell [rad].
    """

    mass: float | None = None
    removed: float = 0.0
    r_cg: Vector | None = None
    sigma_r_cg: Vector = field(default_factory=lambda: np.zeros(3))
    imu_position: Vector | None = None
    wrench_point: Vector = field(default_factory=lambda: np.zeros(3))
    wrench_rotation: Matrix = field(default_factory=lambda: np.eye(3))
    imu_rotation: Matrix = field(default_factory=lambda: np.eye(3))
    weighed: bool = True
    turn: Vector = field(default_factory=lambda: np.zeros(3))
    measured: bool = True
    units: tuple[float, float] = (1.0, 1.0)
    rate_unit: float = 1.0
    quaternion: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))
    calibration: Float[np.ndarray, "6 6"] = field(default_factory=lambda: np.eye(6))

    @property
    def lever(self) -> Vector:
        """Centre of gravity from the IMU [m]; either is taken to be at Q where it is not stated."""
        r_cg, imu = (np.zeros(3) if r is None else r for r in (self.r_cg, self.imu_position))
        return r_cg - imu


LEAST_MISFIT = 0.01
"""Part of a signal's changes that a fit leaves at least.

Choice: no sensor is believed to be better than 1 %.
"""
NOT_RIGID = 0.15
"""Part of force's or moment's changes above which what is left over is due to no rigid body.

Choice: hands on the body are not judged. In 40 clean runs 0.01, the least that a fit may leave
(``tests.helpers.judge_margins``).
"""
ROWS, COLUMNS = np.triu_indices(3)
UNPACKED = unpack(np.arange(6.0)).astype(int)  # where the entries of a tensor stand among its packed ones

Terms = Float[np.ndarray, "p 3 25"]
"""Coefficients of the three components of an equation in p unknowns, over the columns of the sums."""


def _terms(columns: slice, table: Float[np.ndarray, "k 3 p"]) -> Terms:
    """The terms of p unknowns from a table over some of the columns."""
    terms = np.zeros((table.shape[2], 3, WIDTH))
    terms[:, :, columns] = table.transpose(2, 1, 0)
    return terms


WEIGHT = _terms(SPECIFIC, np.eye(3)[:, :, None])
ACCELERATION = WEIGHT - _terms(GRAVITY, np.eye(3)[:, :, None])
LEVER = _terms(MOTION, FIRST_MOMENT_OF_FEATURES)
OFFSET = _terms(slice(CONSTANT, CONSTANT + 1), np.eye(3)[None])
ARM, COUNTERWEIGHT = _terms(FORCE, PI_OF_FORCE), _terms(SPECIFIC, PI_OF_FORCE)
INERTIA = _terms(MOTION, OMEGA_R_OF_FEATURES)
FORCE_TERMS = np.concatenate([WEIGHT, LEVER, OFFSET])
MASS_AT, OFFSET_AT = slice(0, 1), slice(4, 7)
MOMENT_TERMS = np.concatenate([ARM, INERTIA, OFFSET])
INERTIA_AT = slice(3, 9)
MOMENT_TERMS_WITH_WEIGHT = np.concatenate([MOMENT_TERMS, COUNTERWEIGHT])
COUNTERWEIGHT_AT = slice(len(MOMENT_TERMS), len(MOMENT_TERMS_WITH_WEIGHT))


@dataclass(frozen=True, eq=False)
class ConventionFit:
    """The unknowns of an equation, their covariance, and chi-square: left over, weighted, with what the priors cost.

    Of several sums side by side, one each.
    """

    values: Float[np.ndarray, "*m p"]
    covariance: Float[np.ndarray, "*m p p"]
    misfit: Float[np.ndarray, "*m"]

    def significance(self, unknowns: slice) -> Float[np.ndarray, "*m"]:
        """Return the distance of some unknowns from zero (as a length), in standard deviations."""
        values, spread = self.values[..., unknowns], self.covariance[..., unknowns, unknowns]
        return np.asarray(np.sqrt((values * np.linalg.solve(spread, values[..., None])[..., 0]).sum(axis=-1)))

    @property
    def trace(self) -> tuple[float, float]:
        """Trace of the tensor in a fit of the moment, and its standard uncertainty [kg·m²]."""
        moments = np.arange(INERTIA_AT.start, INERTIA_AT.stop)[ROWS == COLUMNS]
        variance = float(self.covariance[np.ix_(moments, moments)].sum())
        return float(self.values[moments].sum()), float(np.sqrt(max(variance, 0.0)))


def _normal_equations(
    sums: ConventionSums, terms: Terms, answer: slice, instruments: Terms | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (p, p) and right side (p,) of fitting ``answer`` by ``terms``, as means over the instants.

    ``instruments``: terms by which both sides are multiplied in place of ``terms`` (instrumental variables).
    """
    count, instruments = len(terms), terms if instruments is None else instruments
    products = (instruments.reshape(-1, WIDTH) @ sums.gram).reshape(*sums.gram.shape[:-2], count, 3, WIDTH)
    flat = products.reshape(*products.shape[:-2], 3 * WIDTH)
    return flat @ terms.reshape(count, -1).T, np.trace(products[..., answer], axis1=-2, axis2=-1)


def solve(
    sums: ConventionSums,
    terms: Terms,
    answer: slice,
    *,
    variance: float,
    priors: Float[np.ndarray, " p"] | None = None,
) -> ConventionFit:
    """Fit ``answer`` (force or moment) by ``terms``, each sample's components of this variance.

    ``priors`` (p,): standard deviation about zero of each unknown, inf where none is stated.
    """
    normal, right = _normal_equations(sums, terms, answer)
    total = np.trace(sums.gram[..., answer, answer], axis1=-2, axis2=-1)
    weight = sums.instants / variance
    loose = np.full(len(terms), np.inf) if priors is None else priors
    scale = np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 1e-300)
    matrix = weight * normal + (1 / loose**2 + 1e-10 * weight * scale + 1e-30)[..., None] * np.eye(len(terms))
    values = np.linalg.solve(matrix, weight * right[..., None])[..., 0]
    squared = (values * (normal @ values[..., None])[..., 0]).sum(axis=-1)
    misfit = weight * (total - 2 * (right * values).sum(axis=-1) + squared) + ((values / loose) ** 2).sum(axis=-1)
    return ConventionFit(values, np.linalg.inv(matrix), np.asarray(misfit))


def variance_left(sums: ConventionSums, terms: Terms, answer: slice) -> float:
    """Variance per component that a fit leaves [unit²], at least ``LEAST_MISFIT`` of its changes, squared.

    The least of several sums.
    """
    misfit = solve(sums, terms, answer, variance=1.0).misfit / (3 * sums.instants)
    free = max(1 - len(terms) / (3 * sums.instants), 0.1)
    return max(float(np.maximum(misfit / free, LEAST_MISFIT**2 * sums.changes(answer)).min()), 1e-18)


def negativity(fit: ConventionFit) -> Float[np.ndarray, "*m"]:
    """Increase of chi-square when a tensor's negative moments are raised to zero."""
    moments, axes = np.linalg.eigh(fit.values[..., INERTIA_AT][..., UNPACKED])
    forms = axes[..., ROWS, :] * axes[..., COLUMNS, :] * np.where(ROWS == COLUMNS, 1, 2)[:, None]
    spread = (forms * (fit.covariance[..., INERTIA_AT, INERTIA_AT] @ forms)).sum(axis=-2)
    return np.asarray(np.where(moments < 0, moments**2 / spread, 0.0).max(axis=-1))


@dataclass(frozen=True, eq=False)
class CentreFit:
    """The centre of gravity from the point where the moment is taken, by r × F."""

    r: Float[np.ndarray, "3"]
    """Centre of gravity from the point where the moment is taken [m]."""
    covariance: Float[np.ndarray, "3 3"]
    """Covariance matrix of ``r`` [m²]."""
    undetermined: Float[np.ndarray, "3 3"]
    """The projector onto the directions of r that the run does not determine."""


LEAST_SIGNAL = 0.5
"""Part of the force's changes that must be more than its noise, for a direction of r to count.

Choice: half, where the correction for noise doubles the variance.
"""
ZERO_LEVER = 5e-3
"""Lever which, times the weight, is the moment that may be the load cell's zero, as a standard deviation [m].

Prior: our choice, wide, so that a zero of the load cell is no evidence of anything else.
"""


def fit_centre(sums: ConventionSums) -> CentreFit:
    """Fit the moment by r × F, I α + ω × I ω and an offset with a prior.

    The instrument of r × F is the force that specific force and motion explain: so neither the noise in F counts, nor
    that in M, which has a share of it where another point's moment is made from the measured force. Directions of r
    that only noise, or a change like that of the motion's own moment tells of come back with a variance of 1 m².
    """
    moment = variance_left(sums, MOMENT_TERMS, MOMENT)
    offset = max(ZERO_LEVER * sums.size(FORCE) + sums.noise[1] / 2, 1e-9)
    instruments = MOMENT_TERMS.copy()
    instruments[:3] -= ARM[:, :, FORCE] @ _force_noise(sums)
    normal, right = _normal_equations(sums, MOMENT_TERMS, MOMENT, instruments)
    # at rest no motion determines the tensor
    loose = [1e-12 * normal[INERTIA_AT, INERTIA_AT].trace() + 1e-30] * 6 + [moment / sums.instants / offset**2] * 3
    others = np.linalg.solve(normal[3:, 3:] + np.diag(loose), np.column_stack([normal[3:, :3], right[3:]]))
    matrix = normal[:3, :3] - normal[:3, 3:] @ others[:, :3]
    answer = right[:3] - normal[:3, 3:] @ others[:, 3]
    plain = _normal_equations(sums, MOMENT_TERMS, MOMENT)[0]
    seen = plain[:3, :3] - plain[:3, 3:] @ others[:, :3]
    noise = seen - (matrix + matrix.T) / 2
    scale = np.linalg.cholesky(seen + 1e-12 * seen.trace() * np.eye(3))
    whitened = np.linalg.solve(scale, np.linalg.solve(scale, noise).T)
    share, axes = np.linalg.eigh(np.eye(3) - whitened)
    determined = share > LEAST_SIGNAL
    basis, share = np.linalg.solve(scale.T, axes)[:, determined], share[determined]
    r = basis @ np.linalg.solve(basis.T @ matrix @ basis, basis.T @ answer)
    spread = (moment + max(float(r @ noise @ r), 0.0)) / sums.instants
    undetermined = np.eye(3)
    if determined.any():
        directions = np.linalg.qr(scale @ axes[:, determined])[0]
        undetermined = undetermined - directions @ directions.T
    return CentreFit(r, basis * (spread / share) @ basis.T + undetermined, undetermined)


def _force_noise(sums: ConventionSums) -> Float[np.ndarray, "3 25"]:
    """The force less what specific force and motion best explain of it, as a combination of the columns."""
    rows = -np.einsum("p,pij->ij", solve(sums, FORCE_TERMS, FORCE, variance=1.0).values, FORCE_TERMS)
    rows[:, FORCE] += np.eye(3)
    return rows
