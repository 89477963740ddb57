"""A kind of device and its emulator: parser, conversation and options under one name. No I/O."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, Literal, NamedTuple

from rig.devices.conversation import Conversation, Identity
from rig.devices.parser import Parser
from rig.exceptions import RigError, quoted

Measures = Literal["wrench", "imu", "joints", "values"]
WRENCH = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
IMU = ("omega_x", "omega_y", "omega_z", "specific_force_x", "specific_force_y", "specific_force_z")
LEAST_RATE, MOST_RATE = 0.1, 50_000.0
"""Sample rates [Hz] that a device may be asked for; dividers and periods in their commands are whole numbers."""


class Channel(NamedTuple):
    """Numbers of a sample that belong together and become one message.

    ``names`` are those of the numbers; of joints theirs, all positions before all velocities.
    """

    measures: Measures
    names: tuple[str, ...]

    @property
    def signals(self) -> tuple[str, ...]:
        """A name for each number."""
        if self.measures != "joints":
            return self.names
        return (*(f"position {name}" for name in self.names), *(f"velocity {name}" for name in self.names))


class Emulator(ABC):
    """The device's side of the line: answers commands and makes frames. No I/O, no clock.

    Attributes:
        device: at whose other end it is.
        streaming: whether the device sends samples now.
        rate: samples per second.
    """

    STREAMS: ClassVar[bool] = False  # whether it sends samples from its start on
    BOOT: ClassVar[bytes] = b""  # what it sends when its port is opened

    def __init__(self, device: "Device", *, rate: float) -> None:
        self.device = device
        self.rate = rate
        self.streaming = False
        self._heard = bytearray()

    def boot(self) -> bytes:
        """Bytes that the device sends when its port is opened."""
        self.streaming = self.streaming or self.STREAMS
        return self.BOOT

    def frames(
        self, data: bytes, head: bytes, length: Callable[[bytes], int], intact: Callable[[bytes], bool]
    ) -> Iterator[bytes]:
        """Yield the intact frames among the bytes that have been heard; one that is cut waits for its rest.

        Args:
            data: what came.
            head: first bytes of a frame.
            length: of the frame whose first four bytes are given.
            intact: whether a frame's checksum agrees.
        """
        self._heard += data
        while (start := self._heard.find(head)) >= 0 and len(self._heard) - start >= 4:
            end = start + length(bytes(self._heard[start : start + 4]))
            if len(self._heard) < end:
                return
            frame = bytes(self._heard[start:end])
            good = intact(frame)
            del self._heard[: end if good else start + 1]
            if good:
                yield frame

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Return the device's answer to these bytes; may switch ``streaming``."""

    def inquired(self, number: int, data: bytes) -> bytes:
        """Return the answer of a network device on its other TCP port ``number``; nothing if it has none."""
        return b""

    @abstractmethod
    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """The bytes of sample number ``index`` at device time ``time`` [s], values as in ``Sample``."""


class Device(ABC):
    """One kind of device with its options. Options are keyword arguments, checked against ``OPTIONS``."""

    MEASURES: ClassVar[Measures]
    BAUDRATE: ClassVar[int]
    FRAME_BYTES: ClassVar[int]  # of one sample, for its time on the wire
    OPTIONS: ClassVar[dict[str, object]] = {}
    PARSER: ClassVar[type[Parser]]  # of a device whose options change nothing of its frames
    ASKED: ClassVar[bool] = True  # whether ports are asked for it when devices are looked for
    SETTLING: ClassVar[float] = 0.0  # seconds that the device may take to boot after its port was opened
    NETWORK: ClassVar[Literal["", "udp", "tcp"]] = ""  # how a device on the network is spoken to
    NUMBER: ClassVar[int] = 0  # the port of a device on the network
    INQUIRIES: ClassVar[tuple[int, ...]] = ()  # its other TCP ports that the conversation asks
    ROBOT: ClassVar[bool] = False  # whether it may have turned and compensated the wrench: the rig file says how
    DECLARED: ClassVar[tuple[str, ...]] = ()  # options that a rig file must state
    END: ClassVar[bytes] = b""  # bytes to send at the end: no more samples
    names: tuple[str, ...] = ()  # of the values of a device that measures neither wrench nor motion

    def __init__(self, **options: object) -> None:
        for name, value in options.items():
            default = self.OPTIONS.get(name)
            if name not in self.OPTIONS:
                accepted = ", ".join(self.OPTIONS) or "none"
                raise RigError(f"unknown option {quoted(name)} of device kind '{self.kind}': it takes {accepted}")
            number = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
            if not number and type(value) is not type(default):
                raise RigError(
                    f"option '{name}' of device kind '{self.kind}' is {quoted(value)}: give a {_kind(default)}"
                )
        self.options = {**self.OPTIONS, **options}
        self._check_rate()

    def _check_rate(self) -> None:
        """Refuse a rate that no device has; where none need be given, 0 says that it is not known."""
        rate, default = self.options.get("rate", LEAST_RATE), self.OPTIONS.get("rate")
        if not ((isinstance(rate, int | float) and LEAST_RATE <= rate <= MOST_RATE) or rate == default):
            raise RigError(
                f"option 'rate' of device kind '{self.kind}' is out of range: "
                f"give a number from {LEAST_RATE:g} to {MOST_RATE:g} Hz"
            )

    @property
    def kind(self) -> str:
        """Name of the device's kind in a rig file: of its module, with ``-`` for ``_``."""
        return type(self).__module__.rpartition(".")[2].replace("_", "-")

    @property
    def measures(self) -> Measures:
        """Meaning of the samples."""
        return self.MEASURES

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Names of a sample's numbers, in their order; the first is the device's main quantity."""
        return (Channel(self.measures, {"wrench": WRENCH, "imu": IMU}.get(self.measures, self.names)),)

    @property
    def rate(self) -> float:
        """Samples per second that the device is asked for [Hz]; 0 when unknown."""
        rate = self.options.get("rate", 0.0)
        return float(rate) if isinstance(rate, int | float) else 0.0

    def rate_warnings(self, rate: float) -> list[str]:
        """Return a warning where the device can only send at another rate [Hz] than it is asked for."""
        return [] if abs(rate - self.rate) < 0.01 * self.rate else [f"it sends {rate:g} Hz, not {self.rate:g} Hz"]

    def parser(self) -> Parser:
        """Return a fresh parser."""
        return self.PARSER()

    @property
    def configured(self) -> bool:
        """Whether the device is asked and set up; not where the rig file says ``configure = false``."""
        return bool(self.options.get("configure", True))

    def start(self) -> Conversation:
        """Identify and configure the device and start its samples, or leave it as it is."""
        if not self.configured:
            return Identity(model=str(self.options.get("model", "")), settings={"configured": "no"})
        return (yield from self.conversation())

    def conversation(self) -> Conversation:
        """The conversation that identifies and configures the device and starts its samples."""
        return Identity()
        yield  # a generator that asks nothing

    def stop(self) -> bytes:
        """Return the bytes to send at the end."""
        return self.END if self.configured else b""

    def emulator(self, *, rate: float) -> Emulator:
        """Return an emulator of the device at the other end of the line: that of the device's module."""
        module = sys.modules[type(self).__module__]
        classes = (item for item in vars(module).values() if isinstance(item, type) and issubclass(item, Emulator))
        return next(item for item in classes if item.__module__ == module.__name__)(self, rate=rate)


def _kind(default: object) -> str:
    return {bool: "true or false", float: "number", int: "whole number", str: "text", list: "list"}[type(default)]
