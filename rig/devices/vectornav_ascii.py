"""VectorNav VN-100, ASCII output ``$VNYMR``: attitude, magnetic field, acceleration [m/s²], angular rate [rad/s].

``$VNYMR,yaw,pitch,roll,mx,my,mz,ax,ay,az,wx,wy,wz*XX`` and a line end, with the XOR of the bytes between $ and *. The
XOR is weak, so that the exact form of every number is demanded too.
"""

import re
from typing import ClassVar

from rig.devices.base import Device
from rig.devices.conversation import Conversation, Identity
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample
from rig.devices.vectornav import VectorNavEmulator, identify, register, sentence

NUMBER = rb",[+-]\d{2,3}\.\d{3,6}"
LINE = re.compile(rb"\$(VNYMR(?:%s){12})\*([0-9A-F]{2})\r\n" % NUMBER)
LONGEST = 150


def encode(rate: tuple[float, ...], acceleration: tuple[float, ...]) -> bytes:
    """A VNYMR line with this rate [rad/s] and acceleration [m/s²], attitude and magnetic field zero."""
    zeros = "".join([",+000.000"] * 3 + [",+00.0000"] * 3)
    numbers = [f",{a:+07.3f}" for a in acceleration] + [f",{w:+010.6f}" for w in rate]
    return sentence("VNYMR" + zeros + "".join(numbers))


class VectorNavAsciiParser(Parser):
    """Lines to samples."""

    START = b"$"

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of a line whose form and XOR agree."""
        end = buffer.find(b"\n", start, start + LONGEST)
        if end < 0:
            return WAIT if len(buffer) - start < LONGEST else NO_FRAME
        match = LINE.fullmatch(bytes(buffer[start : end + 1]))
        if match is None:
            return NO_FRAME
        return end + 1 - start if sentence(match.group(1).decode()) == match.group(0) else NO_FRAME

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a line."""
        numbers = [float(v) for v in frame.partition(b"*")[0].split(b",")[1:]]
        return [Sample(tuple(numbers[9:12] + numbers[6:9]))]


class VectorNavAscii(Device):
    """Options: ``rate`` [Hz], one that the sensor knows (1 to 200); ``configure``. There is no device time."""

    ASKED = False  # the same sensor as `vectornav`
    MEASURES = "imu"
    END = sentence("VNWRG,06,0")
    PARSER = VectorNavAsciiParser
    BAUDRATE = 115200
    FRAME_BYTES = 118
    OPTIONS: ClassVar[dict[str, object]] = {"rate": 40.0, "configure": True}

    def conversation(self) -> Conversation:
        """Ask for the device's identity, and set its output VNYMR and its rate."""
        yield from register("WRG,06,0")
        facts = yield from identify()
        rate = yield from register(f"WRG,07,{round(self.rate)}")
        output = yield from register("WRG,06,14")
        return Identity(*facts, settings={"async_output": ",".join(output), "rate_hz": ",".join(rate)})


class VectorNavAsciiEmulator(VectorNavEmulator):
    """The VectorNav emulator with ASCII output."""

    def _apply(self, number: str, value: str) -> None:
        super()._apply(number, value)
        if int(number) == 7:
            self.rate = float(value)

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """Return the bytes of one line."""
        return encode(values[:3], values[3:])
