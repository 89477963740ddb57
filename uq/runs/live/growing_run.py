"""A growing recording cut into blocks that join without a seam.

A block comes with as many samples before and behind it as resampling, differentiator and filter reach. Its rows are
then those that the whole run gives: on common, uniform instants exactly, else but for the spline's grid.
"""

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np

from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import lowpass
from identify.signals.resample import UNEQUAL, interval
from identify.signals.run import Run, RunError
from rig import channels
from rig.bags.marks import Notes
from rig.bags.topics import Contents
from rig.channels import ImuChannel, WrenchChannel
from uq.experiment.recording_table import RecordingTable
from uq.runs.identification.recorded_sums import SPLINE
from uq.runs.recorded.load_run import of_channels

BLOCK = 2.0
"""Seconds of a block."""
AnyChannel = TypeVar("AnyChannel", WrenchChannel, ImuChannel)
NOTHING_NOTED = Notes((), ())


class Block(NamedTuple):
    """A block of a run with its surroundings: the rows from ``begin`` to before ``end`` [s] are the block's."""

    run: Run
    begin: float
    end: float


class GrowingRun:
    """Collects samples as they come and gives them back as blocks; it holds one block and its surroundings.

    Attributes:
        seconds: how long the sensors have run.
        troubles: blocks that could not be used, and why, a line each.
    """

    def __init__(
        self,
        path: Path,
        recording: RecordingTable,
        estimator: EstimatorSpec,
        topics: tuple[str, str],
        *,
        gravity: float = STANDARD_GRAVITY,
        delay: float = 0.0,
    ) -> None:
        """Name the run.

        Args:
            path: of its file, for messages.
            recording: what its channels mean.
            estimator: its differentiator and filter.
            topics: of load cell and IMU.
            gravity: its local size [m/s²].
            delay: largest delay of the IMU at which sums are taken [s].
        """
        self._path, self._estimator, self._topics, self._delay = path, estimator, topics, delay
        self._gravity = gravity
        self._recording = msgspec.structs.replace(recording, time=recording.time or "header")
        self._wrench: WrenchChannel | None = None
        self._imu: ImuChannel | None = None
        self._start: int | None = None
        self._next = 0.0
        self._margin: float | None = None
        self.seconds = 0.0
        self.troubles: list[str] = []

    def add(self, contents: Contents) -> None:
        """Take the messages that have come."""
        wrench_topic, imu_topic = self._topics
        if wrench_topic in contents.topics:
            self._wrench = _joined(self._wrench, contents.wrench(wrench_topic))
        if imu_topic in contents.topics:
            self._imu = _joined(self._imu, contents.imu(imu_topic))

    def blocks(self, metadata: dict[str, dict[str, str]], *, ended: bool = False) -> Iterator[Block]:
        """Yield the blocks that are whole; where the run has ended, the rest of it too."""
        if self._wrench is None or self._imu is None or min(len(self._wrench.stamp), len(self._imu.stamp)) < 2:
            return
        wrench_times, imu_times = (self._times(channel) for channel in (self._wrench, self._imu))
        if self._start is None:
            self._start = min(int(wrench_times[0]), int(imu_times[0]))
        last = 1e-9 * (min(int(wrench_times[-1]), int(imu_times[-1])) - self._start)
        self.seconds = max(self.seconds, last)
        if self._margin is None and (last >= BLOCK or ended):
            self._margin = self._reach(wrench_times, imu_times)
        while self._margin is not None and (last >= self._next + BLOCK + self._margin or (ended and last > self._next)):
            final = ended and last < self._next + BLOCK + self._margin
            begin, end = self._next, np.inf if final else self._next + BLOCK
            try:
                yield Block(self._window(metadata, begin - self._margin, end + self._margin), begin, end)
            except RunError as error:
                self.troubles.append(f"from {begin:.0f} s on, {BLOCK:g} s cannot be used: {error}")
            self._next = end
            self._wrench = self._part(self._wrench, end - self._margin, np.inf)
            self._imu = self._part(self._imu, end - self._margin, np.inf)

    def _times(self, channel: WrenchChannel | ImuChannel) -> np.ndarray:
        return channel.stamp if self._recording.time == "header" else channel.log_time

    def _reach(self, wrench_times: np.ndarray, imu_times: np.ndarray) -> float:
        """Return the time by which the rows of a block reach beyond it [s]."""
        intervals = [interval(1e-9 * (times - times[0])) for times in (wrench_times, imu_times)]
        step = max(intervals)
        reach = step * (self._estimator.lost(1 / step) // 2 + 1)
        if step > UNEQUAL * min(intervals):
            reach += max((len(lowpass(1 / period, 0.5 / step)) // 2) * period for period in intervals)
        return reach + self._delay + SPLINE * step

    def _window(self, metadata: dict[str, dict[str, str]], begin: float, end: float) -> Run:
        assert self._wrench is not None  # noqa: S101 - of blocks
        assert self._imu is not None  # noqa: S101
        bag = channels.Recording(
            self._path, "", metadata, self._part(self._wrench, begin, end), self._part(self._imu, begin, end)
        )
        band = self._estimator.band
        return of_channels(bag, self._recording, NOTHING_NOTED, gravity=self._gravity, band=band, start=self._start).run

    def _part(self, channel: AnyChannel, begin: float, end: float) -> AnyChannel:
        assert self._start is not None  # noqa: S101 - of blocks
        t = 1e-9 * (self._times(channel) - self._start)
        return channel.taken((t >= begin) & (t <= end))


def _joined(before: AnyChannel | None, after: AnyChannel) -> AnyChannel:
    if before is None:
        return after
    arrays = {field.name: getattr(before, field.name) for field in fields(before)}
    joined: dict[str, Any] = {
        name: np.concatenate([values, getattr(after, name)])
        for name, values in arrays.items()
        if isinstance(values, np.ndarray)
    }
    return replace(before, **joined)
