"""Xsens MTi, MTData2: IMU, ``FA | FF | MID | LEN | payload | CS``; bytes from the bus id to CS sum to 0 modulo 256.

The payload of MID 36 repeats {u16 id, u8 length, data}, big-endian. The low nibble of an id gives the number format:
bits 0 and 1: 0 f32, 1 FP12.20, 2 FP16.32, 3 f64; bits 2 and 3: the frame.
"""

import struct
from collections.abc import Callable, Generator, Iterator
from functools import partial
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.conversation import Conversation, Heard, Identity, Listen, Send, ascii_text, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample, Unwrapper

MTDATA2, ERROR = 0x36, 0x42
WAKE_UP = 0x3E
COMMANDS = GOTO_CONFIG, GOTO_MEASUREMENT, SET_OUTPUT, REQUEST_ID, REQUEST_PRODUCT, REQUEST_FIRMWARE = (
    0x30, 0x10, 0xC0, 0x00, 0x1C, 0x12
)  # fmt: skip
KNOWN = frozenset([MTDATA2, ERROR, WAKE_UP, *(command + 1 for command in COMMANDS)])
"""Ids of the messages that come from the device: the answer to a command has the id that follows the command's."""
COUNTER, TIME_FINE, ACCELERATION, RATE, STATUS = 0x1020, 0x1060, 0x4020, 0x8020, 0xE020
CLIPPING = 0x0FF << 8  # clip flags of the status word: bits 8 to 16
LONGEST = 2048


def message(mid: int, payload: bytes = b"") -> bytes:
    """A message with its length and checksum."""
    length = bytes([len(payload)]) if len(payload) < 255 else b"\xff" + struct.pack(">H", len(payload))
    body = bytes([0xFF, mid]) + length + payload
    return b"\xfa" + body + bytes([-sum(body) & 0xFF])


def items(payload: bytes) -> list[tuple[int, bytes]] | None:
    """The (id, data) pairs of an MTData2 payload, or None when they do not fill it exactly."""
    pairs, position, end = [], 0, len(payload)
    while position + 3 <= end:
        identifier, length = payload[position] << 8 | payload[position + 1], payload[position + 2]
        pairs.append((identifier, payload[position + 3 : position + 3 + length]))
        position += 3 + length
    return pairs if position == end else None


def numbers(identifier: int, data: bytes) -> tuple[float, ...]:
    """The numbers of an item in the format that its id names."""
    form = identifier & 3
    if form == 0:
        return struct.unpack(f">{len(data) // 4}f", data)
    if form == 1:
        return tuple(v / 2**20 for v in struct.unpack(f">{len(data) // 4}i", data))
    if form == 2:
        return tuple(integer + fraction / 2**32 for fraction, integer in struct.iter_unpack(">Ih", data))
    return struct.unpack(f">{len(data) // 8}d", data)


_SIZES = (12, 12, 18, 24)


def _vector(items_by_id: dict[int, bytes], identifier: int) -> tuple[float, ...] | None:
    for key, data in items_by_id.items():
        if key & 0xFFF0 == identifier and len(data) == _SIZES[key & 3]:
            return numbers(key, data)
    return None


def encode(counter: int, time_fine: int, rate: tuple[float, ...], acceleration: tuple[float, ...]) -> bytes:
    """An MTData2 message with counter, time [1e-4 s], rate [rad/s] and acceleration [m/s²] as f32."""
    return message(
        MTDATA2,
        struct.pack(">HBH", COUNTER, 2, counter % 2**16)
        + struct.pack(">HBI", TIME_FINE, 4, time_fine % 2**32)
        + struct.pack(">HB3f", ACCELERATION, 12, *acceleration)
        + struct.pack(">HB3f", RATE, 12, *rate)
        + struct.pack(">HBI", STATUS, 4, 0),
    )


class XsensParser(Parser):
    """Messages to samples; a sample needs acceleration and rate of turn in one message."""

    START = b"\xfa"
    MODULUS = 2**16

    def __init__(self) -> None:
        super().__init__()
        self._clock = Unwrapper(2**32)

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length where bus id, message id, sum and the payload's own structure agree."""
        head = buffer[start : start + 6]
        if (len(head) > 1 and head[1] != 0xFF) or (len(head) > 2 and head[2] not in KNOWN):
            return NO_FRAME
        if len(head) < 4 or (head[3] == 0xFF and len(head) < 6):
            return WAIT
        extended = head[3] == 0xFF
        size = head[4] << 8 | head[5] if extended else head[3]
        offset = 6 if extended else 4
        if size > LONGEST or (extended and size < 255):
            return NO_FRAME
        end = start + offset + size + 1
        if len(buffer) < end:
            return WAIT
        if sum(buffer[start + 1 : end]) & 0xFF:
            return NO_FRAME
        if head[2] == MTDATA2 and items(bytes(buffer[start + offset : end - 1])) is None:
            return NO_FRAME
        return end - start

    def samples(self, frame: bytes) -> Iterator[Sample]:
        """The sample of an MTData2 message that carries both rate and acceleration."""
        items_by_id = payload(frame)
        rate, acceleration = _vector(items_by_id, RATE), _vector(items_by_id, ACCELERATION)
        time, counter, status = items_by_id.get(TIME_FINE), items_by_id.get(COUNTER), items_by_id.get(STATUS)
        if rate is None or acceleration is None:
            if counter and len(counter) == 2:  # it counts messages, whatever they carry
                self.pass_over(int.from_bytes(counter, "big"))
            return
        yield Sample(
            rate + acceleration,
            time=self._clock(int.from_bytes(time, "big")) * 100_000 if time and len(time) == 4 else None,
            counter=int.from_bytes(counter, "big") if counter and len(counter) == 2 else None,
            flagged=bool(status and int.from_bytes(status, "big") & CLIPPING),
        )


def payload(frame: bytes) -> dict[int, bytes]:
    """The items of an intact MTData2 message by id."""
    return dict(items(frame[6:-1] if frame[3] == 0xFF else frame[4:-1]) or []) if frame[2] == MTDATA2 else {}


def find_message(data: bytes, mid: int) -> bytes | None:
    """The payload of the first intact message with this id."""
    return next((frame[4:-1] for frame in XsensParser().frames(data) if frame[2] == mid), None)


def _ask(command: int, content: bytes = b"", *, tries: int = 3) -> Generator[Send | Listen, Heard, bytes]:
    """Send a command until it is answered; returns the payload of the answer."""
    find: Callable[[bytes], bytes | None] = partial(find_message, mid=command + 1)
    return (yield from ask(message(command, content), find, tries=tries))


class Xsens(Device):
    """Options: ``rate`` [Hz] of acceleration and rate of turn; ``configure``."""

    MEASURES = "imu"
    END = message(GOTO_CONFIG)
    PARSER = XsensParser
    BAUDRATE = 115200
    FRAME_BYTES = 53
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 100.0, "configure": True}

    def conversation(self) -> Conversation:
        """Configuration state, who are you, output configuration and what it became, measurement state."""
        yield from _ask(GOTO_CONFIG, tries=6)
        serial = yield from _ask(REQUEST_ID)
        product = yield from _ask(REQUEST_PRODUCT)
        firmware = yield from _ask(REQUEST_FIRMWARE)
        answer = yield from _ask(SET_OUTPUT, self._outputs())
        yield from _ask(GOTO_MEASUREMENT)
        settings = {f"{i:04X}_hz": str(rate) for i, rate in struct.iter_unpack(">HH", answer[: len(answer) // 4 * 4])}
        wanted = round(self.rate)
        warnings = tuple(
            f"{i:04X} is sent at {settings.get(f'{i:04X}_hz', 'no')} Hz, {wanted} Hz was asked for"
            for i in (ACCELERATION, RATE)
            if settings.get(f"{i:04X}_hz") != str(wanted)
        )
        return Identity(
            model=ascii_text(product),
            serial=serial.hex().upper(),
            firmware=".".join(str(b) for b in firmware[:3]),
            settings=settings,
            warnings=warnings,
        )

    def _outputs(self) -> bytes:
        rate = round(self.rate)
        pairs = [(COUNTER, 0xFFFF), (TIME_FINE, 0xFFFF), (ACCELERATION, rate), (RATE, rate), (STATUS, 0xFFFF)]
        return b"".join(struct.pack(">HH", *pair) for pair in pairs)


class XsensEmulator(Emulator):
    """An MTi that takes the conversation above; it streams after a wake-up as the real one does."""

    STREAMS = True
    BOOT = message(WAKE_UP)

    def receive(self, data: bytes) -> bytes:
        """Acknowledge every intact message."""
        frames = self.frames(data, b"\xfa\xff", lambda head: head[3] + 5, lambda frame: not sum(frame[1:]) & 0xFF)
        return b"".join(self._answer(frame[2], frame[4:-1]) for frame in frames)

    def _answer(self, mid: int, data: bytes) -> bytes:
        if mid in (GOTO_CONFIG, GOTO_MEASUREMENT):
            self.streaming = mid == GOTO_MEASUREMENT
        if mid == SET_OUTPUT:
            rates = dict(struct.iter_unpack(">HH", data))
            self.rate = float(rates.get(ACCELERATION, self.rate))
            return message(mid + 1, data)
        facts = {REQUEST_ID: b"\0\0\0\x01", REQUEST_PRODUCT: b"MTi-emulated", REQUEST_FIRMWARE: b"\0\0\0"}
        return message(mid + 1, facts.get(mid, b""))

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One MTData2 message."""
        return encode(index, round(time * 1e4), values[:3], values[3:])
