"""A device's clock against the host's, fitted to the fastest arrivals: the delayed ones do not bias the fit."""

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

    def jumps(self, device: int, arrival: int) -> bool:
        """Whether a device time [ns] cannot belong to the clock so far: far back, or measured long after it arrived."""
        if self._last is None or abs(device) > LARGEST:
            return abs(device) > LARGEST
        return device < self._last[0] - JUMP or self.fit.host(device) > arrival + JUMP

    def stamp(self, device: int, arrival: int) -> int:
        """Take a sample and return its time of measurement in host time [ns].

        The fit falls as faster samples arrive. Stamps follow it at half the device's pace, so that none steps back.
        """
        self.add(device, arrival)
        stamp = self.fit.host(device)
        if self._last is not None and device > self._last[0]:
            stamp = max(stamp, self._last[1] + (device - self._last[0] + 1) // 2)
        self._last = device, stamp
        return stamp


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
