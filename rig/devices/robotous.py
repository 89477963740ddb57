"""Robotous RFT series: load cell, commands of 11 bytes and replies of 19 between 55 and AA with an eight-bit sum.

Reply ``55 | D1..D16 | sum8(D1..D16) | AA``; D1 is the id; for a sample (10, 11) D2..D13 are Fx Fy Fz Tx Ty Tz as i16
big-endian, D14 the overload bits. There is no time stamp and no counter: a lost frame shows in host time only. The sum
is weak, so that both delimiters and a known id are demanded too.
"""

import struct
from collections.abc import Callable, Generator
from functools import partial
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.conversation import Conversation, Heard, Identity, Listen, Send, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample
from rig.exceptions import RigError

MODEL, SERIAL, FIRMWARE, GET_FILTER, SET_RATE, GET_RATE, ONE, START, STOP = 1, 2, 3, 8, 15, 16, 10, 11, 12
KNOWN = frozenset([1, 2, 3, 6, 7, 8, 9, 10, 11, 15, 16, 18])
LENGTH = 19
FORCE_DIVISOR = 50.0
FINE_DIVISOR = 2000.0
RATES = {200: 0, 333: 6, 500: 7, 1000: 8}
COARSE_MODELS = ("RFT82-HA02", "RFT80-6A01")  # torque in 1/1000 N·m; the others in 1/2000
SAMPLE = struct.Struct(">6h")


def command(number: int, *parameters: int) -> bytes:
    """The 11 bytes of a command."""
    data = bytes([number, *parameters]).ljust(8, b"\0")
    return b"\x55" + data + bytes([sum(data) & 0xFF]) + b"\xaa"


def reply(number: int, data: bytes) -> bytes:
    """The 19 bytes of a reply."""
    body = bytes([number]) + data.ljust(15, b"\0")
    return b"\x55" + body + bytes([sum(body) & 0xFF]) + b"\xaa"


def encode(values: tuple[float, ...], *, overload: int = 0) -> bytes:
    """A sample [N, N·m] as a reply, rounded to the sensor's resolution and limited to its range."""
    scaled = [v * FORCE_DIVISOR for v in values[:3]] + [v * FINE_DIVISOR for v in values[3:]]
    raw = [max(-32768, min(32767, round(v))) for v in scaled]
    return reply(START, SAMPLE.pack(*raw) + bytes([overload]))


def find_reply(data: bytes, number: int) -> bytes | None:
    """D2..D16 of the first intact reply with this id."""
    return next((frame[2:17] for frame in RobotousParser().frames(data) if frame[1] == number), None)


class RobotousParser(Parser):
    """Replies to samples; other replies are passed over."""

    START = b"\x55"

    def __init__(self, torque_divisor: float = FINE_DIVISOR) -> None:
        super().__init__()
        self._divisor = torque_divisor

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """19 where delimiters, id and sum agree."""
        frame = buffer[start : start + LENGTH]
        if len(frame) < LENGTH:
            return WAIT
        intact = frame[18] == 0xAA and frame[1] in KNOWN and sum(frame[1:17]) & 0xFF == frame[17]
        return LENGTH if intact else NO_FRAME

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a reply with id 10 or 11."""
        if frame[1] not in (ONE, START):
            return []
        raw = SAMPLE.unpack_from(frame, 2)
        force = tuple(v / FORCE_DIVISOR for v in raw[:3])
        torque = tuple(v / self._divisor for v in raw[3:])
        return [Sample(force + torque, flagged=frame[14] != 0)]


def _ask(number: int, *parameters: int, before: bytes = b"") -> Generator[Send | Listen, Heard, bytes]:
    """Send a command, after other bytes, until it is answered; returns D2..D16 of the reply."""
    find: Callable[[bytes], bytes | None] = partial(find_reply, number=number)
    return (yield from ask(before + command(number, *parameters), find))


class Robotous(Device):
    """Options: ``rate`` 200, 333, 500 (from 230400 baud) or 1000 Hz (921600 baud only); ``model``; ``configure``.

    ``model`` decides the torque's scale where the sensor is not asked.
    """

    MEASURES = "wrench"
    END = command(STOP)
    BAUDRATE = 115200
    FRAME_BYTES = LENGTH
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 200.0, "model": "", "configure": True}

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        self._model = str(self.options["model"])
        if round(self.rate) not in RATES:
            raise RigError(f"option 'rate' of a Robotous is {self.rate:g}: choose one of {', '.join(map(str, RATES))}")

    def parser(self) -> RobotousParser:
        """A fresh parser with the torque scale of the model."""
        return RobotousParser(1000.0 if self._model.startswith(COARSE_MODELS) else FINE_DIVISOR)

    def conversation(self) -> Conversation:
        """Stop, ask model, serial number, firmware, filter; set the rate and read it back; start."""
        model = yield from _ask(MODEL, before=command(STOP))
        serial = yield from _ask(SERIAL)
        firmware = yield from _ask(FIRMWARE)
        filter_code = yield from _ask(GET_FILTER)
        code = RATES[round(self.rate)]
        yield from _ask(SET_RATE, code)
        rate = yield from _ask(GET_RATE)
        self._model = self._model or _text(model)
        yield from _ask(START)
        return Identity(
            model=self._model,
            serial=_text(serial),
            firmware=_text(firmware),
            settings={"filter": filter_code[:2].hex(" "), "rate_code": str(rate[0]), "rate_hz": f"{self.rate:g}"},
            warnings=self._warnings(filter_code, rate[0], code),
        )

    def _warnings(self, filter_code: bytes, rate_code: int, wanted: int) -> tuple[str, ...]:
        warnings = []
        if filter_code[0]:
            warnings.append(f"filter code {filter_code[1]} is on: the vendor's documents disagree on what it means")
        if rate_code != wanted:
            warnings.append(f"rate code {rate_code} read back, {wanted} was set: the baud rate may be too low")
        return tuple(warnings)


def _text(data: bytes) -> str:
    return data.split(b"\0")[0].decode("ascii", "replace").strip()


class RobotousEmulator(Emulator):
    """An RFT64-SB01 that answers the commands above."""

    def __init__(self, device: Device, *, rate: float) -> None:
        super().__init__(device, rate=rate)
        self._rate_code = 0

    def receive(self, data: bytes) -> bytes:
        """Answer every intact command."""
        frames = self.frames(data, b"\x55", lambda _: 11, lambda frame: frame == command(*frame[1:9]))
        return b"".join(self._answer(frame[1], frame[2]) for frame in frames)

    def _answer(self, number: int, parameter: int) -> bytes:
        texts = {MODEL: b"RFT64-SB01", SERIAL: b"E-0002", FIRMWARE: b"0.0"}
        if number in (START, STOP):
            self.streaming = number == START
            return b""
        if number == SET_RATE:
            self._rate_code = parameter
            self.rate = {code: rate for rate, code in RATES.items()}.get(parameter, 200)
        if number == GET_RATE:
            return reply(number, bytes([self._rate_code]))
        return reply(number, texts.get(number, b""))

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One sample reply."""
        return encode(values)
