"""A device's clock against the host's, fitted to the fastest arrivals: the delayed ones do not bias the fit.

A device without a clock that counts its samples has one nearly as good: it ticks once a sample (:class:`CounterClock`).
"""

from bisect import bisect_left
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class ClockFit(NamedTuple):
    """``host = device + offset + skew * (device - origin)``, all in ns, skew as a pure number."""

    offset: float
    skew: float
    origin: int

    def host(self, device: int) -> int:
        """The host time [ns] of a device time [ns]."""
        return device + round(self.offset + self.skew * (device - self.origin))


JUMP = 100_000_000  # ns that a device time may step back, or lie ahead of its arrival, and still be of its clock
LARGEST = 2**61  # ns, 73 years; beyond it the fit, in floating point, would err by a microsecond
MINIMUM_SPAN = 2_000_000_000  # ns; over less the skew of a crystal is lost in the delays


class ClockTracker:
    """The lower convex hull of (arrival - device time) over device time, updated point by point.

    Every arrival is late by a delay of at least some minimum. The hull edge below the middle of the run is the line
    that no arrival undercuts: offset (with the least delay in it) and skew, without the bias of the other delays.
    """

    def __init__(self) -> None:
        self._hull: list[tuple[int, int]] = []
        self._fit: ClockFit | None = None
        self._last: tuple[int, int] | None = None  # device time and stamp of the sample before
        self.stamp_excess = 0  # ns by which stamps have proved late: a sample arrived so much before the line

    def begin(self) -> None:
        """Forget the stamps so far, and of the fit all but the fastest arrival: others may have waited to be read."""
        self.stamp_excess = 0
        self._hull, self._fit = sorted(self._hull, key=itemgetter(1))[:1], None
        if self._last is not None:
            self._last = self._last[0], -LARGEST

    def add(self, device: int, arrival: int) -> None:
        """Take a sample's device time and arrival time [ns]; a device time that goes back is ignored."""
        hull, point = self._hull, (device, arrival - device)
        if hull and device <= hull[-1][0]:
            return
        while len(hull) > 1 and _not_below(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
        self._fit = None

    @property
    def fit(self) -> ClockFit:
        """The line as of now. Before ``MINIMUM_SPAN`` the skew is zero."""
        if self._fit is None:
            self._fit = _edge(self._hull)
        return self._fit

    def go_on(self, device: int, stamp: int) -> None:
        """Take the time and stamp of a sample that was stamped by other means: stamps go on from there."""
        self._last = device, stamp

    def jumps(self, device: int, arrival: int) -> bool:
        """Whether a device time [ns] cannot belong to the clock so far: far back, or measured long after it arrived."""
        if not self._hull or abs(device) > LARGEST:
            return abs(device) > LARGEST
        back = self._last is not None and device < self._last[0] - JUMP
        return back or self.fit.host(device) > arrival + JUMP

    def foresee(self, times: list[tuple[int, int]]) -> None:
        """Take device times and arrivals of samples that were read together, before the first of them is stamped.

        The others waited for the last: with it the fit falls at once, and only the last says something of the clock.
        """
        device, arrival = times[0]
        if self.jumps(device, arrival):
            return
        for later in times[1:]:
            step = later[0] - device
            if not -JUMP <= step <= later[1] - arrival + JUMP or later[0] > LARGEST:
                break
            device, arrival = later
        self._prove(device, arrival)
        self.add(device, arrival)

    def _prove(self, device: int, arrival: int) -> None:
        """Notice that stamps so far are late."""
        if self._last is not None and self._last[1] > -LARGEST and device > self._hull[-1][0]:
            self.stamp_excess = max(self.stamp_excess, self.fit.host(device) - arrival)

    def stamp(self, device: int, arrival: int) -> int:
        """Take a sample and return its time of measurement in host time [ns].

        The fit falls as faster samples arrive. Stamps follow it at half the device's pace, so that none steps back, or
        slower where they would be later than their arrivals.
        """
        self._prove(device, arrival)
        self.add(device, arrival)
        stamp, latest = self.fit.host(device), arrival
        if self._last is not None and device > self._last[0]:
            before, stamped = self._last
            stamp = max(stamp, stamped + (device - before + 1) // 2)
            latest = max(arrival, stamped + 1)
        stamp = min(stamp, latest)
        self._last = device, stamp
        return stamp


STEADY_FOR = 3  # windows in a row that prove a counter unsteady
WINDOW = 1_000_000_000  # ns of arrivals in which the fastest one is looked for
FEWEST = 5  # arrivals in it
TOLERANCE = 500_000  # ns that the fastest arrivals may lie off the line whatever their scatter


class CounterClock:
    """A counter of samples as a device clock: its period is learnt from the first two seconds of arrivals.

    The period is that of the line below the arrivals, so that delays do not bias it; a :class:`ClockTracker` refines it
    from then on. It holds for a device that samples at a steady rate. Of one that does not, the fastest arrivals wander
    off the line by more than they scatter about it, and arrivals are the better stamps.
    """

    def __init__(self) -> None:
        self.period = 0.0  # ns; zero before it is known
        self.steady = True
        self._origin = 0
        self._first: list[tuple[int, int]] = []  # counters and arrivals before the period is known
        self._window: list[int] = []  # arrivals less stamps, of this window
        self._until = 0
        self._off = 0  # windows off the line, in a row
        self._least = np.zeros(2)  # of each window's fastest arrival less its stamp: count, sum of squares

    def time(self, counter: int) -> int:
        """The device time [ns] of a counter, once the period is known."""
        return round((counter - self._origin) * self.period)

    def learn(self, counter: int, arrival: int) -> ClockTracker | None:
        """Take a sample; the tracker of the clock when the period becomes known with it."""
        first = self._first
        if first and counter <= first[-1][0]:
            first.clear()
        first.append((counter, arrival))
        if arrival - first[0][1] < MINIMUM_SPAN or len(first) < 2 * FEWEST:
            return None
        counters, arrivals = np.array(first).T
        self._origin = counter
        self.period = float((arrivals[-1] - arrivals[0]) / (counters[-1] - counters[0]))
        times = np.round((counters - counter) * self.period).astype(np.int64)
        self.period *= 1 + fit(times, arrivals).skew
        tracker = ClockTracker()
        for count, arrived in first:
            tracker.add(self.time(count), arrived)
        first.clear()
        return tracker

    def watch(self, arrival: int, stamp: int) -> bool:
        """Take what became of a sample; whether the counter still keeps to a line."""
        if arrival > self._until:
            self._judge()
            self._window, self._until = [], arrival + WINDOW
        self._window.append(arrival - stamp)
        return self.steady

    def _judge(self) -> None:
        if len(self._window) < FEWEST:
            return
        off = np.array(self._window)
        least = float(off.min())
        self._least += 1, least**2
        self._off = self._off + 1 if abs(least) > max(TOLERANCE, 3 * float(off.std())) else 0
        self.steady &= self._off < STEADY_FOR

    @property
    def uncertainty(self) -> float | None:
        """Root mean square of the fastest arrivals' distance from the line [ns], window by window; None of none.

        What a rate that is not quite steady and delays that are never small do to a stamp. The least delay of all is
        not in it: no arrival tells it.
        """
        count, squares = self._least
        return float(np.sqrt(squares / count)) if count else None


def _not_below(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])


def _edge(hull: list[tuple[int, int]]) -> ClockFit:
    if not hull:
        return ClockFit(0.0, 0.0, 0)
    origin = hull[0][0]
    if hull[-1][0] - origin < MINIMUM_SPAN:
        return ClockFit(min(offset for _, offset in hull), 0.0, origin)
    middle = (origin + hull[-1][0]) / 2
    index = bisect_left(hull, middle, key=itemgetter(0))
    (x0, y0), (x1, y1) = hull[max(0, index - 1)], hull[max(1, index)]
    skew = (y1 - y0) / (x1 - x0)
    return ClockFit(y0 - skew * (x0 - origin), skew, origin)


def steady_period(times: NDArray[np.int64]) -> float:
    """Return the period of samples that came in bursts or with jitter, from the median of spans over many [ns]."""
    span = max(min(len(times) // 4, 1000), 1)
    return float(np.median((times[span:] - times[:-span]) / span))


CLOSE = 0.25
"""Step over the period, below which a sample came together with the one before: jitter of a third makes a few."""
BUNCHED = 0.25
"""Part of such steps from which times are those of bunches: one sample in four waits for the next."""


class Bunches(NamedTuple):
    """Times of samples that arrived in bunches, though the sensor's rate is steady."""

    interval: float
    """Usual time between bunches [s]."""
    rate: float
    """The roundest rate that the times allow [Hz]."""

    def cure(self, key: str) -> str:
        """Return what they look like and what to do, by the key of ``[recording]`` that states the rate."""
        return (
            f"samples come in bunches every {1e3 * self.interval:.3g} ms, stamped as they arrived, as from a serial "
            f'port that waits so long: set {key} = "{self.rate:g} Hz" in [recording] if the sensor samples steadily, '
            "or record its own clock"
        )


def bunches(times: NDArray[np.int64]) -> Bunches | None:
    """Return how times [ns] come in bunches; None: they do not."""
    steps = np.diff(times)
    if len(steps) < 10 or not steps.max() > 0:
        return None
    period = steady_period(times)
    close = steps < CLOSE * period
    if close.mean() < BUNCHED:
        return None
    wait, span = float(np.median(steps[~close])), float(times[-1] - times[0])
    rates = [1e9 * len(steps) / (span + shift) for shift in (wait, -wait)]
    return Bunches(1e-9 * wait, roundest(1e9 * len(steps) / span, *rates) or 1e9 / period)


def roundest(rate: float, low: float, high: float) -> float | None:
    """Return the rate of fewest digits between two; None: not even six digits tell it."""
    for digits in range(1, 7):
        rounded = float(f"{rate:.{digits - 1}e}")
        if low <= rounded <= high:
            return rounded
    return None


def fit(device: NDArray[np.int64], arrival: NDArray[np.int64]) -> ClockFit:
    """The fit of a whole run: device times and arrival times [ns], shape (n,)."""
    if len(device) > 2:
        forward = np.concatenate([[True], device[1:] > np.maximum.accumulate(device)[:-1]])
        device, arrival = _below_chords(device[forward], arrival[forward])
    tracker = ClockTracker()
    for pair in zip(device.tolist(), arrival.tolist(), strict=True):
        tracker.add(*pair)
    return tracker.fit


def _below_chords(device: NDArray[np.int64], arrival: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Leave out points that are no corner of the hull: those not below the chord of their neighbours.

    All at once, and again as long as that leaves out many: the hull of the few that stay is the same, and the tracker
    takes a microsecond for each.
    """
    while (count := len(device)) > 2:
        run, rise = np.diff(device), np.diff(arrival) - np.diff(device)
        if float(run.max()) * float(np.abs(rise).max()) >= 2.0**62:
            break  # the products below would overflow
        corner = np.ones(count, bool)
        corner[1:-1] = rise[:-1] * run[1:] < rise[1:] * run[:-1]
        device, arrival = device[corner], arrival[corner]
        if len(device) > 0.9 * count:
            break
    return device, arrival
