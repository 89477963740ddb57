"""The causes that are looked for: what each adds to the measured force and moment, and how large it usually is."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.joint.predicted_wrench import PredictedWrench
from identify.judge.findings import Finding
from identify.rigid_body.regressor import cross_matrices, cross_matrix
from identify.signals.resample import uniform_spline


class Cause(NamedTuple):
    """Signals that a cause makes, and the size that it may well have."""

    finding: Finding
    columns: Float[np.ndarray, "n 6 p"]
    """Change of the measured wrench by a unit of each of p coefficients, at n instants."""
    size: Float[np.ndarray, " p"]
    """Typical standard deviation of each coefficient where no care was taken."""


def causes(run: PredictedWrench, *, free: frozenset[str]) -> list[Cause]:
    """Return the causes to look for.

    Args:
        run: at its best.
        free: names of unknowns of which nothing is declared: these are no news.
    """
    made = [Cause(finding, *make(run)) for finding, make in SIGNALS.items() if UNKNOWNS.get(finding) not in free]
    return [cause for cause in map(_acting, made) if len(cause.size)]


def _acting(cause: Cause) -> Cause:
    """A cause without the coefficients that do nothing."""
    acting = (np.abs(cause.columns).max(axis=(0, 1)) > 0) & (cause.size > 0)
    return Cause(cause.finding, cause.columns[:, :, acting], cause.size[acting])


Made = tuple[np.ndarray, np.ndarray]
"""Columns of a cause, (n, 6, p), and the typical sizes of its coefficients, (p,)."""


def _unknown(*parts: tuple[str, float]) -> Callable[[PredictedWrench], Made]:
    def make(run: PredictedWrench) -> Made:
        columns = [run.derivative(unknown) for unknown, _ in parts]
        sizes = [np.full(block.shape[2], size) for block, (_, size) in zip(columns, parts, strict=True)]
        return np.concatenate(columns, axis=2), np.concatenate(sizes)

    return make


def _matrix(where: Callable[[int, int], bool], part: float) -> Callable[[PredictedWrench], Made]:
    """Elements of the load cell's matrix, each as large as this part of the component's size."""

    def make(run: PredictedWrench) -> Made:
        size = _largest(np.sqrt((run.wrench**2).mean(axis=0)))
        chosen = [(i, j) for i in range(6) for j in range(6) if where(i, j)]
        columns = run.derivative("cell_matrix")[:, :, [6 * i + j for i, j in chosen]]
        return columns, np.array([part * size[i] / size[j] if size[j] > 0 else 0.0 for i, j in chosen])

    return make


def _wrench(signal: Callable[[PredictedWrench], np.ndarray], part: float) -> Callable[[PredictedWrench], Made]:
    """Additions to the wrench, (n, 6, p), each as large as this part of the wrench's changes."""

    def make(run: PredictedWrench) -> Made:
        columns, changes = signal(run), _largest(run.wrench.std(axis=0))
        rms = np.sqrt((columns**2).mean(axis=0))
        endless = np.full(rms.shape, np.inf)
        ratio = np.divide(changes[:, None], rms, out=endless, where=rms > 1e-12 * rms.max())
        size = part * ratio.min(axis=0)
        return columns, np.where(np.isfinite(size), size, 0.0)

    return make


def _largest(sizes: np.ndarray) -> np.ndarray:
    """The largest of force and of moment, on each of their rows."""
    return np.repeat([sizes[:3].max(), sizes[3:].max()], 3)


def _on_axes(signal: np.ndarray, rows: slice) -> np.ndarray:
    """Each component of a signal (n, k) on its own row of the wrench, (n, 6, k)."""
    columns = np.zeros((len(signal), 6, signal.shape[1]))
    columns[:, np.arange(6)[rows], np.arange(signal.shape[1])] = signal
    return columns


def _cable(run: PredictedWrench) -> np.ndarray:
    """Force and moment linear in the attitude."""
    attitude = run.signals.turning
    columns = np.zeros((len(attitude), 6, 18))
    for row in range(6):
        columns[:, row, 3 * row : 3 * row + 3] = attitude
    return columns


def _air(run: PredictedWrench) -> np.ndarray:
    omega = run.signals.omega
    return np.concatenate([_on_axes(omega, slice(3, 6)), _on_axes(np.abs(omega) * omega, slice(3, 6))], axis=2)


def _flexible(run: PredictedWrench) -> np.ndarray:
    """A body that turns on its mounting by −M/k: its angular acceleration has the second derivative of that, too."""
    return _on_axes(-derivative(run, run.wrench[:, 3:], 2), slice(3, 6))


def _moving(run: PredictedWrench) -> np.ndarray:
    return run.derivative("inertia") * run.signals.progress[:, None, None]


def _gain_drift(run: PredictedWrench) -> np.ndarray:
    """Gains that were right at the start."""
    return _on_axes(run.wrench * (run.signals.progress + 0.5)[:, None], slice(0, 6))


def _late(run: PredictedWrench) -> np.ndarray:
    """Force and moment that come late, each by its own time."""
    slope = -derivative(run, run.wrench, 1)
    columns = np.zeros((len(slope), 6, 2))
    columns[:, :3, 0], columns[:, 3:, 1] = slope[:, :3], slope[:, 3:]
    return columns


def derivative(run: PredictedWrench, signal: np.ndarray, order: int) -> np.ndarray:
    """Return a derivative of a signal of a run's rows by time."""
    step = run.model.rows.interval
    return uniform_spline(signal, step, degree=5)(step * np.arange(len(signal)), order)


def _carried(run: PredictedWrench, force: Float[np.ndarray, "n 3 p"]) -> np.ndarray:
    """A force at the centre of gravity with its moment about Q, where the accelerometer tells it, (n, 6, p)."""
    lever = cross_matrix(run.x["r_cg"]) @ force
    return np.concatenate([force, lever], axis=1) * (run.force_from == "accelerometer")


def accelerometer_place(run: PredictedWrench) -> np.ndarray:
    """Return what a metre of the accelerometer's place adds to the wrench, (n, 6, 3), where it tells the force."""
    return _carried(run, -run.x["mass"] * run.signals.levers)


def accelerometer_scale(run: PredictedWrench) -> np.ndarray:
    """Return what the accelerometer's scale factors add to the wrench, (n, 6, 3), where it tells the specific force."""
    return _carried(run, -run.wrench[:, :3, None] * np.eye(3))


def gyro_axes(run: PredictedWrench) -> Float[np.ndarray, "n 6 3"]:
    """Return what a gyro turned by a radian against the accelerometer adds; without one it is the IMU that turns."""
    omega, alpha = -run.signals.spin, -cross_matrices(run.signals.alpha)
    return run.changed(omega, alpha, np.zeros_like(omega)) * (run.force_from == "accelerometer")


def _gyro_late(run: PredictedWrench) -> Made:
    """Axes of the gyro that come late, each by its own time."""
    slopes = run.signals.alpha, derivative(run, run.signals.alpha, 1)
    omega, alpha = (signal[:, :, None] * np.eye(3) for signal in slopes)
    nodes = run.signals.nodes
    turning = np.gradient(run.signals.rate_at(nodes), nodes, axis=0)[:, :, None] * np.eye(3)
    return run.changed(omega, alpha, np.zeros_like(omega), turning=turning), np.full(3, 0.003)


def _gyro_g(run: PredictedWrench) -> Made:
    """Angular velocity that specific force feigns, each axis by each: its slope counts in alpha."""
    force = run.specific_force
    slope = derivative(run, force, 1)
    omega, alpha = (
        -np.einsum("nj,ik->nikj", signal, np.eye(3)).reshape(len(signal), 3, 9) for signal in (force, slope)
    )
    at_nodes = run.signals.up_at_start @ run.signals.attitude_at_nodes  # gravity alone, where the attitude follows
    turning = -run.gravity * np.einsum("nj,ik->nikj", at_nodes, np.eye(3)).reshape(len(at_nodes), 3, 9)
    return run.changed(omega, alpha, np.zeros_like(omega), turning=turning), np.full(9, 3e-4)


def _clock(run: PredictedWrench) -> Made:
    """A delay that grows over the run, about one that is any: clocks agree at the start rather than midway."""
    delay = run.derivative("delay")
    return np.concatenate([delay * run.signals.progress[:, None, None], delay], axis=2), np.array([0.02, 0.01])


STEPS = (-0.25, 0.0, 0.25)
"""Instants at which a sudden change is assumed, in parts of the run from its middle.

Choice: three, which a change between them still resembles.
"""


def _jump(run: PredictedWrench) -> np.ndarray:
    return np.concatenate(
        [_on_axes(np.repeat((run.signals.progress > at)[:, None], 6, axis=1).astype(float), slice(0, 6))
         for at in STEPS], axis=2,
    )  # fmt: skip


def _slip(run: PredictedWrench) -> Made:
    """A body that slips after a quarter, a half or three quarters of the run."""
    after = np.stack([run.signals.progress > at for at in STEPS], axis=1).astype(float)
    columns = np.einsum("nip,nk->nipk", run.derivative("r_cg"), after).reshape(len(after), 6, -1)
    return columns, np.full(columns.shape[2], 1e-3)


def _mass(run: PredictedWrench) -> Made:
    return run.derivative("mass"), 0.02 * np.abs(run.x["mass"])


UNKNOWNS = {
    Finding.DELAY: "delay", Finding.ROTATION: "rotation", Finding.MASS: "mass", Finding.CENTRE: "r_cg",
    Finding.STILL_MISSED: "cg_from_still",
}  # fmt: skip
"""Causes that are one unknown of the joint model."""
SIGNALS: dict[Finding, Callable[[PredictedWrench], Made]] = {
    Finding.DELAY: _unknown(("delay", 0.005)),
    Finding.ROTATION: _unknown(("rotation", 0.03)),
    Finding.CENTRE: _unknown(("r_cg", 0.003)),
    Finding.MASS: _mass,
    Finding.STILL_MISSED: _unknown(("cg_from_still", 0.02)),
    Finding.GYRO_SCALE: _unknown(("gyro_scale", 0.005)),
    Finding.GYRO_BIAS: _unknown(("gyro_drift", 0.001)),
    Finding.GYRO_AXES: lambda run: (gyro_axes(run), np.full(3, 0.005)),
    Finding.GYRO_LATE: _gyro_late,
    Finding.GYRO_G: _gyro_g,
    Finding.GAIN: _matrix(lambda i, j: i == j, 0.005),
    Finding.CROSS_TALK: _matrix(lambda i, j: i != j, 0.01),
    Finding.DRIFT: _unknown(("force_drift", 2.0), ("moment_drift", 0.05)),
    Finding.JUMP: _wrench(_jump, 0.02),
    Finding.SLIP: _slip,
    Finding.GAIN_DRIFT: _wrench(_gain_drift, 0.005),
    Finding.CABLE: _wrench(_cable, 0.02),
    Finding.AIR: _wrench(_air, 0.02),
    Finding.FLEXIBLE_MOUNTING: _wrench(_flexible, 0.01),
    Finding.TENSOR: _wrench(_moving, 0.01),
    Finding.ACCELEROMETER_PLACE: lambda run: (accelerometer_place(run), np.full(3, 0.01)),
    Finding.ACCELEROMETER_SCALE: lambda run: (accelerometer_scale(run), np.full(3, 0.005)),
    Finding.CLOCK: _clock,
    Finding.FILTER: _wrench(_late, 0.02),
    Finding.NONLINEARITY: _wrench(lambda run: _on_axes(run.wrench**2, slice(0, 6)), 0.005),
}
"""Functions that make the signals of each cause."""
