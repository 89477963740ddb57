"""The unknowns of one run at their best under their priors: what causes are judged beside.

Gauss–Newton with the derivatives of :mod:`identify.model_check.predicted_wrench`, on the lines of the cosine transform
up to the motion's band: above it the motion's derivatives hold the gyro's noise, which the residuals hold, too.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float

from identify.joint.joint_model import WANDER
from identify.model_check.evidence import products
from identify.model_check.motion_signals import ReducedRun
from identify.model_check.predicted_wrench import Columns, Force, PredictedWrench, about_centre, zero_unknowns
from identify.signals.band_limited_run import PASSED

STEPS = 10
ENOUGH = 0.02
"""Change of the unknowns, in standard uncertainties, below which they are at their best."""
OVER_BAND = 1.2
"""Highest frequency that is compared, over the motion's."""
SLOW = "slow"
"""Name of the gyro's bias and random walk together."""


@dataclass(frozen=True)
class TransformedRows:
    """The cosine transform of rows up to the motion's band, in units of their noise."""

    interval: float
    band: float
    whitener: Float[np.ndarray, "rows rows"]
    r_cg: Float[np.ndarray, "3"] | None = None
    """Centre of gravity [m] when only moments about it count, as nothing measures the specific force; otherwise
    None."""

    def __call__(self, columns: Float[np.ndarray, "n 6 p"]) -> Float[np.ndarray, "m rows p"]:
        """Return the lines of some columns."""
        counting = columns if self.r_cg is None else about_centre(columns, self.r_cg)
        count = int(2 * OVER_BAND * self.band * self.interval * len(columns))
        signals = counting.reshape(len(counting), -1)
        acting = signals.any(axis=0)  # most columns change few rows
        lines = np.zeros((count, signals.shape[1]))
        lines[:, acting] = scipy.fft.dct(signals[:, acting], axis=0, norm="ortho")[:count]
        return np.asarray(self.whitener @ lines.reshape(count, *counting.shape[1:]))

    def above(self, rows: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "m 6"]:
        """Return the lines of rows above the motion's band, as far as the run's low-pass is flat."""
        lines = scipy.fft.dct(rows, axis=0, norm="ortho")
        first, last = (int(2 * over * self.band * self.interval * len(rows)) for over in (OVER_BAND, PASSED))
        return np.asarray(lines[first:last] @ self.whitener.T)


@dataclass(frozen=True)
class DeclaredUnknowns:
    """Declared means and uncertainties of a run's unknowns."""

    mean: dict[str, np.ndarray]
    """Prior mean of each unknown of :class:`identify.joint.joint_model.Unknowns`; unknowns that are missing here have
    zero."""
    root: dict[str, np.ndarray]
    """Root of each inexact unknown's prior covariance: its product with its transpose is the covariance."""
    flat: tuple[str, ...]
    """Unknowns without a prior."""
    gravity: float
    imu_position: np.ndarray
    gyro_bias: np.ndarray
    """Standard uncertainty of the gyro's zero on each axis [rad/s]."""
    gyro_density: np.ndarray
    """Density of the gyro's white noise on each axis, whose integral makes the attitude wander [rad/s^0.5]."""
    reference: dict[str, np.ndarray]
    """Start of the search of each unknown for which it is not the prior mean."""


@dataclass(frozen=True)
class RunFit:
    """A run at its best."""

    prediction: PredictedWrench
    lines: TransformedRows
    residuals: Float[np.ndarray, "m rows"]
    columns: Float[np.ndarray, "m rows q"]
    """Change of the residuals by a unit of each of the q numbers that are estimated."""
    precision: Float[np.ndarray, " q"]
    """Prior precision of each number: one, or zero without a prior."""
    places: dict[str, slice]
    """Slice of each unknown among the numbers that are estimated."""
    root: dict[str, np.ndarray]
    """Matrix from an unknown's numbers to the unknown; a missing one is the unit matrix."""
    numbers: Float[np.ndarray, " q"]
    """Values of the numbers at which ``prediction`` was made, counted from the priors' means."""

    @property
    def tensor(self) -> slice:
        """Slice of the tensor among the numbers that are estimated."""
        return self.places["inertia"]

    @property
    def level(self) -> Float[np.ndarray, "6"]:
        """Root mean square of the residuals of each row [N], [N·m]."""
        back = np.linalg.inv(self.lines.whitener)
        return np.asarray(np.sqrt(np.mean((self.residuals @ back.T) ** 2, axis=0)))


def fit_run(recorded: ReducedRun, declared: DeclaredUnknowns, force_from: Force) -> RunFit:
    """Return a run's unknowns at their best.

    Args:
        recorded: the run.
        declared: the priors.
        force_from: where the specific force comes from.
    """
    x = zero_unknowns() | {name: np.array(value, float) for name, value in (declared.mean | declared.reference).items()}
    slow = np.zeros((1 + WANDER, 3))
    names = [*declared.flat, *declared.root, SLOW, *(["start"] if force_from == "still" else [])]
    signals = recorded.signals(slow, x)
    x["up"] = np.array([0.0, 0.0, 1.0])
    if force_from == "still":
        mean = np.einsum("nij,nj->i", signals.turns, signals.force)
        x["up"] = mean / np.linalg.norm(mean)
    wrench = np.hstack([signals.force, signals.moment])
    r_cg = x["r_cg"] if force_from == "none" else None
    rows = wrench if r_cg is None else about_centre(wrench[:, :, None], r_cg)[:, :, 0]
    whitener = np.diag(1 / np.maximum(rows.std(axis=0), 1e-12))
    started = [name for name in declared.reference if name in declared.root]
    distance = {name: np.linalg.lstsq(declared.root[name], x[name] - declared.mean[name])[0] for name in started}
    for step in range(STEPS):
        prediction = PredictedWrench(
            signals=signals, x=dict(x), force_from=force_from, gravity=declared.gravity,
            imu_position=declared.imu_position,
        )  # fmt: skip
        blocks = {name: block_of(prediction, recorded, declared, name) for name in names}
        lines = TransformedRows(signals.interval, signals.band, whitener, r_cg)
        columns = lines(np.concatenate(list(blocks.values()), axis=2))
        residuals = lines(prediction.residuals[:, :, None])[:, :, 0]
        sizes = {name: block.shape[2] for name, block in blocks.items()}
        precision = np.concatenate([np.full(size, float(name not in declared.flat)) for name, size in sizes.items()])
        z = np.concatenate([distance.get(name, np.zeros(size)) for name, size in sizes.items()])
        normal = products(columns, columns) + np.diag(precision)
        change = _solved(normal, products(columns, residuals[:, :, None])[:, 0] - precision * z)
        remaining = residuals - columns @ change
        near = float(change @ normal @ change) < ENOUGH**2 * len(change)
        if step > 1 and (near or force_from == "none"):
            break
        whitener = np.linalg.inv(np.linalg.cholesky(_covariance(remaining, whitener, force_from, columns.shape[2])))
        if force_from == "none":  # linear in what acts, but for what the estimate tells already
            continue
        for name, part in zip(sizes, np.split(change, np.cumsum(list(sizes.values()))[:-1]), strict=True):
            distance[name] = distance.get(name, 0.0) + part
            if name == SLOW:
                slow = slow + _slow_size(declared) * part.reshape(slow.shape)
            elif name == "start":
                x["up"] = x["up"] + np.cross(part, x["up"])
                x["up"] = x["up"] / np.linalg.norm(x["up"])
            else:
                x[name] = x[name] + (part if name in declared.flat else declared.root[name] @ part)
        signals = recorded.signals(slow, x)
    ends = np.cumsum(list(sizes.values())).tolist()
    places = {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}
    return RunFit(
        prediction=prediction, lines=lines, residuals=remaining, columns=columns, precision=precision, places=places,
        root=declared.root, numbers=z,
    )  # fmt: skip


def block_of(prediction: PredictedWrench, recorded: ReducedRun, declared: DeclaredUnknowns, name: str) -> Columns:
    """Return the columns of an unknown, in units of its prior."""
    if name == SLOW:
        basis = recorded.slow_basis(np.asarray(recorded.rows.t))[recorded.used]
        return prediction.of_slow(basis) * _slow_size(declared).ravel()
    columns = prediction.of(name)
    return columns if name in declared.flat or name == "start" else columns @ declared.root[name]


def _slow_size(declared: DeclaredUnknowns) -> Float[np.ndarray, "terms 3"]:
    """Standard uncertainties of the gyro's bias and random walk, three axes of each."""
    return np.vstack([declared.gyro_bias, *[declared.gyro_density] * WANDER])


def _covariance(left: np.ndarray, whitener: np.ndarray, force_from: Force, count: int) -> np.ndarray:
    """Covariance of the rows' noise, from what is left on the lines; independent rows where nothing joins them."""
    rows = left @ np.linalg.inv(whitener).T
    covariance = rows.T @ rows / max(len(rows) - count / len(whitener), 1.0)
    covariance = covariance + 1e-10 * np.diag(np.diag(covariance)) + 1e-24 * np.eye(len(whitener))
    return np.diag(np.diag(covariance)) if force_from == "still" else covariance


def _solved(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-13)[0] / scale
