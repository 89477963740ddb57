"""Robotiq FT 300 and FT 300-S: load cell, Modbus RTU at 19200 baud for questions, then a stream of 100 frames a second.

Source: FT 300-S Force Torque Sensor, Instruction Manual, section 4.4 (serial communication): slave 9; registers 500
firmware, 510 serial number, 514 production year; 0x0200 in register 410 starts the stream, some 50 bytes FF end it. A
frame is ``20 4E``, six i16 (Fx Fy Fz in 0.01 N, Mx My Mz in 0.001 N·m), CRC-16/MODBUS over the 14 bytes before it;
little-endian. There is no time stamp and no counter: a lost frame shows in host time only.
"""

import struct
from functools import partial
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.checksums import crc16_modbus
from rig.devices.conversation import Conversation, Identity, Listen, Send, ascii_text, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample

SLAVE, READ, WRITE = 9, 3, 16
FIRMWARE, SERIAL, YEAR, OUTPUT = 500, 510, 514, 410
STREAM = 0x0200
END_OF_STREAM = b"\xff" * 50
HEAD = b"\x20\x4e"
LENGTH = 16
RATE = 100.0  # Hz, the only one
SAMPLE = struct.Struct("<6h")
SCALE = (100, 100, 100, 1000, 1000, 1000)


def message(*body: int) -> bytes:
    """A Modbus message to or from the sensor, with its checksum."""
    data = bytes([SLAVE, *body])
    return data + crc16_modbus(data).to_bytes(2, "little")


def read_request(register: int, count: int) -> bytes:
    """The request for ``count`` registers from ``register`` on."""
    return message(READ, *struct.pack(">HH", register, count))


START_STREAM = message(WRITE, *struct.pack(">HHBH", OUTPUT, 1, 2, STREAM))
STREAM_STARTS = message(WRITE, *struct.pack(">HH", OUTPUT, 1))


def find_registers(data: bytes, count: int) -> bytes | None:
    """The content of ``count`` registers in the first intact answer."""
    head, length = bytes([SLAVE, READ, 2 * count]), 2 * count + 5
    start = data.find(head)
    while start >= 0:
        answer = data[start : start + length]
        if len(answer) == length and message(*answer[1:-2]) == answer:
            return answer[3:-2]
        start = data.find(head, start + 1)
    return None


def find_firmware(data: bytes) -> bytes | None:
    """The firmware's registers, if it is this sensor's: its name starts with F. Grippers of the maker answer too."""
    registers = find_registers(data, 3)
    return registers if registers and registers.startswith(b"F") else None


def encode(values: tuple[float, ...]) -> bytes:
    """A frame of six values [N, N·m], rounded to the sensor's resolution and limited to its range."""
    raw = [max(-32768, min(32767, round(value * scale))) for value, scale in zip(values, SCALE, strict=True)]
    body = HEAD + SAMPLE.pack(*raw)
    return body + crc16_modbus(body).to_bytes(2, "little")


class RobotiqParser(Parser):
    """Frames to samples."""

    START = HEAD[:1]

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """16 where the CRC agrees."""
        frame = buffer[start : start + LENGTH]
        if frame[1:2] not in (b"", HEAD[1:]):
            return NO_FRAME
        if len(frame) < LENGTH:
            return WAIT
        return LENGTH if crc16_modbus(frame[:14]) == frame[14] | frame[15] << 8 else NO_FRAME

    def samples(self, frame: bytes) -> list[Sample]:
        """The one sample of a frame."""
        raw = SAMPLE.unpack_from(frame, 2)
        return [Sample(tuple(value / scale for value, scale in zip(raw, SCALE, strict=True)))]


class RobotiqFt(Device):
    """Options of the device: ``configure``. It streams at 100 Hz. The sensor's zero is left as it is."""

    MEASURES = "wrench"
    END = END_OF_STREAM
    PARSER = RobotiqParser
    BAUDRATE = 19200
    FRAME_BYTES = LENGTH
    OPTIONS: ClassVar[dict[str, object]] = {"configure": True}

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return RATE

    def conversation(self) -> Conversation:
        """End the stream, wait until the line is quiet, ask who it is, start the stream."""
        yield Send(END_OF_STREAM)
        for _ in range(10):
            heard, _ = yield Listen(0.1)
            if not heard:
                break
        firmware = yield from ask(read_request(FIRMWARE, 3), find_firmware)
        serial = yield from ask(read_request(SERIAL, 4), partial(find_registers, count=4))
        year = yield from ask(read_request(YEAR, 1), partial(find_registers, count=1))
        yield from ask(START_STREAM, lambda heard: STREAM_STARTS if STREAM_STARTS in heard else None)
        return Identity(
            model="FT 300",
            serial=f"{ascii_text(serial[:3])}-{int.from_bytes(serial[6:8] + serial[4:6], 'big'):04d}",
            firmware=f"{ascii_text(firmware[:3])}-{'.'.join(str(number) for number in firmware[3:6])}",
            settings={"production_year": str(int.from_bytes(year, "big"))},
        )


class RobotiqEmulator(Emulator):
    """An FT 300 that was left streaming, and answers as soon as its stream has been ended."""

    STREAMS = True
    REGISTERS: ClassVar[dict[int, bytes]] = {
        FIRMWARE: b"FTS\x01\x02\x03",
        SERIAL: b"FTS\0" + struct.pack(">HH", 7, 0),
        YEAR: struct.pack(">H", 2026),
    }

    def __init__(self, device: Device, *, rate: float) -> None:
        super().__init__(device, rate=RATE)

    def receive(self, data: bytes) -> bytes:
        """Answer every intact request, unless it streams."""
        self._heard += data
        if len(self._heard) - len(self._heard.lstrip(b"\xff")) >= len(END_OF_STREAM):
            self.streaming = False
        del self._heard[: len(self._heard) - len(self._heard.lstrip(b"\xff"))]
        request = bytes(self._heard)
        if self.streaming or len(request) < 8 or message(*request[1:-2]) != request:
            return b""
        self._heard.clear()
        if request == START_STREAM:
            self.streaming = True
            return STREAM_STARTS
        register, count = struct.unpack_from(">HH", request, 2)
        content = self.REGISTERS.get(register, bytes(2 * count))
        return message(READ, len(content), *content)

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """Return the bytes of one frame."""
        return encode(values)
