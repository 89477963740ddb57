"""VectorNav VN-100, binary output: IMU, ``FA | groups u8 | u16 mask per group | payload | CRC16``.

Little-endian, but the CRC (polynomial 0x1021, start 0, over all after FA) is big-endian, so that over packet and CRC it
gives 0. Only group 1 is read: bit 0 time u64 [ns], 5 angular rate [rad/s], 8 acceleration [m/s²].
"""

import struct
from binascii import crc_hqx
from collections.abc import Generator
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.conversation import Conversation, Heard, Identity, Listen, Send, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample
from rig.exceptions import RigError, quoted

# Bytes of the items of group 1 by bit (VN-100 user manual, binary output groups).
SIZES = (8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8)
TIME, RATE, ACCELERATION = 0, 5, 8
OUTPUT = 1 << TIME | 1 << RATE | 1 << ACCELERATION
BASE_RATE = 800
ASYNC_TYPE, BINARY_OUTPUT = 6, 75


def sentence(text: str) -> bytes:
    """An ASCII command or answer: ``$text*XX`` with the XOR of the text's bytes."""
    total = 0
    for byte in text.encode():
        total ^= byte
    return f"${text}*{total:02X}\r\n".encode()


def offsets(mask: int) -> dict[int, int]:
    """Return the start of each item of group 1 in the payload."""
    starts, position = {}, 0
    for bit, size in enumerate(SIZES):
        if mask >> bit & 1:
            starts[bit] = position
            position += size
    return starts


def encode(nanoseconds: int, rate: tuple[float, ...], acceleration: tuple[float, ...]) -> bytes:
    """A packet with time [ns], rate [rad/s] and acceleration [m/s²]."""
    body = struct.pack("<BHQ6f", 1, OUTPUT, nanoseconds, *rate, *acceleration)
    return b"\xfa" + body + crc_hqx(body, 0).to_bytes(2, "big")


class VectorNavParser(Parser):
    """Packets of one layout of group 1 to samples.

    A packet with another mask is no frame: flipped bits in the mask would otherwise change its length and leave it to
    chance whether the CRC agrees.
    """

    START = b"\xfa"

    def __init__(self, mask: int = OUTPUT, period: int = 0) -> None:
        super().__init__(period)
        self._head = b"\xfa" + struct.pack("<BH", 1, mask)
        self._length = 4 + sum(size for bit, size in enumerate(SIZES) if mask >> bit & 1) + 2
        self._at = offsets(mask)

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length where header and CRC agree."""
        head = buffer[start : start + 4]
        if head != self._head[: len(head)]:
            return NO_FRAME
        if len(buffer) - start < self._length:
            return WAIT
        return NO_FRAME if crc_hqx(buffer[start + 1 : start + self._length], 0) else self._length

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a packet."""
        rate = struct.unpack_from("<3f", frame, 4 + self._at[RATE])
        acceleration = struct.unpack_from("<3f", frame, 4 + self._at[ACCELERATION])
        time = struct.unpack_from("<Q", frame, 4 + self._at[TIME])[0] if TIME in self._at else None
        return [Sample(rate + acceleration, time=time)]


def find_answer(data: bytes, start: str) -> str | None:
    """The text of the first intact sentence that starts so."""
    for line in data.split(b"$")[1:]:
        text = line.split(b"*")[0].decode("ascii", "replace")
        if text.startswith(start) and sentence(text).rstrip() == b"$" + line.rstrip()[: len(text) + 3]:
            return text
    return None


def register(command: str) -> Generator[Send | Listen, Heard, list[str]]:
    """Write (``WRG,06,0``) or read (``RRG,01``) a register; returns the fields of the answer behind its number."""
    start = "VN" + ",".join(command.split(",")[:2])

    def find(data: bytes) -> str | None:
        return find_answer(data, "VNERR") or find_answer(data, start)

    text = yield from ask(sentence("VN" + command), find)
    if text.startswith("VNERR"):
        raise RigError(f"the sensor refuses '{command}' with {text}: check the options of the device")
    return text.split(",")[2:]


def identify() -> Generator[Send | Listen, Heard, tuple[str, str, str]]:
    """Model, serial number and firmware."""
    model = yield from register("RRG,01")
    serial = yield from register("RRG,03")
    firmware = yield from register("RRG,04")
    return model[0], serial[0], firmware[0]


class VectorNav(Device):
    """Options: ``rate`` [Hz], a whole fraction of 800; ``mask``, the binary output of group 1; ``configure``."""

    MEASURES = "imu"
    END = sentence("VNWRG,75,0,8,01,0001")
    BAUDRATE = 115200
    FRAME_BYTES = 38
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 100.0, "mask": OUTPUT, "configure": True}

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        mask = self.options["mask"]
        if not isinstance(mask, int) or mask & OUTPUT & ~1 != OUTPUT & ~1 or mask >> len(SIZES):
            raise RigError(
                f"option 'mask' of a VectorNav is {quoted(mask)}: it needs bits 5 (rate) and 8 (acceleration)"
            )
        self._mask = mask

    def parser(self) -> VectorNavParser:
        """Return a fresh parser."""
        return VectorNavParser(self._mask, round(1e9 / self.rate) if self.configured else 0)

    def conversation(self) -> Conversation:
        """No ASCII output, who are you, binary output and what it became."""
        yield from register("WRG,06,0")
        facts = yield from identify()
        divisor = max(1, round(BASE_RATE / self.rate))
        yield from register(f"WRG,75,1,{divisor},01,{self._mask:04X}")
        settings = yield from register("RRG,75")
        warnings = tuple(self.rate_warnings(BASE_RATE / divisor))
        return Identity(*facts, settings={"binary_output": ",".join(settings)}, warnings=warnings)


class VectorNavEmulator(Emulator):
    """A VN-100 that takes the conversation above, binary or ASCII."""

    FACTS: ClassVar[dict[str, str]] = {"01": "VN-100-emulated", "03": "0", "04": "2.0"}

    def __init__(self, device: Device, *, rate: float) -> None:
        super().__init__(device, rate=rate)
        self._registers = dict(self.FACTS)

    def receive(self, data: bytes) -> bytes:
        """Answer every sentence with itself, or with what the register holds."""
        *lines, self._heard = (self._heard + data).split(b"\n")
        texts = [line.partition(b"$")[2].partition(b"*")[0].decode("ascii", "replace") for line in lines]
        return b"".join(self._answer(text) for text in texts if text.startswith("VN"))

    def _answer(self, text: str) -> bytes:
        command, _, rest = text.partition(",")
        number, _, value = rest.partition(",")
        if command == "VNWRG":
            self._registers[number] = value
            self._apply(number, value)
        return sentence(f"{command},{number},{self._registers.get(number, '0')}")

    def _apply(self, number: str, value: str) -> None:
        if int(number) == BINARY_OUTPUT:
            mode, divisor, *_ = value.split(",")
            self.streaming, self.rate = mode != "0", BASE_RATE / int(divisor)
        elif int(number) == ASYNC_TYPE:
            self.streaming = value != "0"

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One binary packet."""
        return encode(round(time * 1e9), values[:3], values[3:])
