"""The best joint motion of an arm: designed, beside a D-optimal one and what common practice reaches.

Common practice under the same limits in the same time: one joint at a time, random Fourier series.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.optimiser import minimise
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.arm_limits import ArmLimits
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.arm.joint_search import GRID, Candidate, Goal, JointSearch, periods
from uq.plan.motion_design.arm.largest_motion import enlarged, largest_size
from uq.plan.motion_design.arm.mujoco_model import loaded_model
from uq.plan.motion_design.arm.predicted_payload import WrenchNoise, by_undeclared, declared_noise, promised
from uq.plan.motion_design.design_goal import GOALS, goal_of
from uq.plan.motion_design.search import check_options, optima
from uq.progress_bar import Progress, progress_of

DURATION, PERIOD, RAMP, RANDOM = 60.0, 5.0, 2.0, 20
"""Least times of the run, of its repeats and of starting and stopping [s], and the number of random series that are
tried."""
ROUNDS, STEPS = 7, 80
"""Rounds of the minimisation from each start, and the most steps in each round."""
HEAVY = 3e4
"""Largest penalty of these: it meets limits within a per cent or two; a heavier one hinders the steps."""
DETERMINANT = "determinant"
"""The goal of a D-optimal design: the least determinant of the covariance of all ten parameters."""
ARM_GOALS = (*GOALS, DETERMINANT)
CLOSER, CYCLES = 2, 2
"""Factor by which the grid of the final searches is finer, and the number of these searches."""
RELAXED: dict[str, Any] = {"rounds": 5, "penalty": 1e3, "growth": 5.0, "heaviest": 3e5}
"""Settings of a minimisation whose limits yield at first, so that it can leave a poor motion, and hold closely in the
end."""


@dataclass(frozen=True, eq=False)
class ArmDesign:
    """A designed joint motion and what stands beside it."""

    experiment: Experiment
    limits: ArmLimits
    noise: WrenchNoise
    goal: str
    motions: dict[str, Candidate]
    """Motions by name: ``designed``; ``random``, the best of several random Fourier series; ``single``, one joint at a
    time."""
    duration: float
    starts: tuple[tuple[float, float], ...]
    """Outcome of each start: the goal against the best random series, and the largest excess over a limit."""

    @property
    def designed(self) -> Candidate:
        """Candidate of the designed motion."""
        return self.motions["designed"]

    @cached_property
    def with_undeclared(self) -> Candidate:
        """The designed motion, whose covariance also holds the load cell's undeclared errors at typical size."""
        t = np.linspace(0.0, self.duration, int(self.duration * GRID * self.limits.bandwidth) + 1)
        floor = by_undeclared(self.limits.tool(self.designed.series.sampled(t)), self.noise, self.experiment)
        return replace(self.designed, covariance=self.designed.covariance + floor)


def design_arm(
    experiment: Experiment,
    *,
    goal: str = "all",
    duration: float = DURATION,
    starts: int = 3,
    seed: int = 0,
    period: float = PERIOD,
    ramp: float = RAMP,
    rounds: int = ROUNDS,
    steps: int = STEPS,
    random: int = RANDOM,
    progress: Progress | None = None,
) -> ArmDesign:
    """Find the joint motion of least predicted uncertainty that an arm can run, from and to rest at home.

    A constant departure from home and the harmonics of a period up to the bandwidth, all joints at once, with the
    sensor's offsets estimated along; searched over the amplitudes under all limits at every instant, from random
    series. The determinant of the covariance is minimised first, the goal from where that ends.

    Args:
        experiment: body, sources, ``[platform] kind = "arm"`` and ``[platform.limits] bandwidth``.
        goal: ``all`` (averages of moments and of products, each against the best random series'), ``moments``,
            ``products``, ``worst`` (component), ``axis 1`` to ``axis 3`` (principal moments), or ``determinant``
            (D-optimal: of all ten parameters).
        duration: of the run [s].
        starts: random series to start from.
        seed: of the starts.
        period: that the motion repeats [s].
        ramp: least time to start and to stop [s].
        rounds: of the minimisation from each start.
        steps: in each round, at most.
        random: series of common practice of which the best is the reference.
        progress: called with what is being done, the steps done and the steps in all.

    Raises:
        ExperimentError: no arm, no noise, a limit that is missing or cannot be met, a goal or number that cannot be.
        RigError: MuJoCo is not installed.
    """
    seconds = {"duration": duration, "period": period, "ramp": ramp}
    check_options({"goal": (goal, ARM_GOALS)}, {"starts": starts, "random series": random}, seconds)
    if experiment.limits is not None and np.isfinite(experiment.limits.figures.bandwidth):
        # before meshes are read and limits compiled
        periods(experiment.limits.figures.bandwidth, duration, period, ramp)
    tell = progress_of(progress)
    arm = Arm.of(experiment)
    noise = declared_noise(experiment, arm.declared.rate)
    tell("common practice", 0, 1)
    limits = ArmLimits(experiment, arm, Clearance.of(arm))
    # before minutes of search: the motion will be simulated
    loaded_model(arm, experiment.body, experiment.gravity)
    search = JointSearch(limits, noise, duration=duration, period=period, ramp=ramp)
    reference = random_series(search, random, seed)
    single = single_joints(limits, noise, duration, ramp)
    measure = goal_function(goal, experiment, reference.covariance)
    designed, ends = searched(search, measure, starts=starts, seed=seed, rounds=rounds, steps=steps, tell=tell)
    motions = {"designed": designed, "random": reference, "single": single}
    return ArmDesign(
        experiment=experiment, limits=limits, noise=noise, goal=goal, motions=motions, duration=duration,
        starts=tuple(ends),
    )  # fmt: skip


def searched(
    search: JointSearch, measure: Goal, *, starts: int, seed: int, rounds: int, steps: int, tell: Progress
) -> tuple[Candidate, list[tuple[float, float]]]:
    """Return the best motion of several starts, and :attr:`ArmDesign.starts`; see :func:`design_arm`.

    From a random motion the determinant leads further than goals of single components: no parameter is neglected.
    """
    first = {number: search.start(1000 * seed + number) for number in range(starts)}
    lagrangian = search.lagrangian(determinant)
    ends = optima(lagrangian, first, tell, asked=starts, rounds=rounds, steps=steps, heaviest=HEAVY)
    settled = [search.settled(end.unknowns) for end in ends]
    worth = [candidate.measured_by(measure) for candidate in settled]
    best = int(np.argmin(worth))
    designed = polished(search, measure, ends[best].unknowns, settled[best], steps, tell)
    return designed, [(value, end.excess) for value, end in zip(worth, ends, strict=True)]


def polished(
    search: JointSearch, measure: Goal, unknowns: np.ndarray, candidate: Candidate, steps: int, tell: Progress
) -> Candidate:
    """Return the best of the motion that a search ended with and of its relaxed searches on a finer grid."""
    closer = search.finer(CLOSER)
    lagrangian = closer.lagrangian(measure)
    for number in range(CYCLES):
        tell("limits", number, CYCLES)
        unknowns = minimise(lagrangian, unknowns, steps=steps, **RELAXED).unknowns
        candidate = min(candidate, closer.settled(unknowns), key=lambda motion: motion.measured_by(measure))
    return candidate


def goal_function(goal: str, experiment: Experiment, reference: Float[np.ndarray, "10 10"]) -> Goal:
    """Return what is to be small of the covariance of the ten parameters: 1 at the reference's."""
    if goal == DETERMINANT:
        base = determinant(jnp.asarray(reference))
        return lambda covariance: determinant(jnp.asarray(covariance)) / base
    still = jnp.zeros(6)
    measure = goal_of(goal, np.asarray(experiment.body.inertia), reference[4:, 4:], np.zeros(6), "3sigma")

    return lambda covariance: measure(jnp.asarray(covariance)[4:, 4:], still)


def determinant(covariance: Float[Array, "10 10"]) -> Float[Array, ""]:
    """Return the geometric mean of the ten principal standard uncertainties, which is least in a D-optimal design."""
    return jnp.exp(jnp.linalg.slogdet(covariance)[1] / 20)


FREQUENCIES = 4
"""Frequencies of the swing that are tried: the bandwidth and its halves."""
SWING = 40
"""Instants at which one swing is looked at."""


def best(candidates: list[Candidate]) -> Candidate:
    """Return the candidate of the least product of the average 3σ of moments and of products."""
    return min(candidates, key=lambda motion: float(np.prod(list(motion.averages.values()))))


def random_series(search: JointSearch, count: int, seed: int = 0) -> Candidate:
    """Return the best of several random Fourier series, each joint as large as the limits allow."""
    return best([search.settled(search.random(1000 * seed + number)) for number in range(count)])


def single_joints(limits: ArmLimits, noise: WrenchNoise, duration: float, ramp: float) -> Candidate:
    """Return the best motion of one joint after the other, each a sine as large as its limits allow."""
    return best(
        [_single(limits, noise, duration, ramp, limits.bandwidth / 2**halvings) for halvings in range(FREQUENCIES)]
    )


def _single(limits: ArmLimits, noise: WrenchNoise, duration: float, ramp: float, frequency: float) -> Candidate:
    arm, n = limits.arm, limits.arm.count
    sizes = enlarged(limits, _swings(limits, 2 * np.pi * frequency))
    borders = np.linspace(0.0, duration, n + 1)

    def of_size(size: float) -> JointSeries:
        sine = size * np.diag(sizes)
        times = borders[:-1], borders[1:]
        return JointSeries(
            arm.home, np.full(n, frequency), np.zeros((n, n)), sine, *times, np.array(min(ramp, duration / n / 2))
        )

    count = int(np.ceil(duration * GRID * limits.bandwidth))
    t = (np.arange(count) + 0.5) * duration / count
    size, peaks = largest_size(limits, of_size, t)
    samples = np.full(count, arm.declared.rate * duration / count)
    covariance = promised(limits.tool(of_size(size).sampled(t)), samples, noise, limits.body)
    return Candidate(of_size(size), covariance, tuple(peaks))


def _swings(limits: ArmLimits, angular: float) -> JointStates:
    """One swing of each joint after the other, of 1 rad or 1 m."""
    phase = 2 * np.pi * np.arange(SWING) / SWING
    unit = np.eye(limits.arm.count)
    waves = (np.sin(phase), angular * np.cos(phase), -(angular**2) * np.sin(phase))
    position, speed, acceleration = (np.concatenate([wave[:, None] * row[None] for row in unit]) for wave in waves)
    return JointStates(position + limits.arm.home[None], speed, acceleration)
