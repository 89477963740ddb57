"""The time of a message that is that of its measurement, and the treatment of times that jitter by arrival."""

import datetime
from dataclasses import replace
from typing import TypeVar

import numpy as np

from identify.signals.resample import GAP, JITTER_WARNING, in_gap, interpolate
from identify.signals.run import RunError
from rig.channels import ImuChannel, MotionChannel, RecordedChannel, Recording, WrenchChannel
from rig.record import device_clock
from uq.experiment.recording_table import RecordingTable

AnyChannel = TypeVar("AnyChannel", bound=RecordedChannel)
Channel = WrenchChannel | ImuChannel | MotionChannel
CALENDAR = 10**18
"""Nanoseconds since 1970 from which an instant is a date: that of September 2001."""
AHEAD = 0.5
"""Seconds over which the usual delay tells whether messages were lost or only late."""
RATE_ERROR = 0.01
"""Relative error of a declared rate beyond which it is refused: a device's clock is far better."""
LATE = 0.1
"""Scatter of arrivals about a steady rate beyond which there is no such rate [s]."""


def in_order(recording: Recording, choice: str | None) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording whose messages stand in the order of their stamps where these count, and what was done."""
    wrench, motion = recording.wrench.in_order(), recording.motion.in_order()
    if choice == "log" or not all(channel.stamp.any() and _increases(channel.stamp) for channel in (wrench, motion)):
        return recording, ()
    before, after = (recording.wrench, recording.motion), (wrench, motion)
    moved = [new.topic for old, new in zip(before, after, strict=True) if old is not new]
    done = f"messages of {' and '.join(moved)} overtook each other: they are sorted by their stamps"
    return replace(recording, wrench=wrench, motion=motion), (done,) * bool(moved)


def instants(
    channels: tuple[Channel, Channel], choice: str | None
) -> tuple[tuple[np.ndarray, np.ndarray], tuple[str, ...]]:
    """Return the instants of two channels' messages on one clock [ns], and what is to be said of them.

    The headers' stamps, where in both channels they are set and increase throughout the run (a run may start at zero);
    else the log's times of both, since clocks must not mix. Log times that jitter by arrival are replaced by a straight
    line through the fastest arrivals: over the device's stamps, its counter, or the messages' numbers.

    Args:
        channels: load cell and motion sensor.
        choice: ``header`` or ``log``, where declared.

    Raises:
        RunError: all times of a channel that would be taken are the same.
    """
    unset = [channel.topic for channel in channels if not channel.stamp.any()]
    wild = [channel.topic for channel in channels if channel.topic not in unset and not _increases(channel.stamp)]
    by_header = choice == "header" or (choice is None and not unset and not wild)
    for channel in channels:
        times = channel.stamp if by_header else channel.log_time
        if len(times) > 1 and times.min() == times.max():
            which = "stamps" if by_header else "log times"
            raise RunError(f"all {which} of {channel.topic} are the same: record it with a running clock")
    if by_header:
        return (channels[0].stamp, channels[1].stamp), ()
    notes = []
    if choice is None:
        notes = [f"no stamps in the headers of {' and '.join(unset)}"] * bool(unset)
        notes += [f"the headers' stamps of {' and '.join(wild)} do not increase"] * bool(wild)
        notes = [f"{' and '.join(notes)}: the log's times are used for both sensors"]
    fitted = [_fitted(channel) for channel in channels]
    return (fitted[0][0], fitted[1][0]), (*notes, *(text for _, texts in fitted for text in texts))


def steadily_stamped(recording: Recording, declared: RecordingTable) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording whose samples are stamped by their declared rates, where they were stamped as they arrived.

    Args:
        recording: its messages in order.
        declared: the rates; without one a channel keeps its times.

    Raises:
        RunError: a declared rate is not that of the times, or times without one come in bunches.
    """
    name = recording.path.name
    wrench, by_wrench = _steady(recording.wrench, name, "wrench_rate", declared)
    motion, by_motion = _steady(recording.motion, name, "motion_rate", declared)
    return replace(recording, wrench=wrench, motion=motion), (*by_wrench, *by_motion)


def _steady(channel: AnyChannel, name: str, key: str, declared: RecordingTable) -> tuple[AnyChannel, tuple[str, ...]]:
    """A channel that is stamped by its rate, where one is declared by a key, and what is said of it."""
    rate, by_stamp = getattr(declared, key), declared.time != "log" and bool(channel.stamp.any())
    times = channel.stamp if by_stamp else channel.log_time
    if rate is None:
        # several publishers on one topic, each of some of the joints, follow one another closely
        parts = (
            isinstance(channel, MotionChannel)
            and not np.isfinite(0.0 if channel.position is None else channel.position).all()
        )
        if by_stamp and not parts and _increases(times) and (together := device_clock.bunches(times)):
            raise RunError(f"{channel.topic} in {name}: its {together.cure(key)}")
        return channel, ()
    if len(times) < 2:
        return channel, ()
    device, start = _ticks(times, getattr(channel, "sequence", None), 1e9 / rate), times[0]
    line = device_clock.fit(device, times - start)
    if abs(line.skew) > RATE_ERROR:
        measured = rate / (1 + line.skew)
        raise RunError(
            f"recording.{key} is {rate:g} Hz, and {channel.topic} in {name} has {measured:.6g} Hz: correct it"
        )
    at = start + device + np.round(line.offset + line.skew * (device - line.origin)).astype(np.int64)
    scatter = f"{1e-6 * float((times - at).std()):.2g} ms"
    note = f"{channel.topic} samples steadily at {rate:g} Hz; its times of arrival scatter by {scatter}"
    return (replace(channel, stamp=at) if by_stamp else replace(channel, log_time=at)), (note,)


def with_accelerometer(recording: Recording, choice: str | None) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording whose gyro has the readings of the accelerometer of another topic, at its own instants.

    Args:
        recording: its messages in order.
        choice: ``header`` or ``log``, where declared.

    Raises:
        RunError: the two have no second in common, or times do not increase.
    """
    gyro, other = recording.motion, recording.accelerometer
    if other is None or not isinstance(gyro, ImuChannel):
        return recording, ()
    name, other = f"{other.topic} and {gyro.topic} in {recording.path.name}", other.in_order()
    by_stamp = choice != "log" and all(channel.stamp.any() for channel in (gyro, other))
    times, at = ((x.stamp if by_stamp else x.log_time) for x in (other, gyro))
    if len(times) < 2 or not _increases(times):
        raise RunError(f"time of {other.topic} in {recording.path.name} does not increase: use the other clock")
    t, instants = (times - times[0]) * 1e-9, (at - times[0]) * 1e-9
    known = (instants >= 0) & (instants <= t[-1]) & ~in_gap(t, instants, 0.0)
    if known.sum() < 2:
        raise RunError(f"no overlap of {name}: check the clocks")
    read = interpolate(t, other.linear_acceleration, instants[known])
    joined = replace(gyro.taken(known), linear_acceleration=read)
    note = f"the angular velocity is that of {gyro.topic}, the acceleration that of {other.topic}, at its own instants"
    return replace(recording, motion=joined, accelerometer=None), (note,)


def check_overlap(channels: tuple[Channel, Channel], times: tuple[np.ndarray, np.ndarray], name: str) -> None:
    """Refuse channels whose times have nothing in common, with both ranges and what cures it.

    Raises:
        RunError: so it is.
    """
    if min(map(len, times)) < 2 or _overlap(*times):  # a single sample is refused as such
        return
    kind = "stamps" if times[0] is channels[0].stamp else "log times"
    wrench, motion = (f"from {_readable(int(t[0]))} to {_readable(int(t[-1]))}" for t in times)
    ranges = f"the {kind} of {channels[0].topic} run {wrench}, those of {channels[1].topic} {motion}"
    logged = kind == "stamps" and _overlap(channels[0].log_time, channels[1].log_time)
    cure = 'set time = "log" in [recording]' if logged else "record both at the same time"
    raise RunError(f"no overlap in {name}: {ranges}: {cure}")


def _overlap(first: np.ndarray, second: np.ndarray) -> bool:
    return bool(max(first.min(), second.min()) < min(first.max(), second.max()))


def _readable(time: int) -> str:
    """An instant [ns]: a date, or seconds where the clock began at its computer's start."""
    if time < CALENDAR:
        return f"{time * 1e-9:.3f} s"
    date = datetime.datetime.fromtimestamp(time // 10**9, datetime.UTC)
    return f"{date:%Y-%m-%d %H:%M:%S}.{time % 10**9 // 10**6:03d} UTC"


def _increases(stamp: np.ndarray) -> bool:
    return bool((np.diff(stamp) > 0).all())


def _fitted(channel: Channel) -> tuple[np.ndarray, tuple[str, ...]]:
    """The log's times, without the jitter of arrival."""
    arrival = channel.log_time
    steps = np.diff(arrival)
    if len(steps) < 10 or steps[steps <= GAP * np.median(steps)].std() < JITTER_WARNING * np.median(steps):
        return arrival, ()
    stamped = channel.stamp.any() and _increases(channel.stamp)
    device = channel.stamp if stamped else _ticks(arrival, channel.sequence)
    line = device_clock.fit(device, arrival)
    times = device + np.round(line.offset + line.skew * (device - line.origin)).astype(np.int64)
    spread = 1e-6 * float((arrival - times).std())
    if spread > LATE * 1e3:
        return arrival, (f"the log's times of {channel.topic} have no steady rate: they are used as they are",)
    means = "the device's stamps" if stamped else "a steady rate"
    return times, (f"the log's times of {channel.topic} jitter by {spread:.2g} ms: fitted {means} to them",)


def _ticks(arrival: np.ndarray, counted: np.ndarray | None, period: float | None = None) -> np.ndarray:
    """Times [ns] of a steady rate: by the device's counter, or else by the messages' numbers, losses added.

    Args:
        arrival: of the messages [ns].
        counted: the device's counter; None: it has none.
        period: of the samples [ns]; None: as the arrivals tell it.
    """
    if counted is not None and _counts(counted):
        number = counted.astype(np.int64) - int(counted[0])
        mean = (arrival[-1] - arrival[0]) / max(number[-1], 1)
        return np.round(number * (mean if period is None else period)).astype(np.int64)
    number = np.arange(len(arrival))
    period = device_clock.steady_period(arrival) if period is None else period
    delay = arrival - np.round(number * period)
    ahead = max(int(AHEAD * 1e9 / period), 1)
    for k in np.flatnonzero(np.diff(arrival) > GAP * period):
        after, before = np.median(delay[k + 1 : k + 1 + ahead]), np.median(delay[max(k + 1 - ahead, 0) : k + 1])
        lost = round((after - before) / period)
        if lost > GAP / 2:  # fewer are within the jitter, and shift no sample by more
            number[k + 1 :] += lost
            delay[k + 1 :] -= round(lost * period)
    return np.round(number * period).astype(np.int64)


def _counts(counter: np.ndarray) -> bool:
    """Whether a counter counts messages: up by one nearly always, and never down."""
    steps = np.diff(counter.astype(np.int64))
    return bool((steps > 0).all() and np.mean(steps == 1) > 0.9)
