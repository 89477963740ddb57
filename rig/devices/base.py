"""What every device has in common: samples, parser, start-up conversation, emulator. No I/O anywhere."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, field
from typing import ClassVar, Literal, NamedTuple, TypeVar

from rig.errors import RigError

Measures = Literal["wrench", "imu", "values"]


class Sample(NamedTuple):
    """One measurement.

    Attributes:
        values: wrench: Fx Fy Fz [N] Mx My Mz [N·m]; IMU: angular velocity [rad/s], specific force [m/s²], three each;
            otherwise the columns of a line in SI.
        time: device time [ns], unwrapped, or None.
        counter: the device's own counter, unwrapped, or None.
        flagged: the device says that this sample is out of range or invalid.
        end: number of bytes of the stream up to the end of the sample's frame.
        number: the counter, or without one the number of the sample, missing ones counted.
    """

    values: tuple[float, ...]
    time: int | None = None
    counter: int | None = None
    flagged: bool = False
    end: int = 0
    number: int = 0


@dataclass
class Counts:
    """What a parser has met. ``bytes = framed + skipped + pending`` always holds.

    Attributes:
        bytes: all bytes fed.
        framed: bytes of intact frames.
        skipped: bytes that belong to no intact frame.
        frames: intact frames, with or without a sample.
        samples: samples.
        failures: frames that stood where one was due and failed their checksum.
        resynchronisations: how often the parser lost the frames and found them again.
        missing: samples that the device's counter says it sent and that never came.
        flagged: samples that the device marked out of range or invalid.
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

    @abstractmethod
    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of the intact frame at ``start``; NO_FRAME when there is none; WAIT when bytes are still due."""

    @abstractmethod
    def samples(self, frame: bytes) -> Iterable[Sample]:
        """The samples of one intact frame."""

    @property
    def pending(self) -> int:
        """The number of bytes that wait for the rest of their frame."""
        return len(self._buffer)

    def begin(self) -> None:
        """Count anew from here; what was missing before does not count, device clocks go on."""
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
        found = self._drain(final=True)
        self._synchronised = False
        return found

    def _drain(self, *, final: bool) -> list[Sample]:
        buffer, found = self._buffer, list[Sample]()
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
                self._accept(bytes(buffer[start : start + length]), found)
                position += length
            else:
                self._reject(cut=length == WAIT)
                position += 1
        self._consume(position)
        return found

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

    def _accept(self, frame: bytes, found: list[Sample]) -> None:
        counts = self.counts
        self._done += len(frame)
        counts.framed += len(frame)
        counts.frames += 1
        counts.resynchronisations += self._lost
        self._synchronised, self._lost = True, False
        for sample in self.samples(frame):
            counts.samples += 1
            counts.flagged += sample.flagged
            if sample.counter is not None:
                number = self._unwrap(sample.counter)
                found.append(sample._replace(end=self._done, number=number, counter=number))
                continue
            if sample.time is not None and self._period:
                self._count_missing(sample.time)
            found.append(sample._replace(end=self._done, number=counts.samples + counts.missing - 1))

    def _count_missing(self, time: int) -> None:
        if self._time is not None:
            self.counts.missing += max(0, round((time - self._time) / self._period) - 1)
        self._time = time

    def _unwrap(self, raw: int) -> int:
        """The counter without its wraps; counts what is missing in between."""
        if self._counter is None:
            self._counter = raw
            return raw
        step = (raw - self._counter) % self.MODULUS
        if step > self.MODULUS // 2:
            step -= self.MODULUS
        self.counts.missing += max(0, step - 1)
        self._counter += step
        return self._counter

    def _consume(self, count: int) -> None:
        del self._buffer[:count]


class Unwrapper:
    """A device clock of ``modulus`` ticks, continued beyond its wraps; small steps back stay steps back."""

    def __init__(self, modulus: int) -> None:
        self._modulus = modulus
        self._last: int | None = None

    def __call__(self, raw: int) -> int:
        """The unwrapped value of a raw reading."""
        if self._last is None:
            self._last = raw
            return raw
        step = (raw - self._last) % self._modulus
        if step > self._modulus // 2:
            step -= self._modulus
        self._last += step
        return self._last


class Send(NamedTuple):
    """Ask the port to send these bytes."""

    data: bytes


class Listen(NamedTuple):
    """Ask the port for what arrives within so many seconds; it answers ``(bytes, seconds it took)`` at the first."""

    seconds: float


@dataclass(frozen=True)
class Identity:
    """Who answered: model, serial number, firmware, and the settings it reported back.

    ``extra`` are facts that the parser needs (see each device); ``warnings`` go to the user and into the file.
    """

    model: str = ""
    serial: str = ""
    firmware: str = ""
    settings: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


class NoAnswerError(RigError):
    """The device did not answer in time; ``heard`` says whether any bytes came."""

    def __init__(self, message: str, heard: int) -> None:
        super().__init__(message)
        self.heard = heard


Conversation = Generator[Send | Listen, tuple[bytes, float], Identity]
T = TypeVar("T")
Heard = tuple[bytes, float]


def ask(
    command: bytes, find: Callable[[bytes], T | None], *, seconds: float = 0.5, tries: int = 3
) -> Generator[Send | Listen, Heard, T]:
    """Send a command until ``find`` recognises the answer in the bytes heard since.

    Raises:
        NoAnswerError: no answer in any try.
    """
    heard = b""
    for _ in range(tries):
        yield Send(command)
        left = seconds
        while left > 0:
            data, took = yield Listen(left)
            heard += data
            left -= took
            answer = find(heard)
            if answer is not None:
                return answer
    raise NoAnswerError(f"no answer to {command!r}", len(heard))


class Emulator(ABC):
    """The device's side of the line: answers commands and makes frames. No I/O, no clock.

    Attributes:
        streaming: whether the device sends samples now.
        rate: samples per second.
    """

    def __init__(self, *, rate: float) -> None:
        self.rate = rate
        self.streaming = False
        self._heard = bytearray()

    def boot(self) -> bytes:
        """What the device says when its port is opened."""
        return b""

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """What the device answers to these bytes; may switch ``streaming``."""

    @abstractmethod
    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """The bytes of sample number ``index`` at device time ``time`` [s], values as in ``Sample``."""


class Device(ABC):
    """One kind of device with its options. Options are keyword arguments, checked against ``OPTIONS``."""

    KIND: ClassVar[str]
    MEASURES: ClassVar[Measures]
    BAUDRATE: ClassVar[int]
    FRAME_BYTES: ClassVar[int]  # of one sample, for its time on the wire
    OPTIONS: ClassVar[dict[str, object]] = {}
    SETTLING: ClassVar[float] = 0.0  # seconds that the device may take to boot after its port was opened

    def __init__(self, **options: object) -> None:
        for name, value in options.items():
            default = self.OPTIONS.get(name)
            if name not in self.OPTIONS:
                known = ", ".join(self.OPTIONS) or "none"
                raise RigError(f"unknown option '{name}' of device kind '{self.KIND}': it takes {known}")
            number = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
            if not number and type(value) is not type(default):
                raise RigError(f"option '{name}' of device kind '{self.KIND}' is {value!r}: give a {_kind(default)}")
        self.options = {**self.OPTIONS, **options}

    @property
    def measures(self) -> Measures:
        """What the samples mean."""
        return self.MEASURES

    @property
    def rate(self) -> float:
        """Samples per second that the device is asked for [Hz]; 0 when unknown."""
        rate = self.options.get("rate", 0.0)
        return float(rate) if isinstance(rate, int | float) else 0.0

    @abstractmethod
    def parser(self) -> Parser:
        """A fresh parser."""

    def start(self) -> Conversation:
        """The conversation that identifies and configures the device and starts its samples."""
        return Identity()
        yield  # a generator that asks nothing

    def stop(self) -> bytes:
        """What to send at the end."""
        return b""

    @abstractmethod
    def emulator(self, *, rate: float) -> Emulator:
        """The other end of the line."""


def _kind(default: object) -> str:
    return {bool: "true or false", float: "number", int: "whole number", str: "text", list: "list"}[type(default)]
