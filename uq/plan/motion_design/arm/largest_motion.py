"""The largest size of a joint motion that meets all limits and touches nothing."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Float

from identify.motion.limit_peaks import Peak
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm_limits import ArmLimits
from uq.plan.motion_design.search import bisected

HALVINGS, COARSE, CLOSE = 12, 5, 4
"""Bisections of the interval that holds a motion's largest size, a single joint's, and the size between two of
``NEAR``."""
NEAR = (0.9995, 0.999, 0.998, 0.996, 0.993, 0.99, 0.985, 0.98, 0.97, 0.96, 0.94, 0.92, 0.9)
"""Sizes that are looked at first."""
LOOKS, SMALLER = 20, 0.95
"""Most reductions of a motion that touches something, and the factor of each."""


def largest_size(
    limits: ArmLimits, motion_at: Callable[[float], JointSeries], t: Float[np.ndarray, " t"]
) -> tuple[float, list[Peak]]:
    """Return the largest size, 1 at most, at which a motion meets all limits and touches nothing; and its peaks.

    Shapes are looked at on every other instant: between two of them nothing moves by as much as the clearance.

    Args:
        limits: to be met.
        motion_at: the motion at a size; at zero it rests at home.
        t: instants that are looked at [s].

    Raises:
        ExperimentError: no size does; the limit, the joint and the instant are named.
    """
    met = lambda size: limits.peaks_of(motion_at(size), t)[0].share <= 1  # noqa: E731
    size, worst, most_used = 1.0, "", limits.peaks_of(motion_at(1.0), t)[0]
    if most_used.share > 1:
        worst = str(most_used)
        # what keeps links apart at one size need not at a smaller one: sizes near the full one come first
        near = next((k for k, size in enumerate(NEAR) if met(size)), None)
        size = bisected(met, HALVINGS) if near is None else bisected(met, CLOSE, NEAR[near], (1.0, *NEAR)[near])
    for _ in range(LOOKS):
        if size == 0:
            break
        touch = next(limits.clearance.touches(np.asarray(motion_at(size).sampled(t[::2]).position)), None)
        if touch is None:
            return size, limits.peaks_of(motion_at(size), t)
        worst = f"{touch.first} is too close to {touch.second} at {t[2 * touch.instant]:.3f} s"
        size *= SMALLER
    raise ExperimentError(f"no size of the motion meets its limits: {worst}")


def enlarged(limits: ArmLimits, states: JointStates) -> Float[np.ndarray, " n"]:
    """Return how many times each joint may depart from home as it does, the last joint first, the others as they are.

    Every joint fills what its own range, speed and acceleration leave, as far as efforts, load cell and clearance allow
    it at the given instants.
    """
    arm = limits.arm
    departure = states.position - arm.home[None]
    half_range = np.stack([arm.position[:, 1] - arm.home, arm.home - arm.position[:, 0]]).min(axis=0)
    used = np.abs(departure).max(axis=0) / np.maximum(half_range, 1e-6)
    for values, most in ((states.speed, arm.speed), (states.acceleration, arm.acceleration)):
        used = np.maximum(used, np.abs(values).max(axis=0) / most)
    full, sizes = 1 / np.maximum(used, 1e-12), np.zeros(arm.count)

    def meets(joint: int, size: float) -> bool:
        factor = sizes.copy()
        factor[joint] = size * full[joint]
        position = departure * factor[None] + arm.home[None]
        scaled = (position, states.speed * factor[None], states.acceleration * factor[None])
        return limits.peaks(JointStates(*scaled), np.zeros(len(departure)))[0].share <= 1 + 1e-9

    for joint in reversed(range(arm.count)):
        size = 1.0 if meets(joint, 1.0) else bisected(partial(meets, joint), COARSE)
        sizes[joint] = size * full[joint]
    return sizes
