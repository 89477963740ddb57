"""Universal Robots RTDE (real-time data exchange), protocol version 2: wrench, joints and other outputs over TCP.

Source: Universal Robots, Real-Time Data Exchange (RTDE) guide. A package is u16 size, u8 type, content; big-endian.
The client asks for version 2 (V), names the outputs that it wants (O: f64 frequency, names; the answer is u8 recipe and
their types), starts (S), and gets data packages (U: u8 recipe, the values). The dashboard server, port 29999, tells
model and serial number.

What the robot calls its wrench is its own: ``ft_raw_wrench`` is what the sensor reads, ``actual_TCP_force`` lacks the
weight of the payload that is set on the robot and is along the axes of the robot's base. The rig file says so.
"""

import math
import struct
from collections.abc import Callable, Generator, Iterator
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from rig.devices.base import WRENCH, Channel, Device, Emulator
from rig.devices.conversation import Conversation, Heard, Identity, Inquire, Listen, Send, ask
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample, turned
from rig.exceptions import RigError, listed, quoted

HEAD = struct.Struct(">HB")
VERSION, CONTROLLER, TEXT, OUTPUTS, START, PAUSE, DATA = b"VvMOSPU"
SIZES = {VERSION: 4, CONTROLLER: 19, START: 4, PAUSE: 4}  # of the robot's answers
WRENCHES = ("ft_raw_wrench", "actual_TCP_force")
BY_THE_GUIDE = {"ft_raw_wrench": ("sensor", "none"), "actual_TCP_force": ("base", "gravity")}
"""Axes of each wrench output, and the load that the robot removes from it."""
SLOW = 125  # Hz, of robots before the e-Series, whose software is older than 5
WIDTH = {
    **dict.fromkeys(("timestamp", "speed_scaling", "payload"), 1),
    **dict.fromkeys(("actual_tool_accelerometer", "payload_cog"), 3),
    **dict.fromkeys(("actual_q", "actual_qd", "actual_current", "actual_TCP_pose", "actual_TCP_speed", *WRENCHES), 6),
    **dict.fromkeys(("target_q", "target_qd", "target_qdd", "target_moment", "target_TCP_pose", "target_TCP_speed"), 6),
}
"""Number of values (f64) in each output that is read."""
TYPES = {1: "DOUBLE", 3: "VECTOR3D", 6: "VECTOR6D"}
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
"""Names of the joints in the robots' public URDFs, without their suffix ``_joint``."""
MOST = 1e9
"""Largest time [s] and coordinate [m, rad] of a robot's pose; beyond it a package is none."""
DASHBOARD = 29999
WHO = b"get robot model\nget serial number\nquit\n"


def package(kind: int, content: bytes = b"") -> bytes:
    """A package with its size."""
    return HEAD.pack(HEAD.size + len(content), kind) + content


def packages(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and content of every whole package from the start on."""
    start = 0
    while start + HEAD.size <= len(data):
        size, kind = HEAD.unpack_from(data, start)
        if size < HEAD.size or start + size > len(data):
            return
        yield kind, data[start + HEAD.size : start + size]
        start += size


def find_package(data: bytes, kind: int) -> bytes | None:
    """The content of the first package of this type."""
    return next((content for number, content in packages(data) if number == kind), None)


def rotation(x: float, y: float, z: float) -> NDArray[np.float64]:
    """The rotation matrix (3, 3) of a rotation vector [rad] (Rodrigues)."""
    angle = math.hypot(x, y, z)
    a = math.sin(angle) / angle if angle > 1e-9 else 1.0
    b = (1 - math.cos(angle)) / angle**2 if angle > 1e-9 else 0.5
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + a * cross + b * cross @ cross


class RtdeParser(Parser):
    """Data packages to samples; packages that the robot left out show in its time."""

    def __init__(self, device: "UrRtde", recipe: int, period: int) -> None:
        super().__init__(period)
        self._width = device.width
        self._numbers = struct.Struct(f">{1 + device.width + 6 * device.turns}d")
        self._head = package(DATA, bytes([recipe]) + bytes(self._numbers.size))[:4]

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of a package of a known type; a data package has the recipe's."""
        head = buffer[start : start + 4]
        if len(head) < 4:
            return WAIT
        size, kind = HEAD.unpack_from(head)
        if kind == TEXT:
            text = head[3]
            if start + 4 + text >= len(buffer):
                return WAIT
            good = size == HEAD.size + 3 + text + buffer[start + 4 + text]
        else:
            good = head == self._head if kind == DATA else size == SIZES.get(kind)
        if not good:
            return NO_FRAME
        return size if len(buffer) - start >= size else WAIT

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a data package: wrench in the tool's axes, joints, other values."""
        if frame[2] != DATA:
            return []
        time, *numbers = self._numbers.unpack_from(frame, 4)
        values, pose = tuple(numbers[: self._width]), numbers[self._width :]
        if not all(abs(number) < MOST for number in (time, *pose)):  # so written that NaN is none
            return []
        if pose:
            values = turned(rotation(*pose[3:]).T, values)
        return [Sample(values, time=round(time * 1e9))]


class UrRtde(Device):
    """Options: ``rate`` [Hz]; ``wrench_variable``, which output is the wrench; ``values``, outputs recorded beside.

    ``joint_prefix`` goes before the joints' names. ``wrench_frame`` and ``compensated`` are keys of the rig file: a
    wrench along the base's axes is turned to the tool's by ``actual_TCP_pose``.
    """

    MEASURES = "wrench"
    END = package(PAUSE)
    BAUDRATE = 0
    FRAME_BYTES = 0
    NETWORK = "tcp"
    NUMBER = 30004
    INQUIRIES = (DASHBOARD,)
    ROBOT = True
    DECLARED = ("wrench_variable",)
    OPTIONS: ClassVar[dict[str, object]] = {
        "rate": 500.0,
        "wrench_variable": "actual_TCP_force",
        "wrench_frame": "",
        "compensated": "",
        "values": ["actual_TCP_speed", "actual_tool_accelerometer"],
        "joint_prefix": "",
    }

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        if not 1 <= self.rate <= 500:
            raise RigError(f"option 'rate' of a robot is {self.rate:g}: give a number from 1 to 500 Hz")
        if self.options["wrench_variable"] not in WRENCHES:
            raise RigError(f"option 'wrench_variable' of a robot is no wrench: choose {' or '.join(WRENCHES)}")
        values = self.options["values"]
        wrong = [name for name in values if name not in WIDTH] if isinstance(values, list) else []
        if wrong or not isinstance(values, list):
            raise RigError(f"option 'values' of a robot names {quoted(wrong[0])}: choose from {', '.join(WIDTH)}")
        self._values = [str(name) for name in values]
        self.turns = self.options["wrench_frame"] == "base"
        self._recipe = 1

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Wrench, joints, other values."""
        prefix = self.options["joint_prefix"]
        joints = Channel("joints", tuple(f"{prefix}{name}_joint" for name in JOINTS))
        names = [f"{name}_{i}" if WIDTH[name] > 1 else name for name in self._values for i in range(WIDTH[name])]
        values = (Channel("values", tuple(names)),) if names else ()
        return (Channel("wrench", WRENCH), joints, *values)

    @property
    def width(self) -> int:
        """Number of values in a sample."""
        return sum(len(channel.signals) for channel in self.channels)

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs that the robot is asked to send, in this order."""
        pose = ["actual_TCP_pose"] if self.turns else []
        return ["timestamp", str(self.options["wrench_variable"]), "actual_q", "actual_qd", *self._values, *pose]

    def parser(self) -> RtdeParser:
        """A fresh parser, for the recipe that the robot gave."""
        return RtdeParser(self, self._recipe, round(1e9 / self.rate))

    def conversation(self) -> Conversation:
        """Version 2, who it is, the outputs, start."""
        accepted = yield from _ask(VERSION, struct.pack(">H", 2))
        if accepted != b"\1":
            raise RigError("the robot does not speak version 2 of RTDE: update its software to 3.10, 5.4 or later")
        version = yield from _ask(CONTROLLER)
        major = int.from_bytes(version[:4], "big")
        if major < 5 and self.rate > SLOW:
            raise RigError(f"a robot with software {major} sends at most {SLOW} Hz: set its option `rate` to {SLOW}")
        reply, _ = yield Inquire(DASHBOARD, WHO)
        recipe = yield from _ask(OUTPUTS, struct.pack(">d", self.rate) + ",".join(self.outputs).encode())
        self._take_recipe(recipe)
        if (yield from _ask(START)) != b"\1":
            raise RigError("the robot does not start its data: look for a message on its pendant")
        words = reply.decode("utf-8", "replace").split("\n")[1:3]
        model, serial = (word.strip() for word in words) if len(words) == 2 else ("", "")
        return Identity(
            model=model or "Universal Robots",
            serial=serial,
            firmware=".".join(str(number) for (number,) in struct.iter_unpack(">I", version[: len(version) // 4 * 4])),
            settings={"outputs": ",".join(self.outputs), "rate_hz": f"{self.rate:g}"},
            warnings=tuple(self._doubts()),
        )

    def _doubts(self) -> Iterator[str]:
        """Return doubts about the rig file's declarations that contradict the maker's documents."""
        name = str(self.options["wrench_variable"])
        for key, expected in zip(("wrench_frame", "compensated"), BY_THE_GUIDE[name], strict=True):
            if self.options[key] not in ("", expected):
                yield f"{key} of {name} is '{expected}' in the maker's documents, '{self.options[key]}' in the rig file"

    def _take_recipe(self, answer: bytes) -> None:
        types = answer[1:].decode("ascii", "replace").split(",")
        missing = [name for name, kind in zip(self.outputs, types, strict=False) if kind == "NOT_FOUND"]
        if missing:
            raise RigError(f"the robot's software has no output {listed(missing)}: choose others, or update it")
        if not answer or types != [TYPES[WIDTH[name]] for name in self.outputs]:
            raise RigError(f"the robot sends its outputs as {quoted(','.join(types))}: its software is not known here")
        self._recipe = answer[0]


def _ask(kind: int, content: bytes = b"") -> Generator[Send | Listen, Heard, bytes]:
    find: Callable[[bytes], bytes | None] = partial(find_package, kind=kind)
    return (yield from ask(package(kind, content), find))


class RtdeEmulator(Emulator):
    """A robot whose tool turns; along the base's axes where it is asked for that wrench."""

    device: UrRtde

    def boot(self) -> bytes:
        """A new client: what was heard of the last is forgotten."""
        self._heard.clear()
        return super().boot()

    def receive(self, data: bytes) -> bytes:
        """Answer every whole package."""
        self._heard += data
        answer = b""
        for kind, content in packages(bytes(self._heard)):
            del self._heard[: HEAD.size + len(content)]
            answer += self._answer(kind, content)
        return answer

    def _answer(self, kind: int, content: bytes) -> bytes:
        if kind in (START, PAUSE):
            self.streaming = kind == START
        if kind == OUTPUTS:
            (self.rate,) = struct.unpack_from(">d", content)
            types = [TYPES[WIDTH[name]] if name in WIDTH else "NOT_FOUND" for name in content[8:].decode().split(",")]
            return package(kind, b"\1" + ",".join(types).encode())
        return package(kind, struct.pack(">4I", 5, 0, 0, 0) if kind == CONTROLLER else b"\1")

    def inquired(self, number: int, data: bytes) -> bytes:
        """Return the answer of the dashboard server."""
        return b"Connected: Universal Robots Dashboard Server\nUR-emulated\n20260000000\nDisconnected\n"

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """One data package."""
        pose: tuple[float, ...] = ()
        if self.device.turns:
            pose = (0.0, 0.0, 0.0, 0.4 * math.sin(time), 0.3, -0.2)
            values = turned(rotation(*pose[3:]), values)
        numbers = (time, *values, *pose)
        return package(DATA, b"\1" + struct.pack(f">{len(numbers)}d", *numbers))
