"""The largest size of a joint motion that meets all limits and touches nothing."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Float

from identify.serial_arm.joint_series import JointSeries, JointStates
from uq.arm.arm_limits import ArmLimits, JointPeak
from uq.files.document import ExperimentError

HALVINGS, COARSE, CLOSE = 12, 5, 4
"""Bisections of the interval that holds a motion's largest size, a single joint's, and the size between two of
``NEAR``."""
NEAR = (0.9995, 0.999, 0.998, 0.996, 0.993, 0.99, 0.985, 0.98, 0.97, 0.96, 0.94, 0.92, 0.9)
"""Sizes that are looked at first."""
LOOKS, SMALLER = 20, 0.95
"""Most reductions of a motion that touches something, and the factor of each."""


def largest_size(
    limits: ArmLimits, of_size: Callable[[float], JointSeries], t: Float[np.ndarray, " t"]
) -> tuple[float, list[JointPeak]]:
    """Return the largest size, 1 at most, at which a motion meets all limits and touches nothing; and its peaks.

    Shapes are looked at on every other instant: between two of them nothing moves by as much as the clearance.

    Args:
        limits: to be met.
        of_size: the motion at a size; at zero it rests at home.
        t: instants that are looked at [s].

    Raises:
        ExperimentError: no size does; the limit, the joint and the instant are named.
    """
    size, worst = 1.0, str(peaks[0]) if (peaks := limits.peaks_of(of_size(1.0), t))[0].share > 1 else ""
    met = lambda size: limits.peaks_of(of_size(size), t)[0].share <= 1  # noqa: E731
    if worst:  # what keeps links apart at one size need not at a smaller one: sizes near the full one come first
        near = next((k for k, each in enumerate(NEAR) if met(each)), None)
        size = _bisected(met, HALVINGS) if near is None else _bisected(met, CLOSE, NEAR[near], (1.0, *NEAR)[near])
    for _ in range(LOOKS):
        if size == 0:
            break
        touch = next(limits.clearance.touches(np.asarray(of_size(size).states(t[::2]).position)), None)
        if touch is None:
            return size, limits.peaks_of(of_size(size), t)
        worst = f"{touch.first} is too near to {touch.second} at {t[2 * touch.instant]:.3f} s"
        size *= SMALLER
    raise ExperimentError(f"no size of the motion meets its limits: {worst}")


def enlarged(limits: ArmLimits, states: JointStates) -> Float[np.ndarray, " n"]:
    """Return how many times each joint may depart from home as it does, the last joint first, the others as they are.

    Every joint fills what its own range, speed and acceleration leave, as far as efforts, load cell and clearance allow
    it at the given instants.
    """
    arm = limits.arm
    departure = states.position - arm.home[None]
    room = np.stack([arm.position[:, 1] - arm.home, arm.home - arm.position[:, 0]]).min(axis=0)
    used = np.abs(departure).max(axis=0) / np.maximum(room, 1e-6)
    for values, most in ((states.speed, arm.speed), (states.acceleration, arm.acceleration)):
        used = np.maximum(used, np.abs(values).max(axis=0) / most)
    full, sizes = 1 / np.maximum(used, 1e-12), np.zeros(arm.count)

    def meets(joint: int, size: float) -> bool:
        each = sizes.copy()
        each[joint] = size * full[joint]
        scaled = (departure * each[None] + arm.home[None], states.speed * each[None], states.acceleration * each[None])
        return limits.peaks(JointStates(*scaled), np.zeros(len(departure)))[0].share <= 1 + 1e-9

    for joint in reversed(range(arm.count)):
        size = 1.0 if meets(joint, 1.0) else _bisected(partial(meets, joint), COARSE)
        sizes[joint] = size * full[joint]
    return sizes


def _bisected(met: Callable[[float], bool], halvings: int, low: float = 0.0, high: float = 1.0) -> float:
    """The largest size between two, if all smaller ones are met as the low one is, and the high one is not."""
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if met(middle) else (low, middle)
    return low
