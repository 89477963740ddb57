"""ACME six-axis load cell: ``AA``, counter (uint16), Fx Fy Fz [N] Mx My Mz [N·m] (float32), CRC-32; little-endian."""

import struct
import zlib
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.conversation import Conversation, Identity, Send, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample

FRAME = struct.Struct("<BH6fI")


def encode(counter: int, values: tuple[float, ...]) -> bytes:
    """A frame."""
    body = FRAME.pack(0xAA, counter % 2**16, *values, 0)[:-4]
    return body + zlib.crc32(body).to_bytes(4, "little")


class AcmeParser(Parser):
    """Frames to samples."""

    START = b"\xaa"
    MODULUS = 2**16

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of a frame whose CRC agrees."""
        frame = bytes(buffer[start : start + FRAME.size])
        if len(frame) < FRAME.size:
            return WAIT
        return FRAME.size if zlib.crc32(frame[:-4]) == int.from_bytes(frame[-4:], "little") else NO_FRAME

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a frame."""
        _, counter, *values, _ = FRAME.unpack(frame)
        return [Sample(tuple(values), counter=counter)]


class Acme(Device):
    """Options: ``rate`` [Hz]."""

    MEASURES = "wrench"
    BAUDRATE = 921600
    FRAME_BYTES = FRAME.size
    PARSER = AcmeParser
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 1000.0}

    def conversation(self) -> Conversation:
        """Ask who it is, then start the samples."""
        model = yield from ask(b"?", lambda heard: heard[:-1].decode() if heard.endswith(b"\n") else None)
        yield Send(b"S")
        return Identity(model)


class AcmeEmulator(Emulator):
    """Answers `?`, and sends frames from `S` on."""

    def receive(self, data: bytes) -> bytes:
        """What it answers."""
        self.streaming = self.streaming or b"S" in data
        return b"ACME 6\n" if b"?" in data else b""

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One frame."""
        return encode(index, values)
