"""The health of one channel: gaps, order, clock, samples that are not finite, held or saturated.

Thresholds stand beside their reasons. What the values mean (units, signs, axes) is judged elsewhere.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.channels import ImuChannel, RecordedChannel, WrenchChannel
from rig.exceptions import counted
from rig.record import device_clock

SensorChannel = WrenchChannel | ImuChannel
Suspicions = Iterator[tuple[str, str]]
"""Kinds of findings, with what is said of the topic."""
LEAST_SAMPLES = 10
WAIT = 0.1  # s without samples that a host may make, where the device's counter misses none
CLOCKLESS = "take them from the device's clock; until then log times count"


@dataclass(frozen=True)
class TopicFinding:
    """One suspicion: what, on which topic, and what to do."""

    kind: str
    topic: str
    text: str

    def __str__(self) -> str:
        """Show the finding in one line."""
        return f"{self.topic}: {self.text}"


def clock_skew(channel: SensorChannel) -> float:
    """Return the arrival clock's relative rate against the stamps, less one, by the lower convex hull."""
    return device_clock.fit(channel.stamp, channel.log_time).skew


def channel_findings(channel: SensorChannel, skew: float) -> list[TopicFinding]:
    """Everything that is suspicious about a channel; ``skew``: of its clock (:func:`clock_skew`)."""
    return [TopicFinding(kind, channel.topic, text) for kind, text in _suspicions(channel, skew)]


def _suspicions(channel: SensorChannel, skew: float) -> Suspicions:
    if len(channel.stamp) < LEAST_SAMPLES:
        yield "short", f"only {counted(len(channel.stamp), 'sample')}: record longer"
        return
    if together := device_clock.bunches(channel.stamp):
        yield "bunches", together.cure(rate_key(channel))
    yield from _gaps(channel)
    yield from _order(channel)
    yield from _clock(channel, skew)
    for name, values in channel_columns(channel).items():
        yield from _finite(name, values)
        yield from _excess(name, values)
        usable = values[(np.abs(values) <= LARGEST_READING).all(axis=1)]
        if len(usable) >= LEAST_SAMPLES:
            yield from _constant(name, usable)
            yield from _held(name, usable)
            yield from _saturated(name, usable)


def channel_columns(channel: SensorChannel) -> dict[str, NDArray[np.float64]]:
    """Return the vectors of a channel's samples, (n, 3) each, by their names in messages."""
    if isinstance(channel, WrenchChannel):
        return {"force": channel.force, "moment": channel.moment}
    return {"angular velocity": channel.angular_velocity, "acceleration": channel.linear_acceleration}


def rate_key(channel: RecordedChannel) -> str:
    """Return the key of ``[recording]`` that states the rate of a channel's sensor."""
    return "wrench_rate" if isinstance(channel, WrenchChannel) else "motion_rate"


def _gaps(channel: SensorChannel) -> Suspicions:
    """Steps of the stamps beyond five periods: jitter stays within one or two, a lost sample makes two."""
    steps = np.diff(channel.stamp) * 1e-9
    period = device_clock.steady_period(channel.stamp) * 1e-9
    wide = np.flatnonzero(steps > max(5 * period, 0.005))
    wide = wide[_later_for_good((channel.stamp - channel.stamp[0]) * 1e-9, period, wide)]
    sequence = channel.sequence
    if sequence is not None and (np.diff(sequence.astype(np.int64))[wide] == 1).all() and steps.max() < WAIT:
        wide = wide[:0]
    if len(wide):
        worst = wide[np.argmax(steps[wide])]
        after = (channel.stamp[worst] - channel.stamp[0]) * 1e-9
        yield (
            "gap",
            f"{counted(len(wide), 'gap')}, the longest {steps[worst]:.3f} s at {after:.3f} s: leave that time out",
        )
    if sequence is not None and len(sequence) > 1 and sequence[-1] > sequence[0] and not len(wide):
        increments = np.diff(sequence.astype(np.int64))
        missing = int((increments[(increments > 1) & (increments < 2**16)] - 1).sum())
        if missing and increments.min() > 0:
            yield "gap", f"{counted(missing, 'sample')} missing by the device's counter: check the cable"


def _later_for_good(time: NDArray[np.float64], period: float, wide: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return the wide steps that are not made up for: delayed samples come in a burst, the last without delay."""
    delay, ahead = time - np.arange(len(time)) * period, max(int(0.5 / max(period, 1e-9)), 1)
    ends = [0, *(wide + 1).tolist(), len(time)]  # of the stretches between wide steps; half a second of each counts
    least = [
        (delay[at : min(after, at + ahead)].min(), delay[max(before, at - ahead) : at].min())
        for before, at, after in zip(ends, ends[1:], ends[2:], strict=False)
    ]
    return np.array([then - before > 2.5 * period for then, before in least], bool)


def _order(channel: SensorChannel) -> Suspicions:
    back = int((np.diff(channel.stamp) <= 0).sum())
    if back:
        stamped = bool((channel.stamp != channel.log_time).any())
        which, cure = ("header stamps", CLOCKLESS) if stamped else ("log times", "stamp the messages")
        yield "order", f"{back} {which} do not increase: {cure}"


SKEW_LIMIT = 500e-6  # crystals keep within 100 ppm; five times that is a clock of another kind
LEAST_SECONDS = 5.0  # over less, delays look like skew


def _clock(channel: SensorChannel, skew: float) -> Suspicions:
    seconds = (channel.stamp[-1] - channel.stamp[0]) * 1e-9
    if seconds >= LEAST_SECONDS and abs(skew) > SKEW_LIMIT:
        yield "skew", f"stamps drift by {skew * 1e3:+.3f} ms/s against the host's clock: fit the clock before use"


def _finite(name: str, values: NDArray[np.float64]) -> Suspicions:
    """Samples that are no numbers: single ones are left out; an accelerometer that has hardly others is not used."""
    bad = ~np.isfinite(values)
    count, samples, axes = int(bad.any(axis=1).sum()), len(values), np.flatnonzero(bad.all(axis=0))
    if 2 * count > samples:
        cure = "it is not used" if name == "acceleration" else "check sensor and driver"
        which = f"{name} {'xyz'[axes[0]]}" if len(axes) == 1 else name
        share = "throughout" if count == samples else f"in {count} of {samples} samples"
        yield "not finite", f"{which} is no finite number {share}: {cure}"
    elif count:
        yield "not finite", f"{name} is not a number in {counted(count, 'sample')}: left out"


LARGEST_READING = 1e12  # in any unit, far beyond any sensor; `identify` refuses more


def _excess(name: str, values: NDArray[np.float64]) -> Suspicions:
    size = np.abs(values).max(axis=1)
    wild = np.isfinite(size) & (size > LARGEST_READING)
    if wild.any():
        reached = f"{size[wild].max():.1e}, which no sensor can read, in {counted(int(wild.sum()), 'sample')}"
        yield "excess", f"{name} reaches {reached}: leave them out"


def _constant(name: str, values: NDArray[np.float64]) -> Suspicions:
    """A signal without any change: real ones have noise. An IMU without an accelerometer sends zeros.

    A force of zero has a kind of its own: the source of a moment alone, such as a flywheel, sends it too.
    """
    if name == "acceleration" and not values.any():
        return
    constant = np.ptp(values, axis=0) == 0
    if constant.all():
        level = ", ".join(f"{value:.6g}" for value in values[0] + 0.0)
        kind = "no force" if name == "force" and not values.any() else "constant"
        yield kind, f"{name} stays at ({level}) throughout: check sensor and driver"
    for axis in dead_axes(values):
        yield "constant", dead_channel(name, axis, values)


def dead_axes(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the axes of a vector's samples that never change while another does."""
    constant = np.array([not len(column) or bool((column == column[0]).all()) for column in values.T])
    return np.flatnonzero(constant & ~constant.all())


def dead_channel(name: str, axis: int, values: NDArray[np.float64]) -> str:
    """Return what is said of an axis that never changes while another does."""
    level = values[0, axis] + 0.0
    return f"{name} {'xyz'[axis]} stays at {level:.6g} throughout while the others change: check sensor and driver"


HELD_LIMIT = 0.2  # repeats of all three axes at once are rare with any noise; one in five is a slower source


def _held(name: str, values: NDArray[np.float64]) -> Suspicions:
    """Samples equal to the one before in all three axes, unless the signal is constant throughout."""
    same = (np.diff(values, axis=0) == 0).all(axis=1)
    share = float(same.mean())
    if HELD_LIMIT < share < 1:
        yield "held", f"{share:.0%} of the {name} samples repeat the one before: the true rate is lower than stated"


SATURATED_LIMIT = 5  # samples in a row, exactly at the extreme


def _saturated(name: str, values: NDArray[np.float64]) -> Suspicions:
    """An axis that stays exactly at its largest or smallest value for several samples while others move."""
    for axis in range(3):
        column = values[:, axis]
        if np.ptp(column) <= 1e-9 * np.abs(column).max():
            continue
        for extreme in (column.min(), column.max()):
            run = longest_run(column == extreme)
            if run >= SATURATED_LIMIT and _moves(values, column == extreme) and _abrupt(column, extreme):
                yield "saturation", f"{name} {'xyz'[axis]} stays at {extreme:.6g} for {run} samples: out of range"


def _moves(values: NDArray[np.float64], where: NDArray[np.bool_]) -> bool:
    """Whether the other axes change between consecutive samples of ``where``: otherwise they are held samples."""
    both = where[1:] & where[:-1]
    return bool((np.diff(values, axis=0)[both] != 0).any(axis=1).mean() > 0.5) if both.any() else False


def _abrupt(column: NDArray[np.float64], extreme: float) -> bool:
    """Whether the signal runs into its extreme at full speed.

    The top of a smooth curve is left by one step of the converter.
    """
    steps = np.abs(np.diff(column))
    at_edge = steps[(column[1:] == extreme) != (column[:-1] == extreme)]
    moving = steps[steps > 0]
    return bool(np.median(at_edge) > max(0.3 * np.median(moving), 1.5 * moving.min())) if len(at_edge) else False


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max()) if len(edges) else 0
