"""What a run says of its mechanics, in a few sums: smoothed signals of both sensors on common instants.

Newton's and Euler's equations are linear in force, moment, specific force, angular acceleration and the products of the
angular velocities. One smoothing filter over all of them, products taken before, keeps them exact and takes the noise
off; every hypothesis about signs, axes, units and zeros is then a small least-squares problem on the same sums.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.channels import ImuChannel, WrenchChannel

Array = NDArray[np.float64]

SMOOTHING = 0.05  # standard deviation of the Gaussian filter [s]: half the power at 2.6 Hz
STEP = 0.05  # between the instants that are kept [s]
LEAST_SECONDS = 3.0  # with less there is too little to judge
PRODUCTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
FORCE, MOMENT, SPECIFIC, ALPHA = (slice(3 * i, 3 * i + 3) for i in range(4))
SQUARES, GRAVITY, ONE = slice(12, 18), slice(18, 21), 21
WIDTH = 22


@dataclass(frozen=True, eq=False)
class Features:
    """Means of the products of all features, (22, 22), and how many independent instants they stand for.

    The features: force [N], moment [N·m], specific force [m/s²], angular acceleration [rad/s²], the six products of the
    angular velocities [rad²/s²], gravity as the gyro carries it along [m/s²], one. ``noise``: standard deviation of
    what the filter took off the force [N] and the moment [N·m]; ``white``: what it leaves of
    white noise's variance.
    """

    gram: Array
    instants: float
    noise: tuple[float, float] = (0.0, 0.0)
    white: float = 0.0

    def mean(self, which: slice) -> Array:
        """The mean of some features."""
        return self.gram[which, ONE]

    def covariance(self, which: slice) -> Array:
        """The covariance of some features over the run."""
        return self.gram[which, which] - np.outer(self.mean(which), self.mean(which))

    def turned(self, *, wrench: Array | None = None, imu: Array | None = None) -> "Features":
        """The features with the axes of the wrench or of the IMU turned (or mirrored) by a matrix."""
        change = np.eye(WIDTH)
        if wrench is not None:
            change[FORCE, FORCE] = change[MOMENT, MOMENT] = wrench
        if imu is not None:
            change[SPECIFIC, SPECIFIC] = change[ALPHA, ALPHA] = change[GRAVITY, GRAVITY] = imu
            change[SQUARES, SQUARES] = _turned_products(imu)
        return replace(self, gram=change @ self.gram @ change.T)

    def scaled(self, which: slice, factor: float) -> "Features":
        """The features with some of them multiplied."""
        change = np.ones(WIDTH)
        change[which] = factor
        noise = self.noise[0] * change[FORCE.start], self.noise[1] * change[MOMENT.start]
        return replace(self, gram=self.gram * np.outer(change, change), noise=noise)


def _turned_products(matrix: Array) -> Array:
    columns = []
    for i, j in PRODUCTS:
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0
        product = matrix @ unit @ matrix.T
        columns.append([product[a, b] for a, b in PRODUCTS])
    return np.array(columns).T


def features(wrench: WrenchChannel, imu: ImuChannel) -> Features | None:
    """The sums of a run in SI; None where the two sensors have too little time in common, or numbers that are none."""
    period = max(float(np.median(np.diff(channel.stamp))) * 1e-9 for channel in (wrench, imu))
    start, stop = (f(wrench.stamp[k], imu.stamp[k]) for f, k in ((max, 0), (min, -1)))
    step = max(period, 0.002)
    if not 0 < step <= SMOOTHING or (stop - start) * 1e-9 < LEAST_SECONDS:
        return None
    grid = np.arange(0.0, (stop - start) * 1e-9, step)
    columns = [
        _on_grid(channel.stamp - start, values, grid)
        for channel, values in (
            (wrench, np.concatenate([wrench.force, wrench.moment], axis=1)),
            (imu, np.concatenate([imu.linear_acceleration, imu.angular_velocity], axis=1)),
        )
    ]
    if not all(np.isfinite(part).all() for part in columns):
        return None
    wrenches, (specific, omega) = columns[0], np.split(columns[1], 2, axis=1)
    products = np.stack([omega[:, i] * omega[:, j] for i, j in PRODUCTS], axis=1)
    gravity = carried_gravity(step, omega, specific)
    half = round(4 * SMOOTHING / step)
    time = np.arange(-half, half + 1) * step
    bell = np.exp(-0.5 * (time / SMOOTHING) ** 2)
    bell /= bell.sum()
    slope = -time * bell / (bell @ time**2)
    smooth = np.concatenate([wrenches, specific, omega, products, gravity, np.ones((len(grid), 1))], axis=1)
    filters = [slope if ALPHA.start <= k < ALPHA.stop else bell for k in range(WIDTH)]
    kept = [np.convolve(column, taps, mode="valid") for column, taps in zip(smooth.T, filters, strict=True)]
    rows = np.stack(kept, axis=1)[:: max(1, round(STEP / step))]
    rough = smooth[half : len(smooth) - half, :6] - np.stack(kept[:6], axis=1)
    noise = float(np.sqrt((rough[:, FORCE] ** 2).mean())), float(np.sqrt((rough[:, MOMENT] ** 2).mean()))
    width = 2 * np.sqrt(np.pi) * SMOOTHING
    return Features(rows.T @ rows / len(rows), len(rows) * STEP / width, noise, step / width)


def _on_grid(stamp: NDArray[np.int64], values: Array, grid: Array) -> Array:
    """Values at the instants of the grid [s]; a faster sensor's are averaged over its step first."""
    time = stamp * 1e-9
    width = max(1, round(float(grid[1] - grid[0]) / max(float(np.median(np.diff(time))), 1e-9)) | 1)
    box = np.ones(width) / width
    smooth = [np.convolve(column, box, mode="same") if width > 1 else column for column in values.T]
    return np.stack([np.interp(grid, time, column) for column in smooth], axis=1)


RECALL = 20.0  # seconds after which the accelerometer has the say on where gravity is
LARGEST_BIAS = 0.02  # rad/s of mean angular velocity that is taken for the gyro's bias


def carried_gravity(step: float, omega: Array, specific: Array) -> Array:
    """Gravity's direction in the body frame, times its size: turned by the gyro, drawn slowly to the specific force.

    dg/dt = -ω × g + (f - g) / RECALL, begun at the mean of the first half second.
    """
    size = float(np.median(np.linalg.norm(specific, axis=1)))
    g = specific[: max(1, round(0.5 / step))].mean(axis=0).tolist()
    found = np.empty_like(specific)
    drift = omega.mean(axis=0)
    omega = omega - drift if float(np.linalg.norm(drift)) < LARGEST_BIAS else omega
    share = step / RECALL
    for i, ((p, q, r), (fx, fy, fz)) in enumerate(zip(omega.tolist(), specific.tolist(), strict=True)):
        x, y, z = g
        x += step * (r * y - q * z) + share * (fx - x)
        y += step * (p * z - r * g[0]) + share * (fy - y)
        z += step * (q * g[0] - p * g[1]) + share * (fz - z)
        norm = max((x * x + y * y + z * z) ** 0.5, 1e-12)
        g = [x * size / norm, y * size / norm, z * size / norm]
        found[i] = g
    return found
