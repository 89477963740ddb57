"""Bota Systems SensONE and Rokubi, "gen0" serial protocol: load cell, 37-byte frames with CRC-16/X-25.

Byte 0 AA; 1 u16 status (bit 0 throttled, 1 overrange, 2 invalid); 3 six f32 Fx Fy Fz [N] Mx My Mz [N·m]; 27 u32 time
[µs]; 31 f32 temperature [°C]; 35 u16 CRC over bytes 1 to 34; little-endian.
"""

import re
import struct
from collections.abc import Generator
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.checksums import crc16_x25
from rig.devices.conversation import Conversation, Heard, Identity, Listen, Send, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample, Unwrapper
from rig.exceptions import RigError

FRAME = struct.Struct("<H6fIf")
LENGTH = 37
SINC_PERIOD = 19.53125e-6  # output period per unit of the filter length [s]
OVERRANGE, INVALID = 2, 4
UNKNOWN = "it did not boot when its port was opened, and only then says its model and serial number: name it in --note"


def encode(values: tuple[float, ...], *, microseconds: int, temperature: float = 25.0, status: int = 0) -> bytes:
    """One frame: six values [N, N·m], device time [µs], temperature [°C] and status bits."""
    body = FRAME.pack(status, *values, microseconds % 2**32, temperature)
    return b"\xaa" + body + crc16_x25(body).to_bytes(2, "little")


class BotaParser(Parser):
    """Frames to samples. The time wraps after 71.58 minutes and is continued."""

    START = b"\xaa"

    def __init__(self, period: int = 0) -> None:
        super().__init__(period)
        self._clock = Unwrapper(2**32)

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """37 where the CRC agrees: AA also occurs inside a frame."""
        if len(buffer) - start < LENGTH:
            return WAIT
        body = buffer[start + 1 : start + 35]
        return LENGTH if crc16_x25(body) == buffer[start + 35] | buffer[start + 36] << 8 else NO_FRAME

    def samples(self, frame: bytes) -> list[Sample]:
        """The one sample of a frame."""
        status, *values, microseconds, _ = FRAME.unpack_from(frame, 1)
        flagged = bool(status & (OVERRANGE | INVALID))
        return [Sample(tuple(values), time=self._clock(microseconds) * 1000, flagged=flagged)]


class Bota(Device):
    """Options: ``rate`` [Hz], rounded to what the filter length allows (100: 512, 800: 64); ``configure``.

    The sensor's own offsets and its saved settings are left as they are.
    """

    MEASURES = "wrench"
    END = b"C\n"
    BAUDRATE = 460800
    FRAME_BYTES = LENGTH
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 800.0, "configure": True}
    SETTLING = 3.5

    def parser(self) -> BotaParser:
        """Return a fresh parser."""
        return BotaParser(round(self.sinc * SINC_PERIOD * 1e9) if self.configured else 0)

    @property
    def sinc(self) -> int:
        """The filter length nearest to the wanted rate."""
        return max(1, min(65535, round(1 / (self.rate * SINC_PERIOD))))

    def conversation(self) -> Conversation:
        """Configuration mode, binary frames, filter, run; the boot text identifies the sensor."""
        heard = yield from self._configuration_mode()
        commands = [b"c,0,1,0,4", b"f,%d,0,0,1" % self.sinc, b"R"]
        for command in commands:
            yield from _command(command)
        rate = 1 / (self.sinc * SINC_PERIOD)
        model = _text(heard, rb"name:\s*([^\r\n,]+)")
        return Identity(
            model=model,
            serial=_text(heard, rb"S/N:\s*([^\r\n,]+)"),
            firmware=_text(heard, rb"FW version:\s*([^\r\n,]+)"),
            settings={"sinc_length": str(self.sinc), "rate_hz": f"{rate:.6g}", "chop": "0", "fir_disable": "1"},
            warnings=() if model else (UNKNOWN,),
        )

    def _configuration_mode(self) -> Generator[Send | Listen, Heard, bytes]:
        """The sensor is deaf while it boots: repeat until it answers."""
        heard = b""

        def find(data: bytes) -> bytes | None:
            nonlocal heard
            heard = data
            return data if b"r,0,C,0" in data else None

        yield from ask(b"C\n", find, seconds=0.25, tries=int(self.SETTLING / 0.25))
        return heard


def _command(command: bytes) -> Generator[Send | Listen, Heard, None]:
    letter = command[:1]
    pattern = re.compile(rb"r,0,%s,(\d+)" % letter)

    def find(data: bytes) -> int | None:
        match = pattern.search(data)
        return int(match.group(1)) if match else None

    code = yield from ask(command + b"\n", find)
    if code != 0:
        raise RigError(f"the sensor refuses '{command.decode()}' with error {code}: check the options of the device")


def _text(heard: bytes, pattern: bytes) -> str:
    match = re.search(pattern, heard)
    return match.group(1).decode("ascii", "replace").strip() if match else ""


class BotaEmulator(Emulator):
    """A sensor that boots at once, streams, and takes the commands of the vendor's driver."""

    STREAMS = True
    BOOT = b"name: SensONE-emulated\r\nS/N: E-0001\r\nFW version: 0.0\r\nc,0,1,0,4\r\nApp Init\r\n"

    def receive(self, data: bytes) -> bytes:
        """Acknowledge every command line; C stops the frames, R starts them."""
        *lines, self._heard = (self._heard + data).split(b"\n")
        return b"".join(self._line(bytes(line).strip()) for line in lines)

    def _line(self, line: bytes) -> bytes:
        letter = line[:1]
        if letter not in b"CcfbsRtv" or not letter:
            return b""
        if letter == b"f":
            self.rate = 1 / (int(line.split(b",")[1]) * SINC_PERIOD)
        if letter in b"CR":
            self.streaming = letter == b"R"
        return b"r,0,%s,0\r\n" % letter

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """Return the bytes of one frame."""
        return encode(values, microseconds=round(time * 1e6))
