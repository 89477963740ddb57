"""ATI Net F/T and Ethernet Axia: load cell, RDT (raw data transfer) over UDP, one record of 36 bytes a datagram.

Source: ATI, Network Force/Torque Sensor System, Installation and Operation Manual 9620-05-NET FT, sections "UDP
interface using RDT" and "System settings XML page". A request is u16 0x1234, u16 command (0 stop, 2 stream), u32
number of samples (0: without end), to port 49152. A record is u32 RDT sequence (of the datagrams, from 1), u32 F/T
sequence (of the samples inside, at the internal rate), u32 status (0: all is well), i32 counts Fx Fy Fz Tx Ty Tz; all
big-endian. The page netftapi2.xml, port 80, tells counts per unit, units, rates and what the sensor does to the wrench.
"""

import re
import struct
from collections import deque
from collections.abc import Iterator
from typing import ClassVar

from rig.devices.base import Device, Emulator
from rig.devices.conversation import Conversation, Identity, Inquire, ask
from rig.devices.parser import Parser, Sample, Unwrapper
from rig.exceptions import RigError, quoted

RECORD, REQUEST = struct.Struct(">3I6i"), struct.Struct(">HHI")
STOP, STREAM = 0, 2
DEPTH = 16  # datagrams that wait for one before them; then it counts as lost
RESTART = 20  # datagrams in a row from before the stream's place, after which the sensor has started it anew
PAGE = b"GET /netftapi2.xml HTTP/1.0\r\n\r\n"
POUND = 4.4482216152605  # N
FORCE_UNITS = {"N": 1.0, "kN": 1e3, "lbf": POUND, "klbf": 1e3 * POUND, "kgf": 9.80665, "gf": 9.80665e-3}
TORQUE_UNITS = {
    "Nm": 1.0,
    "Nmm": 1e-3,
    "kNm": 1e3,
    "lbfin": 0.0254 * POUND,
    "lbfft": 0.3048 * POUND,
    "kgfcm": 0.0980665,
}
SETTINGS = {
    "comrdtrate": "rdt_rate_hz",
    "runrate": "internal_rate_hz",
    "cfgtfx": "tool_transform",
    "scfgtdu": "tool_transform_length_unit",
    "scfgtau": "tool_transform_angle_unit",
    "setuserfilter": "low_pass",
    "setbias": "zero_counts",
    "cfgmr": "range",
}
"""Names of the settings in a recording, by their names in the device's page."""


def request(command: int, samples: int = 0) -> bytes:
    """The 8 bytes of a request; 0 samples is a stream without end."""
    return REQUEST.pack(0x1234, command, samples)


def encode(sequence: int, ft_sequence: int, counts: tuple[int, ...], *, status: int = 0) -> bytes:
    """Return the bytes of one record."""
    return RECORD.pack(sequence % 2**32, ft_sequence % 2**32, status, *counts)


def find_record(data: bytes) -> bytes | None:
    """Return the received bytes if they are whole records."""
    return data if data and len(data) % RECORD.size == 0 else None


class AtiParser(Parser):
    """Datagrams to samples, in the order in which the sensor sent them. What is fed at once is one datagram.

    ``force`` and ``torque`` are newtons and newton metres per count; ``tick`` [ns] is the period of the F/T sequence,
    0 where it is not known.
    """

    def __init__(self, force: float, torque: float, *, tick: float = 0.0) -> None:
        super().__init__()
        self._force, self._torque, self._tick = force, torque, tick
        self._clock, self._sequence = Unwrapper(2**32), Unwrapper(2**32)
        self._begun = False
        self._place = self._first = self._last = 0  # the number that is due, the first counted, the largest that came
        self._waiting: dict[int, Sample] = {}
        self._gaps: deque[range] = deque(maxlen=1000)
        self._behind = 0  # datagrams in a row from before the place, and how many of them count as repeated
        self._twice = 0

    def begin(self) -> None:
        """Restart the counts here; a datagram from before that comes later counts for nothing."""
        super().begin()
        self._begun = False
        self._waiting.clear()
        self._gaps.clear()

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """Return 36, since UDP has verified the datagram."""
        return RECORD.size

    def _drain(self, *, final: bool) -> list[Sample]:
        buffer, samples = self._buffer, list[Sample]()
        if len(buffer) % RECORD.size:
            self._reject(len(buffer))
        else:
            for start in range(0, len(buffer), RECORD.size):
                self._accept(bytes(buffer[start : start + RECORD.size]), samples)
        buffer.clear()
        while final and self._waiting:
            self._pass_gap(samples)
        return samples

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a record, its counter the RDT sequence without wraps."""
        sequence, ft_sequence, status, *counts = RECORD.unpack(frame)
        force = tuple(self._force * count for count in counts[:3])
        torque = tuple(self._torque * count for count in counts[3:])
        time = round(self._clock(ft_sequence) * self._tick) if self._tick else None
        return [Sample(force + torque, time=time, counter=self._sequence(sequence), flagged=status != 0)]

    def _accept(self, frame: bytes, samples: list[Sample]) -> None:
        self._count(frame)
        (sample,) = self.samples(frame)
        number = sample.counter or 0
        if not self._begun:
            self._begun, self._place, self._first, self._last = True, number, number, number - 1
        if number <= self._last:
            self._late(number, samples)
        self._last = max(self._last, number)
        if number < self._place or number in self._waiting:
            return
        self._behind = self._twice = 0
        self._waiting[number] = sample._replace(end=self._done, number=number)
        self._release(samples)
        while self._last - self._place >= DEPTH and self._waiting:
            self._pass_gap(samples)

    def _late(self, number: int, samples: list[Sample]) -> None:
        """Count a datagram from before the last; many in a row say that the sensor has started its stream anew."""
        counts, missed = self.counts, any(number in gap for gap in self._gaps)
        if number in self._waiting or (number < self._place and not missed):
            counts.repeated += number >= self._first
            self._twice += number >= self._first
            self._behind += 1
        else:
            counts.reordered += 1
        if self._behind >= RESTART:
            while self._waiting:
                self._pass_gap(samples)
            counts.resynchronisations += 1
            counts.repeated -= self._twice
            counts.missing += self._behind - 1
            self._place = self._first = self._last = number
            self._gaps.clear()

    def _release(self, samples: list[Sample]) -> None:
        while self._place in self._waiting:
            sample = self._waiting.pop(self._place)
            self._place += 1
            self.counts.samples += 1
            self.counts.flagged += sample.flagged
            samples.append(sample)

    def _pass_gap(self, samples: list[Sample]) -> None:
        """Give up what is due, up to the first that waits."""
        first = min(self._waiting)
        self._gaps.append(range(self._place, first))
        self.counts.missing += first - self._place
        self._place = first
        self._release(samples)


class AtiNetFt(Device):
    """Options: ``rate`` [Hz], as it is set on the sensor's own page; ``counts_per_force`` and ``counts_per_torque``.

    The counts, per N and per N·m, are needed only where that page cannot be read; ``configure``. The sensor's zero,
    filter and tool transform are left as they are and recorded.
    """

    MEASURES = "wrench"
    END = request(STOP)
    BAUDRATE = 0
    FRAME_BYTES = RECORD.size
    NETWORK = "udp"
    NUMBER = 49152
    INQUIRIES = (80,)
    OPTIONS: ClassVar[dict[str, object]] = {
        "rate": 1000.0,
        "counts_per_force": 0.0,
        "counts_per_torque": 0.0,
        "configure": True,
    }

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        declared = [self.options[key] for key in ("counts_per_force", "counts_per_torque")]
        if not all(isinstance(value, float | int) and 0 <= value < 1e15 for value in declared):
            raise RigError("options 'counts_per_force' and 'counts_per_torque' of a Net F/T are numbers above 0")
        self._scale = tuple(1 / float(value) if isinstance(value, float | int) and value else 0.0 for value in declared)
        self._tick = 0.0
        if not (self.configured or all(self._scale)):
            raise RigError(MISSING)

    def parser(self) -> AtiParser:
        """A fresh parser, with the scale that the conversation has read."""
        force, torque = self._scale
        return AtiParser(force, torque, tick=self._tick)

    def conversation(self) -> Conversation:
        """Ask for one sample, read the sensor's page, start the stream."""
        yield from ask(request(STREAM, 1), find_record)
        page, _ = yield Inquire(80, PAGE)
        facts = dict(re.findall(r"<(\w+)>([^<>]*)</\1>", page.decode("utf-8", "replace")))
        warnings = self._take_scale(facts)
        yield from ask(request(STREAM), find_record)
        return Identity(
            model=facts.get("prodname", "Net F/T"),
            serial=facts.get("cfgcalsn", ""),
            firmware=facts.get("mfgdigver", ""),
            settings={name: facts[key] for key, name in SETTINGS.items() if key in facts},
            warnings=warnings,
        )

    def _take_scale(self, facts: dict[str, str]) -> tuple[str, ...]:
        """Scale and tick of the sensor's page, or what the rig file says; the two must agree."""
        if "cfgcpf" not in facts or "cfgcpt" not in facts:
            if not all(self._scale):
                raise RigError(MISSING)
            return ("its page netftapi2.xml cannot be read: the declared counts are not verified, and it has no clock",)
        scale = (
            _unit(facts, "scfgfu", FORCE_UNITS) / _number(facts, "cfgcpf"),
            _unit(facts, "scfgtu", TORQUE_UNITS) / _number(facts, "cfgcpt"),
        )
        for key, declared, read in zip(("counts_per_force", "counts_per_torque"), self._scale, scale, strict=True):
            if declared and abs(declared / read - 1) > 1e-6:
                raise RigError(f"option '{key}' is {1 / declared:g}, the sensor says {1 / read:g} in SI: correct it")
        self._scale = scale
        self._tick = 1e9 / _number(facts, "runrate") if "runrate" in facts else 0.0
        return tuple(self._warnings(facts))

    def _warnings(self, facts: dict[str, str]) -> Iterator[str]:
        if "comrdtrate" in facts and abs(_number(facts, "comrdtrate") / self.rate - 1) > 0.01:
            yield f"it sends at {facts['comrdtrate']} Hz, not {self.rate:g} Hz: set the RDT rate on its page, or `rate`"
        if re.search("[1-9]", facts.get("cfgtfx", "")):
            unit = facts.get("scfgtdu", "")
            yield f"its tool transform {facts['cfgtfx']} ({unit}) moves and turns the wrench: declare that as its place"


MISSING = (
    "the page netftapi2.xml of the Net F/T cannot be read: set the options `counts_per_force` [1/N] and "
    "`counts_per_torque` [1/(N*m)]"
)


def _number(facts: dict[str, str], key: str) -> float:
    try:
        number = float(facts[key])
    except ValueError:
        number = 0.0
    if not 0 < number < 1e15:
        raise RigError(f"the Net F/T's page says {quoted(facts[key])} for {key}, no number above 0: verify its setup")
    return number


def _unit(facts: dict[str, str], key: str, units: dict[str, float]) -> float:
    """Newtons or newton metres per unit; the page writes N-m or Nm."""
    name = re.sub(r"[^a-zA-Z]", "", facts.get(key, ""))
    if name not in units:
        raise RigError(f"the Net F/T's page says unit {quoted(facts.get(key, ''))}: choose N and Nm on its page")
    return units[name]


class AtiEmulator(Emulator):
    """A Net F/T of 1,000,000 counts per unit, whose internal rate is 7000 Hz."""

    COUNTS, INTERNAL = 1_000_000, 7000.0

    def __init__(self, device: Device, *, rate: float) -> None:
        super().__init__(device, rate=rate)
        self._sequence = 0

    def receive(self, data: bytes) -> bytes:
        """Start or end the stream; every start counts the datagrams from 1."""
        if len(data) == REQUEST.size and data[:2] == b"\x12\x34":
            once = data[3] == STREAM and data[4:] == request(STREAM, 1)[4:]
            self.streaming, self._sequence = data[3] == STREAM and not once, 0
            return self.frame(0, 0.0, (0.0,) * 6) if once else b""
        return b""

    def inquired(self, number: int, data: bytes) -> bytes:
        """The page netftapi2.xml, as far as it is read here."""
        facts = {
            "prodname": "Net F/T-emulated",
            "cfgcalsn": "FT00001",
            "mfgdigver": "0.0.0",
            "cfgcpf": self.COUNTS,
            "cfgcpt": self.COUNTS,
            "scfgfu": "N",
            "scfgtu": "Nm",
            "runrate": round(self.INTERNAL),
            "comrdtrate": f"{self.rate:g}",
            "cfgtfx": "0;0;0;0;0;0",
        }
        page = "".join(f"<{key}>{value}</{key}>" for key, value in facts.items())
        return f"HTTP/1.0 200 OK\r\n\r\n<netft>{page}</netft>".encode()

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """Return the bytes of one record."""
        self._sequence += 1
        counts = tuple(max(-(2**31), min(2**31 - 1, round(value * self.COUNTS))) for value in values)
        return encode(self._sequence, round(time * self.INTERNAL), counts)
