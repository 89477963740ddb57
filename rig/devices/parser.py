"""The conversion of a stream of bytes to samples that all parsers share, whatever the device. No I/O."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from numbers import Integral
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Sample(NamedTuple):
    """One measurement of a device.

    Attributes:
        values: wrench: Fx Fy Fz [N] Mx My Mz [N·m]; IMU: angular velocity [rad/s], specific force [m/s²], three each;
            otherwise the columns of a line in SI.
        time: device time [ns], unwrapped, or None.
        counter: the device's own counter, unwrapped, or None.
        flagged: the device says that this sample is out of range or invalid.
        end: number of bytes of the stream up to the end of the sample's frame.
        number: the number of the sample, missing ones counted: by the counter where the device has one.
        gap: how many samples are missing before it by the device's clock, where it has no counter.
    """

    values: tuple[float, ...]
    time: int | None = None
    counter: int | None = None
    flagged: bool = False
    end: int = 0
    number: int = 0
    gap: int = 0


def turned(matrix: NDArray[np.float64], values: tuple[float, ...]) -> tuple[float, ...]:
    """Return the values with the first two vectors multiplied by a matrix (3, 3), whatever numbers these are."""
    with np.errstate(all="ignore"):
        vectors = np.reshape(values[:6], (2, 3)) @ matrix.T
    return (*vectors.ravel().tolist(), *values[6:])


@dataclass
class Counts:
    """Counts of the bytes and frames that a parser has met.

    Bytes that are neither framed nor skipped wait for the rest of their frame.

    Attributes:
        bytes: all bytes fed.
        framed: bytes of intact frames.
        skipped: bytes that belong to no intact frame.
        frames: intact frames, with or without a sample.
        samples: samples.
        failures: frames that stood where one was due and failed their checksum.
        resynchronisations: how often the parser lost the frames and found them again.
        missing: messages that the device's counter says it sent and that never came.
        flagged: samples that the device marked out of range or invalid.
        reordered: datagrams that came after a later one; one that came too late to be put in its place is ``missing``.
        repeated: datagrams that came twice; the second is not a sample.
    """

    bytes: int = 0
    framed: int = 0
    skipped: int = 0
    frames: int = 0
    samples: int = 0
    failures: int = 0
    resynchronisations: int = 0
    missing: int = 0
    flagged: int = 0
    reordered: int = 0
    repeated: int = 0


WAIT, NO_FRAME = -1, 0


class Parser(ABC):
    """Finds frames in a stream of bytes, however it is cut into pieces; never raises on any input.

    A subclass gives ``START``, ``frame_length`` and ``samples``. Missing samples are counted by the device's counter,
    or by its clock where ``period`` [ns] is known (0: unknown).
    """

    START: ClassVar[bytes] = b""
    MODULUS: ClassVar[int] = 0  # the counter of the device wraps here; 0: it has none

    def __init__(self, period: int = 0) -> None:
        self.counts = Counts()
        self._period = period
        self._time: int | None = None
        self._buffer = bytearray()
        self._done = 0
        self._synchronised = False
        self._lost = False
        self._counter: int | None = None
        self._without_sample = 0

    @abstractmethod
    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of the intact frame at ``start``; NO_FRAME when there is none; WAIT when bytes are still due."""

    @abstractmethod
    def samples(self, frame: bytes) -> Iterable[Sample]:
        """The samples of one intact frame."""

    def frames(self, data: bytes) -> Iterator[bytes]:
        """The intact frames in these bytes, for who looks for an answer; nothing is counted."""
        buffer, position = bytearray(data), 0
        while (position := self._find(buffer, position)) < len(buffer):
            length = max(self.frame_length(buffer, position), 0)
            if length:
                yield bytes(buffer[position : position + length])
            position += length or 1

    def begin(self) -> None:
        """Restart the counts here; what was missing before does not count, device clocks go on."""
        self.counts = Counts(bytes=len(self._buffer))
        self._done, self._lost = 0, False
        self._time = self._counter = None

    def feed(self, data: bytes) -> list[Sample]:
        """The samples that are complete with these bytes."""
        self.counts.bytes += len(data)
        self._buffer += data
        return self._drain(final=False)

    def finish(self) -> list[Sample]:
        """The stream has ended: give up waiting for the rest of a frame."""
        samples = self._drain(final=True)
        self._synchronised = False
        return samples

    def _drain(self, *, final: bool) -> list[Sample]:
        buffer, samples = self._buffer, list[Sample]()
        position, end = 0, len(self._buffer)
        while position < end:
            start = self._find(buffer, position)
            self._skip(start - position)
            position = start
            if start == end:
                break
            length = self.frame_length(buffer, start)
            if length == WAIT and not final:
                break
            if length > 0:
                self._accept(bytes(buffer[start : start + length]), samples)
                position += length
            else:
                self._reject(cut=length == WAIT)
                position += 1
        del buffer[:position]
        return samples

    def _find(self, buffer: bytearray, position: int) -> int:
        start = buffer.find(self.START, position)
        return len(buffer) if start < 0 else start

    def _skip(self, count: int) -> None:
        self.counts.skipped += count
        self._done += count
        if count and self._synchronised:
            self._synchronised, self._lost = False, True

    def _reject(self, count: int = 1, *, cut: bool = False) -> None:
        self.counts.failures += self._synchronised and not cut
        self._skip(count)

    def _count(self, frame: bytes) -> None:
        self._done += len(frame)
        self.counts.framed += len(frame)
        self.counts.frames += 1
        self.counts.resynchronisations += self._lost
        self._synchronised, self._lost = True, False

    def _accept(self, frame: bytes, samples: list[Sample]) -> None:
        counts = self.counts
        self._count(frame)
        for sample in self.samples(frame):
            counts.samples += 1
            counts.flagged += sample.flagged
            if sample.counter is not None:
                counter = self._unwrap(int(sample.counter))
                number = counter - self._without_sample
                samples.append(sample._replace(end=self._done, number=number, counter=counter))
                continue
            gap = self._gap(sample.time) if isinstance(sample.time, Integral) and self._period else 0
            counts.missing += gap
            samples.append(sample._replace(end=self._done, number=counts.samples + counts.missing - 1, gap=gap))

    def _gap(self, time: int) -> int:
        """Samples that are missing since the one before, by the device's clock."""
        before, self._time = self._time, time
        return 0 if before is None else max(0, round((time - before) / self._period) - 1)

    def pass_over(self, raw: int) -> None:
        """Take the counter of a message that carries no sample: it is counted, and none is missing."""
        before = self._counter
        if self._unwrap(raw) != before:
            self._without_sample += 1

    def modulus(self, raw: int) -> int:
        """Value at which the counter wraps, as this reading shows it."""
        return self.MODULUS

    def _unwrap(self, raw: int) -> int:
        """The counter without its wraps; counts what is missing in between."""
        if self._counter is None:
            self._counter = raw
            return raw
        before, self._counter = self._counter, unwrapped(raw, self._counter, self.modulus(raw))
        self.counts.missing += max(0, self._counter - before - 1)
        return self._counter


def unwrapped(raw: int, before: int, modulus: int) -> int:
    """Return a counter that wraps at ``modulus`` as the number next to the one before."""
    step = (raw - before) % modulus
    return before + step - (modulus if step > modulus // 2 else 0)


class Unwrapper:
    """A device clock of ``modulus`` ticks, continued beyond its wraps; small steps back stay steps back."""

    def __init__(self, modulus: int) -> None:
        self._modulus = modulus
        self._last: int | None = None

    def __call__(self, raw: int) -> int:
        """The unwrapped value of a raw reading."""
        self._last = raw if self._last is None else unwrapped(raw, self._last, self._modulus)
        return self._last
