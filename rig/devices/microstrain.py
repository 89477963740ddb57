"""MicroStrain MIP (3DM-GX5, CX5, CV5, CV7): IMU, ``75 65 | set | length | fields | c1 c2`` with a Fletcher sum.

A field is ``length (its own two bytes included) | descriptor | data``, big-endian. Set 80 carries 04 acceleration in g,
05 angular rate in rad/s, D5 device time u64 [ns]. Older models without D5 send 12, a GPS time: not read here.
"""

import struct
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.checksums import fletcher
from rig.devices.conversation import Conversation, Identity, ascii_text, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample
from rig.exceptions import RigError

STANDARD_GRAVITY = 9.80665  # m/s² per g, exactly (CGPM 1901)
BASE, FORMAT, DATA = 0x01, 0x0C, 0x80
IDLE, INFO, RESUME = 0x02, 0x03, 0x06
MESSAGE_FORMAT, BASE_RATE, STREAM = 0x0F, 0x0E, 0x11
ACCELERATION, RATE, TIME, STEP, ACK = 0x04, 0x05, 0xD5, 0xD6, 0xF1


def field(descriptor: int, data: bytes = b"") -> bytes:
    """Return the bytes of a field."""
    return bytes([len(data) + 2, descriptor]) + data


def packet(descriptor_set: int, *fields: bytes) -> bytes:
    """A packet with its sums."""
    body = b"".join(fields)
    head = bytes([0x75, 0x65, descriptor_set, len(body)]) + body
    return head + fletcher(head)


def fields(data: bytes) -> list[tuple[int, bytes]] | None:
    """The (descriptor, data) pairs of a packet's payload, or None when they do not fill it exactly."""
    pairs, position = [], 0
    while position < len(data):
        length = data[position]
        if length < 2 or position + length > len(data):
            return None
        pairs.append((data[position + 1], data[position + 2 : position + length]))
        position += length
    return pairs


def encode(
    nanoseconds: int, rate: tuple[float, ...], acceleration: tuple[float, ...], *, step: int = 1_000_000
) -> bytes:
    """A data packet: device time and step [ns], rate [rad/s], acceleration [m/s²] (sent in g)."""
    in_g = [a / STANDARD_GRAVITY for a in acceleration]
    return packet(
        DATA,
        field(TIME, struct.pack(">Q", nanoseconds)),
        field(STEP, struct.pack(">Q", step)),
        field(ACCELERATION, struct.pack(">3f", *in_g)),
        field(RATE, struct.pack(">3f", *rate)),
    )


class MipParser(Parser):
    """Packets to samples; a sample needs acceleration and rate in one packet."""

    START = b"\x75"

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length where both sums and the structure of the fields agree."""
        if len(buffer) - start < 4:
            return NO_FRAME if len(buffer) - start > 1 and buffer[start + 1] != 0x65 else WAIT
        if buffer[start + 1] != 0x65:
            return NO_FRAME
        end = start + 4 + buffer[start + 3]
        if len(buffer) < end + 2:
            return WAIT
        if buffer[end : end + 2] != fletcher(buffer[start:end]) or fields(bytes(buffer[start + 4 : end])) is None:
            return NO_FRAME
        return end + 2 - start

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a data packet."""
        data_of = dict(fields(frame[4:-2]) or [])
        acceleration, rate, time = data_of.get(ACCELERATION, b""), data_of.get(RATE, b""), data_of.get(TIME, b"")
        if frame[2] != DATA or len(acceleration) != 12 or len(rate) != 12:
            return []
        in_g = struct.unpack(">3f", acceleration)
        specific_force = tuple(a * STANDARD_GRAVITY for a in in_g)
        nanoseconds = int.from_bytes(time, "big") if len(time) == 8 else None
        return [Sample(struct.unpack(">3f", rate) + specific_force, time=nanoseconds)]


def find_field(data: bytes, descriptor_set: int, descriptor: int, start: bytes = b"") -> bytes | None:
    """The data of the first such field in an intact packet, of those that begin with ``start``."""
    for frame in MipParser().frames(data):
        for number, content in fields(frame[4:-2]) or []:
            if (frame[2], number) == (descriptor_set, descriptor) and content.startswith(start):
                return content
    return None


class MicroStrain(Device):
    """Options: ``rate`` [Hz] of acceleration and angular rate, a whole fraction of the base rate; ``configure``."""

    MEASURES = "imu"
    END = packet(BASE, field(IDLE))
    BAUDRATE = 115200
    FRAME_BYTES = 54
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 100.0, "configure": True}

    def parser(self) -> MipParser:
        """Return a fresh parser."""
        return MipParser(round(1e9 / self.rate) if self.configured else 0)

    def conversation(self) -> Conversation:
        """Idle, who are you, base rate, message format and read it back, stream on, resume."""
        yield from self._command(BASE, IDLE)
        info = yield from ask(packet(BASE, field(INFO)), lambda d: find_field(d, BASE, 0x81))
        command = packet(FORMAT, field(BASE_RATE, bytes([DATA])))
        answer = yield from ask(command, lambda d: find_field(d, FORMAT, 0x8E))
        base_rate = int.from_bytes(answer[-2:], "big")
        decimation = max(1, round(base_rate / self.rate))
        wanted = b"".join(struct.pack(">BH", mark, decimation) for mark in (TIME, STEP, ACCELERATION, RATE))
        yield from self._command(FORMAT, MESSAGE_FORMAT, b"\x01" + bytes([DATA, 4]) + wanted)
        read_back = packet(FORMAT, field(MESSAGE_FORMAT, b"\x02" + bytes([DATA, 0])))
        answer = yield from ask(read_back, lambda d: find_field(d, FORMAT, 0x8F))
        yield from self._command(FORMAT, STREAM, bytes([1, DATA, 1]))
        yield from self._command(BASE, RESUME)
        return self._identity(info, base_rate, decimation, answer[-len(wanted) :] == wanted)

    def _command(self, descriptor_set: int, command: int, data: bytes = b"") -> Conversation:
        sent = packet(descriptor_set, field(command, data))
        answer = yield from ask(sent, lambda d: find_field(d, descriptor_set, ACK, bytes([command])))
        if answer[1:] != b"\0":
            raise RigError(f"the sensor refuses command {descriptor_set:02X} {command:02X} with error {answer[-1]}")
        return Identity()

    def _identity(self, info: bytes, base_rate: int, decimation: int, confirmed: bool) -> Identity:
        model, _, serial, _ = (ascii_text(info[i : i + 16]) for i in range(2, 66, 16))
        rate = base_rate / decimation
        warnings = self.rate_warnings(rate)
        if not confirmed:
            warnings.append("the message format read back differs from what was set")
        return Identity(
            model=model,
            serial=serial,
            firmware=str(int.from_bytes(info[:2], "big")),
            settings={"base_rate_hz": str(base_rate), "decimation": str(decimation), "rate_hz": f"{rate:g}"},
            warnings=tuple(warnings),
        )


class MicroStrainEmulator(Emulator):
    """A 3DM with a base rate of 1 kHz (or more where more is asked for) that takes the conversation above."""

    def __init__(self, device: Device, *, rate: float) -> None:
        super().__init__(device, rate=rate)
        self._base_rate = max(1000, round(rate))
        self._format = b""

    def receive(self, data: bytes) -> bytes:
        """Acknowledge every intact packet."""
        frames = self.frames(
            data, b"\x75\x65", lambda head: head[3] + 6, lambda frame: frame[-2:] == fletcher(frame[:-2])
        )
        return b"".join(self._answer(frame[2], *pair) for frame in frames for pair in fields(frame[4:-2]) or ())

    def _answer(self, descriptor_set: int, command: int, data: bytes) -> bytes:
        reply = [field(ACK, bytes([command, 0]))]
        if descriptor_set == BASE and command in (IDLE, RESUME):
            self.streaming = command == RESUME
        elif descriptor_set == BASE and command == INFO:
            texts = [text.ljust(16) for text in (b"3DM-emulated", b"0000-0000", b"E-0003", b"", b"")]
            reply.append(field(0x81, b"\0\0" + b"".join(texts)))
        elif command == BASE_RATE:
            reply.append(field(0x8E, bytes([DATA]) + struct.pack(">H", self._base_rate)))
        elif command == MESSAGE_FORMAT and data[:1] == b"\x01":
            self._format = data[2:]
            self.rate = self._base_rate / struct.unpack_from(">BH", data, 3)[1]
        elif command == MESSAGE_FORMAT:
            reply.append(field(0x8F, bytes([DATA]) + self._format))
        return packet(descriptor_set, *reply)

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One data packet."""
        return encode(round(time * 1e9), values[:3], values[3:], step=round(1e9 / self.rate))
