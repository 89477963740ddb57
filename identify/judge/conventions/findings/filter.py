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

## What to do

Set `wrench_lowpass` in `[recording]`, the corner: the filter is then undone before anything else. Better record the
wrench as it comes, or through a filter far above the motion.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from identify.display.rounding import significant
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
from identify.judge.conventions.posed_force import LONGEST_LAG, ZERO, GravityFit, PosedForce, at_instants, lever_columns
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


EXAMPLES = (WrenchLowPassed(topic="/wrench", time_constant=0.0531, sigma=0.0001),)


def filter_findings(wrench: WrenchSignal, imu: ImuSignal, topic: str) -> Iterator[Finding]:
    """Yield the finding on a wrench behind a low-pass.

    Args:
        wrench: of the run, in B.
        imu: the same, with the specific force.
        topic: of the load cell.
    """
    time, omega, specific = imu
    step = float(np.median(np.diff(time)))
    judged = 0 < step <= SMOOTHING and time[-1] - time[0] >= LEAST_SECONDS
    if not judged or not np.isfinite(np.hstack([omega, specific])).all():
        return
    levers = lever_columns(time, omega)
    posed = PosedForce(
        force=at_instants(time, wrench.time, wrench.force),
        to_rest=np.broadcast_to(np.eye(3), (len(time), 3, 3)), specific=specific, levers=levers, time=time,
        smooth=partial(smoothed, step), independent=STEP / WINDOW,
    )  # fmt: skip
    if posed.changes <= 0:
        return
    delayed = posed.in_time(apart=False)[0].fit(lift=False)
    filtered, time_constant, sigma = _with_filter(posed, time)
    if not posed.explained(filtered) or posed.excess(delayed, filtered, least=LEAST_MISFIT) <= DECISIVE:
        return
    if time_constant > CERTAIN * sigma:
        yield WrenchLowPassed(topic=topic, time_constant=time_constant, sigma=sigma)


def _with_filter(posed: PosedForce, time: np.ndarray) -> tuple[GravityFit, float, float]:
    """Return the fit behind a delay and a low-pass, its time constant, and the standard uncertainty of that [s]."""
    levers, delay, later = posed.levers, 0.0, posed
    assert levers is not None  # noqa: S101 - of a run they are known
    at = ZERO.stop + levers.shape[2]

    def lagging(orders: int) -> GravityFit:
        slopes = [later.force]
        for _ in range(orders):
            slopes.append(np.gradient(slopes[-1], time, axis=0))
        columns = np.concatenate([levers, *(-slope[:, :, None] for slope in slopes[1:])], axis=2)
        return replace(later, levers=columns).fit(lift=False)

    for _ in range(STEPS):
        mean, half_square = lagging(2).values[at : at + 2]
        spread = np.sqrt(max(mean**2 - 2 * half_square, 0.0))
        delay = float(np.clip(delay + mean - spread, -LONGEST_LAG, LONGEST_LAG))
        later = replace(posed, force=np.stack([np.interp(time + delay, time, x) for x in posed.force.T], axis=1))
    fit = lagging(1)
    return fit, float(fit.values[at]), float(np.sqrt(fit.covariance[at, at]))
