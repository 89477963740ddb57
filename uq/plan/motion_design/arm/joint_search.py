"""The search for the joint motion of least predicted uncertainty: Fourier amplitudes under all limits.

A motion is a constant departure from home and the harmonics of one period up to the bandwidth, between two ramps that
last whole periods less the repeats: so ramp, one period and ramp show every state of the whole run, and the search
looks at these alone. Joints are linear in the amplitudes; goal and limits are functions of JAX with exact gradients.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.limit_peaks import Peak
from identify.motion.optimiser import Lagrangian
from identify.motion.serial_arm.joint_series import JointSeries, bases, combined
from uq.files.mistakes import ExperimentError
from uq.plan.measurement.required_duration import average
from uq.plan.measurement.sensor_worth import BOTH
from uq.plan.motion_design.arm.arm_limits import ArmLimits
from uq.plan.motion_design.arm.largest_motion import enlarged, largest_size
from uq.plan.motion_design.arm.predicted_payload import WrenchNoise, promised, ten_parameters

GRID = 10
"""Instants of the search in a period of the highest frequency; the limits are checked on a grid ten times finer."""
SPARE = {"clearance": 0.1}
"""Share of a limit that the search leaves for what happens between its instants, where a smaller size mends little."""
FINER = 10
HARMONICS = 5
"""Harmonics of a random Fourier series, as in Swevers et al., IEEE Trans. Robot. Autom. 13 (1997) 730,
doi:10.1109/70.631234."""
Goal = Callable[[Float[Array, "10 10"]], Float[Array, ""]]
"""Function of the covariance of the ten parameters that the search makes small."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A motion that meets all limits, and what it promises."""

    series: JointSeries
    covariance: Float[np.ndarray, "10 10"]
    """Covariance of mass, r_CG from Q and tensor about the centre of gravity; SI units."""
    peaks: tuple[Peak, ...]
    """Each limit's largest use over the whole run, largest first."""

    @property
    def expanded(self) -> Float[np.ndarray, "10"]:
        """3σ of these parameters, in SI units."""
        return 3 * np.sqrt(np.diag(self.covariance))

    @property
    def averages(self) -> dict[str, float]:
        """Average 3σ of moments and of products [kg·m²]."""
        return {goal: average(self.expanded[4:], goal) for goal in BOTH}

    def measured_by(self, goal: Goal) -> float:
        """Return what is to be small."""
        return float(goal(jnp.asarray(self.covariance)))


def periods(bandwidth: float, duration: float, period: float, ramp: float) -> int:
    """Return how often a motion repeats between its ramps; bandwidth in Hz, times in seconds.

    Raises:
        ExperimentError: not once, or the period is shorter than that of the bandwidth.
    """
    repeats = int((duration - 2 * ramp) / period + 1e-9)
    if repeats < 1 or period * bandwidth < 1:
        least, longest = 1 / bandwidth, duration - 2 * ramp
        shorter = f"state a period of {least:.3g} to {longest:.3g} s, or " if least <= longest else ""
        raise ExperimentError(
            f"no room for a period of {period:g} s in {duration:g} s with two ramps of {ramp:g} s, up to "
            f"{bandwidth:g} Hz: {shorter}measure for {max(period, least) + 2 * ramp:g} s or longer"
        )
    return repeats


class JointSearch:
    """Motions of one kind on one arm: for the design, for its D-optimal rival, and for random series."""

    def __init__(
        self, limits: ArmLimits, noise: WrenchNoise, *, duration: float, period: float, ramp: float, grid: int = GRID
    ):
        """Prepare the harmonics.

        Args:
            limits: of arm, load cell and payload.
            noise: of force and moment.
            duration: of the run [s].
            period: that the motion repeats, about [s].
            ramp: the least time to start and to stop [s].
            grid: instants of the search in a period of the highest frequency.
        """
        repeats = periods(limits.bandwidth, duration, period, ramp)
        self.limits, self.noise, self.duration, self.repeats = limits, noise, duration, repeats
        self.period, self.least_ramp = period, ramp
        self.ramp = (duration - repeats * period) / 2
        arm, frequency = limits.arm, np.arange(int(period * limits.bandwidth + 1e-9) + 1) / period
        self.frequency = frequency
        angular = 2 * np.pi * np.maximum(frequency, 0.5 / period)[None]
        reach = np.minimum(arm.half, np.pi)[:, None]
        self.unit = np.minimum(np.minimum(arm.acceleration[:, None] / angular**2, arm.speed[:, None] / angular), reach)
        self.t, self.samples = self._grid(grid)
        self.basis = bases(self.series(np.zeros(self.count), short=True), jnp.asarray(self.t))

    @property
    def count(self) -> int:
        """Number of unknowns that describe a motion."""
        return 2 * self.limits.arm.count * len(self.frequency)

    def series(self, unknowns: Float[np.ndarray, " u"], *, short: bool = False) -> JointSeries:
        """Return the motion of some unknowns; ``short``: with one period between its ramps."""
        cosine, sine = np.asarray(unknowns).reshape(2, *self.unit.shape) * self.unit[None]
        end = 2 * self.ramp + self.period * (1 if short else self.repeats)
        times = (np.zeros(len(self.frequency)), np.full(len(self.frequency), end))
        return JointSeries(self.limits.arm.home, self.frequency, cosine, sine, *times, np.array(self.ramp))

    def _grid(self, finer: int) -> tuple[np.ndarray, np.ndarray]:
        """Instants of ramp, period and ramp, at the middle of equal steps, and how many samples each stands for."""
        last = 2 * self.ramp + self.period
        count = int(np.ceil(last * finer * self.limits.bandwidth))
        t = (np.arange(count) + 0.5) * last / count
        repeated = (t > self.ramp) & (t < self.ramp + self.period)
        repeats = np.where(repeated, self.repeats, 1.0)
        return t, repeats * self.limits.arm.declared.rate * self.duration / repeats.sum()

    def lagrangian(self, goal: Goal) -> Lagrangian:
        """Return a goal under all limits, ready to be minimised."""
        limits, home = self.limits, jnp.asarray(self.limits.arm.home)
        noise, samples = jnp.asarray(self.noise.covariance), jnp.asarray(self.samples)

        def function(unknowns: Array) -> tuple[Array, Array]:
            amplitudes = unknowns.reshape(2, *self.unit.shape) * self.unit[None]
            shares, tool = limits.looked_at(combined(self.basis, home, amplitudes))
            covariance = ten_parameters(tool, samples, noise, limits.body)
            spared = [share.ravel() + SPARE.get(name, 0.0) for name, share in shares.items()]
            return jnp.log(goal(covariance)), jnp.concatenate(spared) - 1

        return Lagrangian(function)

    def finer(self, times: int) -> "JointSearch":
        """Return the same search on a grid so many times finer."""
        same = {"duration": self.duration, "period": self.period, "ramp": self.least_ramp}
        return JointSearch(self.limits, self.noise, grid=times * GRID, **same)

    def start(self, seed: int) -> Float[np.ndarray, " u"]:
        """Return the unknowns of a random motion of all harmonics about home, from which a search may start."""
        return self._drawn(np.random.default_rng([29, seed]), np.arange(1, len(self.frequency)))

    def random(self, seed: int) -> Float[np.ndarray, " u"]:
        """Return the unknowns of a random Fourier series about home: HARMONICS of one of the design's frequencies."""
        generator = np.random.default_rng([23, seed])
        lowest = generator.integers(1, max((len(self.frequency) - 1) // HARMONICS, 1) + 1)
        return self._drawn(generator, lowest * np.arange(1, HARMONICS + 1))

    def _drawn(self, generator: np.random.Generator, orders: np.ndarray) -> Float[np.ndarray, " u"]:
        """Random amplitudes of some harmonics, every joint, the last first, as large as the limits allow."""
        drawn = generator.normal(size=(2, *self.unit.shape))
        drawn[:, :, ~np.isin(np.arange(len(self.frequency)), orders)] = 0.0
        states = self.series(drawn.ravel(), short=True).sampled(self.t[::2])
        return (drawn * enlarged(self.limits, states)[None, :, None]).ravel()

    def settled(self, unknowns: Float[np.ndarray, " u"]) -> Candidate:
        """Return the motion at the largest size that meets all limits on the finest grid.

        Raises:
            ExperimentError: no size does; the limit, the joint and the instant are named.
        """
        t, _ = self._grid(GRID * FINER)
        size, peaks = largest_size(self.limits, lambda size: self.series(size * unknowns, short=True), t)
        motion = self.limits.tool(self.series(size * unknowns, short=True).sampled(self.t))
        covariance = promised(motion, self.samples, self.noise, self.limits.body)
        return Candidate(self.series(size * unknowns), covariance, tuple(map(self._of_run, peaks)))

    def _of_run(self, peak: Peak) -> Peak:
        """A peak of the short motion at its instant of the whole run."""
        after_first_period = peak.t > self.ramp + self.period
        return peak._replace(t=peak.t + after_first_period * (self.repeats - 1) * self.period)
