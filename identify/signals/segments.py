"""Still and moving segments of a recording, and which of the moving ones tell of the tensor. Plain arrays, SI units.

A recording holds more than its experiment: the body is mounted, poses are held, a start fails, something knocks. What
moves is seen by the angular velocity, smoothed so that vibration and white noise do not count, about
the gyro's bias, over half a second. Which of the moving segments count is a question of information: how much of
``ΩᵀΩ`` a segment holds against how badly the wrench in it fits ANY body (hands do not).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, PI_OF_FORCE, features
from identify.signals.filters import moving_average, thinned
from identify.signals.power_spectrum import welch

SMOOTHING = 0.1
"""Moving average that takes vibration and noise off [s]."""
WINDOW = 0.5
"""Length of the windows in which motion is judged [s]."""
PART_OF_MOTION = 0.03
"""Angular velocity that counts as rest, as a part of the run's typical one."""
SLOWEST = 0.02
"""Angular velocity that counts as motion in any run [rad/s]: no inertia is felt below."""
LARGEST_BIAS = 0.1
"""Largest bias of a gyro that is at rest [rad/s]."""
PAUSE = 1.0
"""Rest that parts two segments of motion [s]."""
MISFIT = 1e-4
"""Part of the largest motion's variance of moment that counts as explained."""


STEADY = 3.0
"""Variation of a steady signal over that of its quietest quarter, at most."""
ROUNDING = 1e-7
"""Variation of a steady signal over its largest value that a difference of squares may feign."""
PER_SAMPLE = 4.0
"""Thinned-out samples that count as one independent."""


class Segment(NamedTuple):
    """A segment from one instant to another [s], counted from the first sample's."""

    start: float
    stop: float

    @property
    def seconds(self) -> float:
        """Duration of the segment [s]."""
        return self.stop - self.start


def moving(rate: float, omega: Float[np.ndarray, "n 3"]) -> tuple[Segment, ...]:
    """Return the segments in which the body moves; pauses shorter than a second do not part them.

    Args:
        rate: sample rate [Hz].
        omega: angular velocity [rad/s].
    """
    moves = _filled(_moves(rate, omega), round(PAUSE * rate))
    return _segments(rate, moves)


def still(
    rate: float, omega: Float[np.ndarray, "n 3"], *others: Float[np.ndarray, "n 3"], shortest: float = 1.0
) -> tuple[Segment, ...]:
    """Return the segments in which the body rests and the other signals are steady.

    Steady is what varies within half a second no more than three times as much as it does in a quiet quarter of the
    rest: a hand on the body is not.

    Args:
        rate: sample rate [Hz].
        omega: angular velocity [rad/s].
        others: signals that must be steady too: force, moment, specific force.
        shortest: shortest segment to return [s].
    """
    rests = ~_moves(rate, omega)
    for signal in (omega, *others) if rests.any() else ():
        spread = _mean_and_spread(rate, signal)[1]
        quiet = np.quantile(spread[rests], 0.25)
        rests = rests & (spread <= STEADY * quiet + ROUNDING * np.abs(signal).max())
        if not rests.any():
            break
    return tuple(segment for segment in _segments(rate, rests) if segment.seconds >= shortest)


def decisive(
    rate: float,
    omega: Float[np.ndarray, "n 3"],
    force: Float[np.ndarray, "n 3"],
    moment: Float[np.ndarray, "n 3"],
    segments: Sequence[Segment],
) -> tuple[Segment, ...]:
    """Return the segments that tell of the tensor, in the order of time.

    Each is weighed by its ``ΩᵀΩ`` over the square of the variance that the best rigid body leaves of its moment: noise
    would count once, but what no body explains misleads. Kept are those that weigh at least a third of the best one,
    and as many more, best first, as hold half of what all of them know of the direction that they know least: three
    motions about one axis each stay together.

    Args:
        rate: sample rate [Hz].
        omega: angular velocity [rad/s].
        force: on the body at a point that stays [N].
        moment: on the body about this point [N·m].
        segments: to choose from.
    """
    if len(segments) < 2:
        return tuple(segments)
    step = _thinning(rate, omega, segments)
    coarse = [thinned(signal, step) for signal in (omega, force, moment)]
    columns = _columns(rate / step, *coarse[:2])
    samples = [(_cut(columns, rate / step, segment), _cut(coarse[2], rate / step, segment)) for segment in segments]
    largest = max(float(values.var(axis=0).sum()) for _, values in samples)
    information = [_information(*sample, MISFIT * largest) for sample in samples]
    weight = np.array([np.trace(segment) for segment in information])
    order = list(np.argsort(-weight))
    enough = 0.5 * np.linalg.eigvalsh(sum(information))[0]
    chosen = [k for k in order if 3 * weight[k] >= weight[order[0]]]
    for k in order[len(chosen) :]:
        if np.linalg.eigvalsh(sum(information[j] for j in chosen))[0] >= enough:
            break
        chosen.append(k)
    return tuple(segments[k] for k in sorted(chosen))


def _moves(rate: float, omega: np.ndarray) -> Bool[np.ndarray, " n"]:
    """Return the mask of the samples that belong to motion."""
    mean, spread = _mean_and_spread(rate, omega)
    speed = np.sqrt(np.maximum(((mean - _bias(mean, spread)) ** 2).sum(axis=1) + spread**2, 0))
    typical = np.sqrt((speed**4).sum() / max((speed**2).sum(), 1e-300))
    floor = min(4 * float(np.quantile(speed, 0.1)), SLOWEST)
    return speed > max(PART_OF_MOTION * typical, floor)


def _mean_and_spread(rate: float, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean (n, 3) and standard deviation (n,) of the smoothed signal about each sample, over the window."""
    n = len(signal)
    briefly, window = (int(np.clip(round(seconds * rate), 1, n)) for seconds in (SMOOTHING, WINDOW))
    smooth = moving_average(signal - signal.mean(axis=0), briefly)
    mean, square = moving_average(smooth, window), moving_average(smooth**2, window)
    return mean + signal.mean(axis=0), np.sqrt(np.maximum(square - mean**2, 0).sum(axis=1))


def _bias(mean: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """The gyro's bias, where it is seen at rest; zero where it is not [rad/s]."""
    quiet = (spread <= min(2 * np.quantile(spread, 0.1), SLOWEST)) & (np.linalg.norm(mean, axis=1) < LARGEST_BIAS)
    return np.median(mean[quiet], axis=0) if quiet.any() else np.zeros(3)


def _filled(mask: np.ndarray, longest: int) -> np.ndarray:
    """The mask with inner gaps below ``longest`` samples closed."""
    filled = mask.copy()
    for start, stop in runs_of_true(~mask):
        if start > 0 and stop < len(mask) and stop - start < longest:
            filled[start:stop] = True
    return filled


def runs_of_true(mask: Bool[np.ndarray, " n"]) -> list[tuple[int, int]]:
    """Return the first and the one past last sample of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _segments(rate: float, mask: np.ndarray) -> tuple[Segment, ...]:
    return tuple(Segment(start / rate, (stop - 1) / rate) for start, stop in runs_of_true(mask))


def _cut(signal: np.ndarray, rate: float, segment: Segment) -> np.ndarray:
    return signal[round(segment.start * rate) : round(segment.stop * rate) + 1]


def _thinning(rate: float, omega: np.ndarray, segments: Sequence[Segment]) -> int:
    """Return the factor for thinning out samples: to sixteen times the band of the longest segment's motion."""
    longest = _cut(omega, rate, max(segments, key=lambda segment: segment.seconds))
    frequency, power = welch(longest, rate, max(round(4 * rate), 8))
    share = np.cumsum(power.sum(axis=1)) / max(power.sum(), 1e-300)
    band = max(float(frequency[np.searchsorted(share, 0.99)]), 1.0)
    return max(int(rate / (16 * band)), 1)


def _columns(rate: float, omega: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The regressor of the moment about the point over tensor and centre of gravity (7), (n, 3, 9)."""
    alpha = np.gradient(omega, 1 / rate, axis=0)
    rows = np.einsum("kji,kn->nji", OMEGA_R_OF_FEATURES, features(omega.T, alpha.T))
    return np.concatenate([rows, np.einsum("kji,nk->nji", PI_OF_FORCE, force)], axis=2)


def _information(columns: np.ndarray, moment: np.ndarray, least: float) -> np.ndarray:
    """``ΩᵀΩ`` of one segment over the squared variance of the moment that no rigid body explains, (6, 6)."""
    if len(moment) < 4:
        return np.zeros((6, 6))
    rows, values = columns - columns.mean(axis=0), (moment - moment.mean(axis=0)).reshape(-1)
    flat = rows.reshape(-1, 9)
    residual = values - flat @ np.linalg.lstsq(flat, values, rcond=None)[0]
    independent = len(values) / PER_SAMPLE
    variance = residual @ residual / len(values) * independent / max(independent - 9, 1.0)
    return np.einsum("nji,nje->ie", rows[:, :, :6], rows[:, :, :6]) / max(variance, least, 1e-150) ** 2
