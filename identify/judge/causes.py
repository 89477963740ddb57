"""The causes that are looked for: what each adds to force and moment, and its usual size; those that a run follows."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.joint.joint_model import TEN
from identify.joint.predicted_wrench import PredictedWrench
from identify.joint.priors import indices
from identify.judge.evidence import Base, Cause, Evidence, evidence
from identify.judge.findings import Finding
from identify.judge.run_fit import RunFit
from identify.rigid_body.regressor import cross_matrices, cross_matrix
from identify.signals.resample import uniform_spline


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
    acting = cause.columns.any(axis=(0, 1)) & (cause.size > 0)
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


CHANCE = 1e-4
"""Chance that residuals follow one cause by accident, above which nothing is reported.

Chance: as computed, some 24 causes together reach it in one clean run of 400. ``LIKELY`` is stricter: 40 clean runs
reach 6e-6 (``tests.helpers.judge_margins``).
"""
LIKELY = 0.0
"""Logarithm of the Bayes factor from which a cause is more probable than none.

Definition: even odds. In 40 clean runs at most −0.2, in the middle −4.4 (``tests.helpers.judge_margins``).
"""
CLEAR = 3.0
"""Logarithm of the Bayes factor from which a cause is more probable than another.

Definition: odds of twenty to one, strong evidence by Kass and Raftery (doi:10.1080/01621459.1995.10476572).
"""
MOST = 3
"""Causes that are named of one run.

Choice: what a reader checks at once.
"""
NEARLY = 0.85
"""Part of what a cause explains that a cause of fewer coefficients must explain to be named in its place.

Choice: many coefficients imitate a few.
"""
ECHO = 0.3
"""Least share, of what the first cause explains, that a further cause must explain.

Choice: less may be an error of linearisation of the first.
"""


class FollowedCause(NamedTuple):
    """A cause that a run's residuals follow."""

    evidence: Evidence
    rivals: tuple[str, ...]
    """Other causes that are about as probable."""
    changes: np.ndarray
    """Errors that the cause makes in the joint model's mass, r_CG and packed tensor [kg], [m], [kg·m²]."""

    def sentence(self, quantity: str) -> str:
        """Return what the residuals follow, and the cure.

        Args:
            quantity: words for what was measured: force and moment, or the moment alone.
        """
        finding, size = self.evidence.cause.finding, self.evidence.cause.size
        spread = size * np.sqrt(np.maximum(np.diag(self.evidence.covariance), 0.0))
        also = f"; as probable: {', '.join(self.rivals)}" if self.rivals else ""
        verb = "looks" if quantity == "the moment" else "look"
        return f"{quantity} {verb} {finding.phrase(self.evidence.values, spread)}{also}; {finding.cure}"


class Judgement(NamedTuple):
    """Causes that a run's residuals follow, and the rest that none explains."""

    causes: list[FollowedCause]
    """Causes that the residuals follow, the most probable first."""
    explained: float
    """Part of the residuals' squares that these explain together."""
    unexplained: float
    """Root mean square of what no cause explains, in the motion's band over that above it, on the worst row."""
    row: int
    """Row in which ``unexplained`` is largest, counted from the last: force from −6, moment from −3."""


def _simplest(likely: Sequence[Evidence]) -> Evidence:
    """The most probable cause, or a simpler one that explains nearly as much: many coefficients imitate a few."""
    best = likely[0]
    simpler = [e for e in likely if len(e.coefficients) < len(best.coefficients) and e.share > NEARLY * best.share]
    return simpler[0] if simpler else best


def followed(run: RunFit, free: frozenset[str], base: Base) -> Judgement:
    """Return the causes that a run's residuals follow, and how much more than noise they leave.

    Args:
        run: at its best.
        free: unknowns of which nothing is declared.
        base: the fitted unknowns, and what else is declared.
    """
    ten = run.prior.root[indices(TEN)]
    open_to = [(cause, run.transformed(cause.columns * cause.size)) for cause in causes(run.prediction, free=free)]
    named: list[FollowedCause] = []
    first = 0.0
    while len(named) < MOST:
        judged = [e for candidate in open_to if (e := evidence(base, *candidate)) is not None]
        likely = sorted((e for e in judged if e.chance < CHANCE and e.logarithm > LIKELY), key=lambda e: -e.logarithm)
        if not likely:
            break
        best = _simplest(likely)
        power = float(np.square(base.beside(best.columns)[0] @ best.coefficients).sum())
        if named and power < ECHO * first:
            break
        first = first or power
        rivals = tuple(
            e.cause.finding.label for e in likely if e is not best and abs(best.logarithm - e.logarithm) < CLEAR
        )
        named.append(FollowedCause(best, rivals, ten @ best.shift[: len(run.z)]))
        base = base.taking(best.columns, best.coefficients)
        open_to = [candidate for candidate in open_to if candidate[0].finding is not best.cause.finding]
    prediction = run.prediction
    above = run.lines.above(prediction.counted(prediction.residuals[:, :, None])[:, :, 0])
    ratio = np.sqrt(np.mean(base.residuals**2, axis=0) / np.maximum(np.mean(above**2, axis=0), 1e-300))
    explained = 1 - float((base.residuals**2).sum() / max((run.base.residuals**2).sum(), 1e-300))
    return Judgement(named, explained, float(ratio.max()), int(np.argmax(ratio)) - len(ratio))
