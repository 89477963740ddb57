"""The wrench went through a low-pass that the motion did not.

## What it looks like

Force and moment lag behind the motion and are weaker the faster it is. (A lag of some milliseconds alone, of a filter
far above the motion, is the cause of this name, with a size.)

## Why it matters

A delay makes up for a part of it. Mass and tensor come out too small, by 7 % and more at a corner of 3 Hz.

## How it is decided

The mean of a filter's response shows in the force's slope, the spread of its response in its curvature:
`F + c₁ Ḟ + c₂ F̈` is what the body does. A delay d and a first-order low-pass of the time constant τ have
`c₁ = d + τ`, `c₂ = d τ + d²/2`, so `τ² = c₁² − 2 c₂`; it is 0 of any delay. With τ the force must be explained far
better than with a delay alone.

A motion far below the corner shows only the mean of the response. A lag that explains what looked like a small turn
of the axes, or that the `sigma_delay` declared of method `joint` does not let expect, is named with its two
explanations: stamps that are late, and a low-pass of that time constant.

## What to do

Set `wrench_lowpass` in `[recording]`, the corner: the filter is then undone before anything else. Better record the
wrench as it comes, or through a filter far above the motion. Of a lag with two explanations, the settings of the load
cell and its driver tell which; with the wrong one mass and tensor err by what the message says.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from identify.display.rounding import fixed, significant
from identify.judge.conventions.axis_hypotheses import DECISIVE
from identify.judge.conventions.convention_fit import (
    LEAST_SECONDS,
    SMOOTHING,
    STEP,
    WINDOW,
    ImuSignal,
    WrenchSignal,
    smoothed,
)
from identify.judge.conventions.posed_force import (
    LONGEST_LAG,
    GravityFit,
    PosedForce,
    PosedMotion,
    at_instants,
    lever_columns,
)
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding

STEPS = 3
"""Linear steps to delay and time constant.

Numerical: the second is good to a hundredth.
"""
LEAST_MISFIT = 0.003
"""Part of the force's changes that a fit leaves at least.

Choice: a third of what a rigid body may, since both fits have the same body. In 90 clean runs the chi-square is at most
1.3; at 3 Hz, of a motion up to 0.35 Hz, at least 450.
"""
CERTAIN = 5.0
"""Time constant over its standard uncertainty from which it is named.

Chance: 3e-7 of a normal error.
"""


class WrenchLowPassed(Finding):
    """A wrench behind a low-pass."""

    time_constant: float
    """Time constant of the filter, of first order [s]."""
    sigma: float
    """Standard uncertainty of the time constant [s]."""

    @property
    def _corner(self) -> float:
        """Frequency at which half the power passes [Hz]."""
        return float(1 / (2 * np.pi * self.time_constant))

    @property
    def looks(self) -> str:
        spread = significant(self._corner * self.sigma / self.time_constant, 1)
        corner = significant(self._corner, 3)
        return (
            f"the force is that of a low-pass of first order at {corner} ± {spread} Hz, which the motion did not pass"
        )

    @property
    def cure(self) -> Cure:
        corner = Entries({"wrench_lowpass": f"{significant(self._corner, 4)} Hz"})
        return Cure(choices=[corner], then=", or record the wrench before its filter")


class LateSensor(Finding):
    """A wrench that lags behind the motion, or the motion behind the wrench, by a delay or by a low-pass."""

    lag: float
    """Time by which the wrench lags; negative: the motion does [s]."""
    sigma: float
    """Standard uncertainty of the lag [s]."""
    weakened: float
    """Part of the force's and moment's changes that a low-pass of this lag takes."""
    declared: float = 0.0
    """Delay of the IMU that is declared already [s]."""

    @property
    def looks(self) -> str:
        first, second = ("force", "motion") if self.lag > 0 else ("motion", "force")
        lag = f"{fixed(1e3 * abs(self.lag), 1)} ± {significant(1e3 * self.sigma, 1)} ms"
        return (
            f"the {first} lags behind the {second} by {lag}: its stamps are late, or it passed a low-pass, which so "
            "slow a motion does not tell apart"
        )

    @property
    def cure(self) -> Cure:
        delayed = Entries(
            {"delay": f"{self.declared - self.lag:.4f} s"}, remark=" (of method joint) if its stamps are late"
        )
        change = f"mass and tensor are then {'larger' if self.lag > 0 else 'smaller'} by about {self._percent} %"
        corner = Entries(
            {"wrench_lowpass": f"{significant(1 / (2 * np.pi * abs(self.lag)), 3)} Hz"},
            remark=f" if it is filtered ({change})",
        )
        unfiltered = f"record it before its filter ({change})"
        decides = "; the settings of sensor and driver, or a faster motion, decide"
        return Cure(choices=[delayed, corner if self.lag > 0 else unfiltered], then=decides)

    @property
    def _percent(self) -> str:
        return significant(100 * self.weakened, 1)


EXAMPLES = (
    WrenchLowPassed(topic="/wrench", time_constant=0.0531, sigma=0.0001),
    LateSensor(topic="/wrench", lag=0.0324, sigma=0.0004, weakened=0.0008),
)


def filter_findings(wrench: WrenchSignal, imu: ImuSignal, topic: str) -> Iterator[Finding]:
    """Yield the finding on a wrench behind a low-pass.

    Args:
        wrench: of the run, in B.
        imu: the same, with the specific force.
        topic: of the load cell.
    """
    posed = _posed(wrench, imu)
    if posed is None:
        return
    filtered, time_constant, sigma = _with_filter(posed, imu.time)
    if not (time_constant > CERTAIN * sigma and posed.explained(filtered)):
        return
    delayed = posed.in_time(apart=False)[0].fit(lift=False)
    if posed.excess(delayed, filtered, least=LEAST_MISFIT) > DECISIVE:
        yield WrenchLowPassed(topic=topic, time_constant=time_constant, sigma=sigma)


def late_sensor(wrench: WrenchSignal, imu: ImuSignal, topic: str) -> LateSensor | None:
    """Return the finding on wrench or motion that is late against the other, by a delay or a low-pass; None: no.

    Args:
        wrench: of the run, in B.
        imu: the same, with the specific force.
        topic: of the load cell.
    """
    posed = _posed(wrench, imu)
    if posed is None:
        return None
    lag, later = 0.0, posed
    for _ in range(STEPS):
        fit = _lagging(later, imu.time, 1)
        lag = float(np.clip(lag + fit.values[posed.slopes_at], -LONGEST_LAG, LONGEST_LAG))
        later = _earlier(posed, imu.time, lag)
    fit, place = _lagging(later, imu.time, 1), posed.slopes_at
    sigma = float(np.sqrt(fit.covariance[place, place]))
    if not posed.explained(fit) or abs(lag) < CERTAIN * sigma:
        return None
    signals = np.gradient(imu.angular_velocity, imu.time, axis=0), imu.angular_velocity
    changes = (posed.motion.smooth(signal).std() for signal in signals)
    turning = float(np.divide(*changes))  # angular frequency of the motion [rad/s]
    return LateSensor(topic=topic, lag=lag, sigma=sigma, weakened=0.5 * (turning * lag) ** 2)


def _posed(wrench: WrenchSignal, imu: ImuSignal) -> PosedForce | None:
    """The force beside the motion; None: there is too little to judge."""
    time, omega, specific = imu
    step = float(np.median(np.diff(time)))
    judged = 0 < step <= SMOOTHING and time[-1] - time[0] >= LEAST_SECONDS
    if not judged or not np.isfinite(np.hstack([omega, specific])).all():
        return None
    motion = PosedMotion(
        to_rest=np.broadcast_to(np.eye(3), (len(time), 3, 3)), specific=specific, levers=lever_columns(time, omega),
        time=time, smooth=partial(smoothed, step), independent=STEP / WINDOW,
    )  # fmt: skip
    posed = PosedForce(at_instants(time, wrench.time, wrench.force), motion)
    return posed if posed.changes > 0 else None


def _earlier(posed: PosedForce, time: np.ndarray, lag: float) -> PosedForce:
    """The force so much earlier."""
    return replace(posed, force=at_instants(time + lag, time, posed.force))


def _lagging(posed: PosedForce, time: np.ndarray, orders: int) -> GravityFit:
    """The fit with as many derivatives of the force as columns."""
    slopes = [posed.force]
    for _ in range(orders):
        slopes.append(np.gradient(slopes[-1], time, axis=0))
    return posed.fit(lift=False, slopes=[-slope for slope in slopes[1:]])


def _with_filter(posed: PosedForce, time: np.ndarray) -> tuple[GravityFit, float, float]:
    """Return the fit behind a delay and a low-pass, its time constant, and the standard uncertainty of that [s]."""
    at, delay, later = posed.slopes_at, 0.0, posed
    for _ in range(STEPS):
        mean, half_square = _lagging(later, time, 2).values[at : at + 2]
        spread = np.sqrt(max(mean**2 - 2 * half_square, 0.0))
        delay = float(np.clip(delay + mean - spread, -LONGEST_LAG, LONGEST_LAG))
        later = _earlier(posed, time, delay)
    fit = _lagging(later, time, 1)
    return fit, float(fit.values[at]), float(np.sqrt(fit.covariance[at, at]))
