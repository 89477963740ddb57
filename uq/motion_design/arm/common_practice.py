"""Motions of common practice under the same limits in the same time: one joint at a time, random Fourier series."""

import numpy as np

from identify.serial_arm.joint_series import JointSeries, JointStates
from uq.motion_design.arm.arm_limits import ArmLimits
from uq.motion_design.arm.joint_search import GRID, Candidate, JointSearch
from uq.motion_design.arm.largest_motion import enlarged, largest_size
from uq.motion_design.arm.predicted_payload import WrenchNoise, promised

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
