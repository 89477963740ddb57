"""The causes that are looked for: what each adds to force and moment, its typical size, and those that runs follow."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.errors.load_cell.warming import drift_shapes
from identify.joint.predicted_wrench import PredictedWrench
from identify.judge.evidence import Base, Evidence, evidence
from identify.judge.findings import Cause
from identify.judge.run_fit import RunFit
from identify.judge.typical_sizes import TYPICAL
from identify.rigid_body.regressor import cross_matrices, cross_matrix
from identify.signals.resample import uniform_spline

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


def _accelerometer_late(run: PredictedWrench) -> Made:
    """An accelerometer whose samples are older than the gyro's."""
    reads = run.force_from == "accelerometer"
    slope = run.signals.accelerometer_slope if reads else np.zeros_like(run.signals.omega)
    return _carried(run, run.x["mass"] * slope[:, :, None]), np.array([0.005])


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


def _warming(run: PredictedWrench) -> Made:
    """Zeros that warm up: they drift faster at the start."""
    shapes = drift_shapes(run.signals.t)
    each = [run.derivative(f"{name}_offset") for name in ("force", "moment")]
    columns = np.concatenate([block * shape[:, None, None] for shape in shapes.T for block in each], axis=2)
    return columns, np.tile(np.repeat([2.0, 0.05], 3), shapes.shape[1])


def _slip(run: PredictedWrench) -> Made:
    """A body that slips after a quarter, a half or three quarters of the run."""
    after = np.stack([run.signals.progress > at for at in STEPS], axis=1).astype(float)
    columns = np.einsum("nip,nk->nipk", run.derivative("r_cg"), after).reshape(len(after), 6, -1)
    return columns, np.full(columns.shape[2], 1e-3)


def _mass(run: PredictedWrench) -> Made:
    return run.derivative("mass"), TYPICAL["mass"] * np.abs(run.x["mass"])


def _weight(run: PredictedWrench) -> Made:
    """A force along the vertical at the centre of gravity, where the accelerometer tells inertia from weight."""
    up = run.signals.up[:, :, None] * (run.force_from == "accelerometer")
    return np.concatenate([up, cross_matrix(run.x["r_cg"]) @ up], axis=1), 0.01 * np.abs(run.x["mass"]) * run.gravity


UNKNOWNS = {
    Cause.DELAY: "delay", Cause.ROTATION: "rotation", Cause.MASS: "mass", Cause.CENTRE: "r_cg",
    Cause.STILL_MISSED: "cg_from_still",
}  # fmt: skip
"""Causes that are one unknown of the joint model."""
SIGNALS: dict[Cause, Callable[[PredictedWrench], Made]] = {
    Cause.DELAY: _unknown(("delay", TYPICAL["delay"])),
    Cause.ROTATION: _unknown(("rotation", TYPICAL["load_cell_axes"])),
    Cause.CENTRE: _unknown(("r_cg", TYPICAL["centre_of_gravity"])),
    Cause.MASS: _mass,
    Cause.WEIGHT_ALONE: _weight,
    Cause.STILL_MISSED: _unknown(("cg_from_still", 0.02)),
    Cause.GYRO_SCALE: _unknown(("gyro_scale", TYPICAL["gyro_scale"])),
    Cause.GYRO_BIAS: _unknown(("gyro_drift", 0.001)),
    Cause.GYRO_AXES: lambda run: (gyro_axes(run), np.full(3, TYPICAL["gyro_axes"])),
    Cause.GYRO_LATE: _gyro_late,
    Cause.GYRO_G: _gyro_g,
    Cause.GAIN: _matrix(lambda i, j: i == j, float(np.hypot(TYPICAL["force_gain"], TYPICAL["force_gain_by_axis"]))),
    Cause.CROSS_TALK: _matrix(lambda i, j: i != j, TYPICAL["cross_talk"]),
    Cause.DRIFT: _unknown(("force_drift", 2.0), ("moment_drift", 0.05)),
    Cause.WARMING: _warming,
    Cause.JUMP: _wrench(_jump, 0.02),
    Cause.SLIP: _slip,
    Cause.GAIN_DRIFT: _wrench(_gain_drift, 0.005),
    Cause.CABLE: _wrench(_cable, 0.02),
    Cause.AIR: _wrench(_air, 0.02),
    Cause.FLEXIBLE_MOUNTING: _wrench(_flexible, 0.01),
    Cause.TENSOR: _wrench(_moving, 0.01),
    Cause.ACCELEROMETER_PLACE: lambda run: (accelerometer_place(run), np.full(3, TYPICAL["accelerometer_place"])),
    Cause.ACCELEROMETER_SCALE: lambda run: (accelerometer_scale(run), np.full(3, TYPICAL["accelerometer_scale"])),
    Cause.ACCELEROMETER_LATE: _accelerometer_late,
    Cause.CLOCK: _clock,
    Cause.FILTER: _wrench(_late, 0.02),
    Cause.NONLINEARITY: _wrench(lambda run: _on_axes(run.wrench**2, slice(0, 6)), 0.005),
}
"""Functions that make the signals of each cause, for coefficients in SI, and their typical sizes."""
OF_A_RUN = frozenset(
    {Cause.GYRO_BIAS, Cause.DRIFT, Cause.WARMING, Cause.JUMP, Cause.SLIP, Cause.GAIN_DRIFT, Cause.CABLE,
     Cause.TENSOR, Cause.CLOCK}
)  # fmt: skip
"""Causes that belong to a run and are judged in it; all others belong to the rig and have one value in all runs."""
IN_FLIGHT = frozenset({Cause.CENTRE, Cause.SLIP, Cause.CABLE, Cause.FLEXIBLE_MOUNTING})
"""Causes that need a mounting, or weight: no body in free flight has them."""
OF_A_ZERO = frozenset({Cause.DRIFT, Cause.WARMING, Cause.JUMP})
"""Causes that need a load cell's zero."""


CHANCE = 1e-4
"""Chance that residuals follow one cause by accident, above which nothing is reported.

Chance: as computed, some 27 causes together reach it in one clean run of 400. ``LIKELY`` is stricter: 40 clean runs
reach 6e-6 (``tests.helpers.judge_margins``).
"""
LIKELY = 3.0
"""Logarithm of the Bayes factor from which a cause is more probable than none, or than another.

Definition: odds of twenty to one, strong evidence by Kass and Raftery (doi:10.1080/01621459.1995.10476572). In 40 clean
runs at most 1.1, in the middle −1.7 (``tests.helpers.judge_margins``).
"""
UNLIKE = 1e-3
"""Chance that a run departs from the value that all runs share, over all runs, below which they do not share one.

Chance: one false alarm in a thousand causes that are there.
"""
IMPOSSIBLE = 1e-5
"""Probability under its prior of a cause as large as it seems, below which it is not that cause.

Prior: some 300 typical sizes: gains that are off by the whole, a gyro turned by a radian.
"""
FREE = 100.0
"""Factor on a named cause's prior size when the rest is judged, so that the prior holds nothing back.

Choice: any at which the prior hardly counts; what it holds back would count as unexplained.
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


class PossibleCause(NamedTuple):
    """A cause in the runs that would have it."""

    finding: Cause
    run: int | None
    """Index of the run to which it belongs; None: it belongs to the rig, and all runs have it."""
    size: Float[np.ndarray, " p"]
    """Typical size of each coefficient, in SI."""
    columns: list[np.ndarray]
    """Change of the measured wrench of each run by a unit of each coefficient, (n, 6, p)."""
    lines: list[np.ndarray]
    """Lines of the cause in each run, for coefficients in typical sizes, (m, rows, p); zeros where a run has none."""

    def judged(self, base: Base, *, white: bool = False) -> Evidence | None:
        """Return what the residuals say of it; ``white``: all lines are in units of their noise."""
        if self.run is None:
            return evidence(base, self.finding, self.size, self.lines, white=white)
        run_base = base.single_runs[self.run]
        verdict = evidence(run_base, self.finding, self.size, [self.lines[self.run]], white=white)
        return None if verdict is None else verdict._replace(lines=self.lines)

    def weighted(self, noise: Sequence[np.ndarray]) -> "PossibleCause":
        """Return it with each line in units of its noise, whose standard deviation is given."""
        return self._replace(lines=[part / deviation for part, deviation in zip(self.lines, noise, strict=True)])

    def agrees(self, base: Base, verdict: Evidence) -> bool:
        """Return whether the runs agree on its value."""
        if self.run is not None or len(base.runs) == 1:
            return True
        common = base.absorbing(verdict.lines, verdict.scale)
        further = [
            evidence(common.single_runs[k], self.finding, self.size, [part]) for k, part in enumerate(self.lines)
        ]
        return min([more.chance for more in further if more is not None], default=1.0) * len(further) > UNLIKE


def candidates(fits: Sequence[RunFit], excluded: frozenset[Cause]) -> list[PossibleCause]:
    """Return the causes to look for.

    Args:
        fits: of the runs, at their best.
        excluded: causes that cannot be, or that are no news.
    """
    made: list[PossibleCause] = []
    for finding, make in SIGNALS.items():
        if finding not in excluded:
            parts = [make(fit.prediction) for fit in fits]
            owners: Iterable[int | None] = range(len(fits)) if finding in OF_A_RUN else [None]
            made += [_candidate(finding, owner, fits, parts) for owner in owners]
    return [candidate for candidate in made if len(candidate.size)]


def _candidate(finding: Cause, run: int | None, fits: Sequence[RunFit], parts: Sequence[Made]) -> PossibleCause:
    """A cause without the coefficients that do nothing; of the rig's, with the mean of the runs' typical sizes."""
    having = parts if run is None else [parts[run]]
    size = np.mean([sizes for _, sizes in having], axis=0)
    acting = np.any([columns.any(axis=(0, 1)) for columns, _ in having], axis=0) & (size > 0)
    columns = [columns[:, :, acting] * (run in (None, k)) for k, (columns, _) in enumerate(parts)]
    lines = [fit.transformed(part * size[acting]) for fit, part in zip(fits, columns, strict=True)]
    return PossibleCause(finding, run, size[acting], columns, lines)


class FollowedCause(NamedTuple):
    """A cause that the residuals follow."""

    candidate: PossibleCause
    evidence: Evidence
    rivals: tuple[str, ...] = ()
    """Other causes that are about as probable."""

    @property
    def columns(self) -> list[np.ndarray]:
        """Change of the measured wrench of each run by a typical size of each coefficient, (n, 6, p) [N], [N·m]."""
        return [columns * self.evidence.size for columns in self.candidate.columns]

    def sentence(self, quantity: str) -> str:
        """Return what the residuals follow, and the cure.

        Args:
            quantity: words for what was measured: force and moment, or the moment alone.
        """
        finding = self.candidate.finding
        also = f"; as probable: {', '.join(self.rivals)}" if self.rivals else ""
        verb = "looks" if quantity == "the moment" else "look"
        return f"{quantity} {verb} {finding.phrase(self.evidence.values, self.evidence.spread)}{also}; {finding.cure}"


class Judgement(NamedTuple):
    """Causes that the runs' residuals follow, and the rest that none explains."""

    causes: list[FollowedCause]
    """Causes that the residuals follow, the most probable first."""
    implausible: FollowedCause | None
    """The most probable of the causes on which the runs disagree, or whose size cannot be; None: there is none."""
    explained: list[float]
    """Part of each run's residuals' squares that these explain together."""
    unexplained: list[float]
    """Root mean square of what no cause explains, in the motion's band over that above it, on the worst row, by run."""
    rows: list[int]
    """Row of each run in which ``unexplained`` is largest, counted from the last: force from −6, moment from −3."""


def _simplest(likely: Sequence[FollowedCause]) -> FollowedCause:
    """The most probable cause, or a simpler one that explains nearly as much: many coefficients imitate a few.

    A simpler variant of the same finding gives way: what it leaves would count as unexplained.
    """
    best = likely[0].evidence
    simpler = [
        cause for cause in likely
        if len(cause.evidence.size) < len(best.size) and cause.evidence.share > NEARLY * best.share
    ]  # fmt: skip
    variant = bool(simpler) and simpler[0].candidate.finding.label == likely[0].candidate.finding.label
    return simpler[0] if simpler and not variant else likely[0]


def _shown(base: Base, open_to: Sequence[PossibleCause]) -> list[FollowedCause]:
    """The causes that the residuals show, the most probable first.

    Each is looked for in the noise that it would leave. Those that show are compared in one noise, the least: else a
    cause that follows the noise would make itself more probable.
    """
    judged = [FollowedCause(cause, verdict) for cause in open_to if (verdict := cause.judged(base)) is not None]

    def shown(cause: FollowedCause) -> bool:
        tries = 1 if cause.candidate.run is None else len(base.runs)  # a run's cause has as many chances
        enough = cause.evidence.logarithm - np.log(tries) > LIKELY
        return bool(enough and cause.evidence.chance * tries < CHANCE)

    causes = list(filter(shown, judged))
    if len(causes) > 1:
        most = max(causes, key=lambda cause: cause.evidence.power).evidence
        noise = base.absorbing(most.lines, most.scale).noise
        weighted = base.weighted(noise)
        again = [cause.candidate.weighted(noise).judged(weighted, white=True) for cause in causes]
        causes = [
            cause._replace(evidence=cause.evidence.with_odds(verdict))
            for cause, verdict in zip(causes, again, strict=True) if verdict is not None
        ]  # fmt: skip
    return sorted(causes, key=lambda cause: -cause.evidence.logarithm)


def _as_probable(cause: FollowedCause, best: FollowedCause) -> bool:
    """Whether a cause is a rival of the best: as likely, or worse by its prior alone."""
    rival, first = cause.evidence, best.evidence
    by_prior_alone = len(rival.size) <= len(first.size) and rival.share >= first.share
    return by_prior_alone or abs(first.logarithm - rival.logarithm) < LIKELY


def followed(fits: Sequence[RunFit], excluded: frozenset[Cause], base: Base) -> Judgement:
    """Return the causes that the residuals of all runs follow, and how much more than noise they leave in each.

    Args:
        fits: of the runs, each at its best.
        excluded: causes that cannot be, or that are no news.
        base: the fitted unknowns of all runs, and what else is declared.
    """
    open_to, started, free = candidates(fits, excluded), base, base
    named: list[FollowedCause] = []
    implausible, first = None, 0.0
    while len(named) < MOST + len(fits) - 1:
        shown = _shown(base, open_to)
        likely = [
            cause for cause in shown
            if cause.evidence.predicted > IMPOSSIBLE and cause.candidate.agrees(base, cause.evidence)
        ]  # fmt: skip
        others = [cause for cause in shown if cause not in likely]
        if others and (not likely or others[0].evidence.logarithm > likely[0].evidence.logarithm + LIKELY):
            implausible = others[0]
            break
        if not likely:
            break
        best = _simplest(likely)
        power = float(
            np.square(base.together(base.beside(best.evidence.lines).remaining) @ best.evidence.coefficients).sum()
        )
        if named and power < ECHO * first:
            break
        first = first or power
        rivals = dict.fromkeys(
            cause.candidate.finding.label for cause in shown
            if cause.candidate.finding.label != best.candidate.finding.label and _as_probable(cause, best)
        )  # fmt: skip
        named.append(best._replace(rivals=tuple(rivals)))
        base = base.absorbing(best.evidence.lines, best.evidence.scale)
        free = free.absorbing(best.evidence.lines, FREE * best.evidence.scale)
        taken = best.candidate.finding, best.candidate.run
        open_to = [cause for cause in open_to if (cause.finding, cause.run) != taken]
    rest = [_left_over(fit, residuals) for fit, residuals in zip(fits, free.residuals, strict=True)]
    squares = [[float((rows**2).sum()) for rows in fitted.residuals] for fitted in (base, started)]
    return Judgement(
        named, implausible, explained=[1 - after / max(before, 1e-300) for after, before in zip(*squares, strict=True)],
        unexplained=[ratio for ratio, _ in rest], rows=[row for _, row in rest],
    )  # fmt: skip


def _left_over(fit: RunFit, residuals: Float[np.ndarray, "m rows"]) -> tuple[float, int]:
    """Root mean square of residuals in the motion's band over that above it, on the worst row, and that row."""
    above = fit.lines.above(fit.prediction.counted(fit.prediction.residuals[:, :, None])[:, :, 0])
    ratio = np.sqrt(np.mean(residuals**2, axis=0) / np.maximum(np.mean(above**2, axis=0), 1e-300))
    return float(ratio.max()), int(np.argmax(ratio)) - len(ratio)
