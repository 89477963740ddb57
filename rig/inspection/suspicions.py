"""The checks behind ``inspect``: each looks at one channel and yields what is suspicious about it.

Thresholds stand beside their reasons. Nothing here knows an experiment: what cannot be told from the run alone is not
judged.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from rig.channels import ImuChannel, WrenchChannel
from rig.record import device_clock

STANDARD_GRAVITY = 9.80665  # m/s²


@dataclass(frozen=True)
class Finding:
    """One suspicion: what, on which topic, and what to do."""

    kind: str
    topic: str
    text: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.topic}: {self.text}"


def skew(channel: WrenchChannel | ImuChannel) -> float:
    """How much faster the arrival clock runs than the stamps, as a pure number, by the lower convex hull."""
    return device_clock.fit(channel.stamp, channel.log_time).skew


def findings(channel: WrenchChannel | ImuChannel) -> Iterator[Finding]:
    """Everything that is suspicious about a channel of at least ten samples."""
    columns = _columns(channel)
    yield from _gaps(channel)
    yield from _order(channel)
    yield from _clock(channel)
    for name, values in columns.items():
        yield from _finite(channel.topic, name, values)
        yield from _held(channel.topic, name, values)
        yield from _saturated(channel.topic, name, values)
    if isinstance(channel, ImuChannel):
        yield from units(channel)
        yield from axes(channel)


def _columns(channel: WrenchChannel | ImuChannel) -> dict[str, NDArray[np.float64]]:
    if isinstance(channel, WrenchChannel):
        return {"force": channel.force, "moment": channel.moment}
    return {"angular velocity": channel.angular_velocity, "acceleration": channel.linear_acceleration}


def _gaps(channel: WrenchChannel | ImuChannel) -> Iterator[Finding]:
    """Steps of the stamps beyond five periods: jitter stays within one or two, a lost sample makes two."""
    steps = np.diff(channel.stamp) * 1e-9
    period = float(np.median(steps))
    wide = np.flatnonzero(steps > max(5 * period, 0.005))
    if len(wide):
        worst = wide[np.argmax(steps[wide])]
        after = (channel.stamp[worst] - channel.stamp[0]) * 1e-9
        yield Finding(
            "gap",
            channel.topic,
            f"{len(wide)} gaps, the longest {steps[worst]:.3f} s at {after:.3f} s: leave that time out",
        )
    sequence = channel.sequence
    if sequence is not None and len(sequence) > 1 and sequence[-1] > sequence[0] and not len(wide):
        counted = np.diff(sequence.astype(np.int64))
        missing = int((counted[(counted > 1) & (counted < 2**16)] - 1).sum())
        if missing and counted.min() > 0:
            yield Finding("gap", channel.topic, f"{missing} samples missing by the device's counter: check the cable")


def _order(channel: WrenchChannel | ImuChannel) -> Iterator[Finding]:
    back = int((np.diff(channel.stamp) <= 0).sum())
    if back:
        yield Finding("order", channel.topic, f"{back} stamps do not increase: check the device's clock")


SKEW_LIMIT = 500e-6  # crystals keep within 100 ppm; five times that is a clock of another kind
LEAST_SECONDS = 5.0  # over less, delays look like skew


def _clock(channel: WrenchChannel | ImuChannel) -> Iterator[Finding]:
    seconds = (channel.stamp[-1] - channel.stamp[0]) * 1e-9
    rate = skew(channel)
    if seconds >= LEAST_SECONDS and abs(rate) > SKEW_LIMIT:
        yield Finding(
            "skew",
            channel.topic,
            f"stamps drift by {rate * 1e3:+.3f} ms/s against the host's clock: fit the clock before use",
        )


def _finite(topic: str, name: str, values: NDArray[np.float64]) -> Iterator[Finding]:
    bad = int((~np.isfinite(values)).any(axis=1).sum())
    if bad:
        yield Finding("not finite", topic, f"{name} is not a number in {bad} samples: leave them out")


HELD_LIMIT = 0.2  # repeats of all three axes at once are rare with any noise; one in five is a slower source


def _held(topic: str, name: str, values: NDArray[np.float64]) -> Iterator[Finding]:
    """Samples equal to the one before in all three axes, unless the signal is constant throughout."""
    same = (np.diff(values, axis=0) == 0).all(axis=1)
    share = float(same.mean())
    if HELD_LIMIT < share < 1:
        yield Finding(
            "held",
            topic,
            f"{share:.0%} of the {name} samples repeat the one before: the true rate is lower than stated",
        )


SATURATED_LIMIT = 5  # samples in a row, exactly at the extreme


def _saturated(topic: str, name: str, values: NDArray[np.float64]) -> Iterator[Finding]:
    """An axis that stays exactly at its largest or smallest value for several samples while others move."""
    for axis in range(3):
        column = values[:, axis]
        if np.ptp(column) <= 1e-9 * np.abs(column).max():
            continue
        for extreme in (column.min(), column.max()):
            run = longest_run(column == extreme)
            if run >= SATURATED_LIMIT and _moves(values, column == extreme) and _abrupt(column, extreme):
                yield Finding(
                    "saturation", topic, f"{name} {'xyz'[axis]} stays at {extreme:.6g} for {run} samples: out of range"
                )


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


def units(channel: ImuChannel) -> Iterator[Finding]:
    """What seems to be in another unit than rad/s and m/s²."""
    wrong = wrong_units(channel)
    if "g" in wrong:
        yield Finding(
            "unit",
            channel.topic,
            f"acceleration is {wrong['g']:.3f} in the median: in g? it must be in m/s^2 (times {STANDARD_GRAVITY}): "
            'set acceleration_unit = "g" in [recording]',
        )
    if "deg/s" in wrong:
        yield Finding(
            "unit",
            channel.topic,
            f"gravity turns {wrong['deg/s']:.0f} times less than the gyro says: in deg/s? it must be in rad/s: "
            'set angular_velocity_unit = "deg/s" in [recording]',
        )


LEAST_TURN = 0.5  # radians that the gyro says gravity has turned: true, the accelerometer would show it
UNLIKE = 15.0  # times less turned than that; a lever arm or a filter makes two or three


def wrong_units(channel: ImuChannel) -> dict[str, float]:
    """The units that seem to be used instead, with the figure that tells: median acceleration, ratio of the turns."""
    wrong = {}
    specific_force = float(np.nanmedian(np.linalg.norm(channel.linear_acceleration, axis=1)))
    if 0.8 < specific_force < 1.25:
        wrong["g"] = specific_force
    if gravity_shows(channel):
        said, shown = turns(channel)
        if said > LEAST_TURN and said > UNLIKE * shown:
            wrong["deg/s"] = said / shown if shown > 0 else np.inf
    return wrong


WITHIN = 5.0  # seconds: slower turns may be a gyro's bias


def turns(channel: ImuChannel) -> tuple[float, float]:
    """By how much gravity turns in the body frame within five seconds [rad, rms]: as the gyro says; as it is seen.

    Gravity fixed in space changes in the body frame by dg/dt = -ω × g.
    """
    time = (channel.stamp - channel.stamp[0]) * 1e-9
    g, omega = channel.linear_acceleration, channel.angular_velocity
    if len(time) < 100 or time[-1] <= 0:
        return 0.0, 0.0
    size = max(float(np.median(np.linalg.norm(g, axis=1))), 1e-9)
    cross = -np.cross(omega, g)
    steps = np.diff(time)[:, None]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (cross[1:] + cross[:-1]) * steps, axis=0)])
    width = min(len(time), max(1, round(WITHIN * len(time) / time[-1])))
    said, seen = (float(np.sqrt(((x - _average(x, width)) ** 2).sum(axis=1).mean())) / size for x in (turned, g))
    return said, seen


def _average(x: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """The mean over ``width`` samples about each, over fewer at the ends."""
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(x, axis=0)])
    low = np.maximum(np.arange(len(x)) - width // 2, 0)
    high = np.minimum(np.arange(len(x)) + (width + 1) // 2, len(x))
    return (total[high] - total[low]) / (high - low)[:, None]


STEADY = 0.05  # the specific force is mostly gravity when its magnitude varies by less than this, by median deviation


def gravity_shows(channel: ImuChannel) -> bool:
    """Whether the accelerometer shows gravity and little else, so that its turning can be compared with the gyro."""
    magnitude = np.linalg.norm(channel.linear_acceleration, axis=1)
    middle = float(np.median(magnitude))
    return float(np.median(np.abs(magnitude - middle))) < STEADY * middle


LEAST_TILT = 0.1  # radians, rms: with less, an IMU away from the axis of the motion may see gravity turn otherwise


def axes(channel: ImuChannel) -> Iterator[Finding]:
    """Gravity must turn as the gyro says: look for the axis order and signs under which it does."""
    if not gravity_shows(channel) or turns(channel)[0] < LEAST_TILT:
        return
    fits = [(likeness(channel, order, signs), order, signs) for order, signs in rotations()]
    as_is = next(fit for fit, order, signs in fits if order == (0, 1, 2) and signs == (1, 1, 1))
    best, order, signs = max(fits, key=lambda item: item[0])
    if best > 0.8 and as_is < 0.5 * best:
        names = ", ".join(("-" if s < 0 else "") + "xyz"[i] for i, s in zip(order, signs, strict=True))
        yield Finding(
            "axes",
            channel.topic,
            f"gravity turns as the gyro says only if the accelerometer's axes are the gyro's ({names}): swapped axes",
        )


def rotations() -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """The orders and signs of three axes, mirrored ones included: 48."""
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            yield order, signs


def likeness(channel: ImuChannel, order: tuple[int, ...], signs: tuple[int, ...]) -> float:
    """Correlation of the turning of gravity with what the gyro says, the accelerometer's axes so rearranged."""
    time = (channel.stamp - channel.stamp[0]) * 1e-9
    g = channel.linear_acceleration[:, list(order)] * np.array(signs, dtype=float)
    cross = -np.cross(channel.angular_velocity, g)
    steps = np.diff(time)[:, None]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (cross[1:] + cross[:-1]) * steps, axis=0)])
    x, y = turned - turned.mean(axis=0), g - g.mean(axis=0)
    size = float(np.sqrt((x * x).sum() * (y * y).sum()))
    return float((x * y).sum()) / size if size > 1e-9 else 0.0
