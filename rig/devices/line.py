"""Any device that prints numbers, a line per sample, described in the rig file; also what a platform sends over UDP.

``columns = ["time us", "force_x N", "_", ...]`` names each column and its unit; ``_`` passes a column over. With the
six names of a wrench or an IMU the device measures that; any other names are recorded as named values. ``time`` and
``counter`` are the device's clock and counter. ``force_x 0.0125 N`` is a column of counts, each 0.0125 N.
"""

import math
from typing import ClassVar

from rig.devices.base import IMU, WRENCH, Device, Emulator, Measures
from rig.devices.parser import NO_FRAME, WAIT, Parser, Sample
from rig.exceptions import RigError, listed, quoted

GRAVITY = 9.80665  # m/s^2, standard
POUND = 4.4482216152605  # N, of a pound-force
UNITS_OF = {
    "force": {"N": 1.0, "kN": 1e3, "gf": 1e-3 * GRAVITY, "kgf": GRAVITY, "lbf": POUND},
    "moment": {
        "N*m": 1.0,
        "N*mm": 1e-3,
        "gf*cm": 1e-5 * GRAVITY,
        "kgf*cm": 1e-2 * GRAVITY,
        "kgf*m": GRAVITY,
        "lbf*in": 0.0254 * POUND,
        "lbf*ft": 0.3048 * POUND,
    },
    "omega": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "specific_force": {"m/s^2": 1.0, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "length": {"m": 1.0, "mm": 1e-3},
    "time": {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0},
}
"""Units and their factors to SI, of time to ns, by quantity."""
UNITS = {unit: factor for units in UNITS_OF.values() for unit, factor in units.items()}
LONGEST = 512


class LineParser(Parser):
    """Lines to samples.

    What comes before the first line end may be half a line and is passed over; so are empty lines, comments (``#``),
    and any text before the first line of numbers.
    """

    MODULUS = 2**32
    NARROW = (2**8, 2**16)

    def __init__(self, device: "Line") -> None:
        super().__init__()
        self._device = device
        self._at_start = bool(device.options["whole_lines"])
        self._modulus, self._before, self._largest = self.MODULUS, 0, 0

    def modulus(self, raw: int) -> int:
        """A counter's width is not declared: 8 or 16 bits show where it goes from near their end to near zero."""
        if raw < self._before:
            width = next((width for width in self.NARROW if self._largest < width), self.MODULUS)
            if (raw - self._before) % width <= width // 16:
                self._modulus = width
        elif raw >= self._modulus:
            self._modulus = self.MODULUS
        self._before, self._largest = raw, max(raw, self._largest)
        return self._modulus

    def frame_length(self, buffer: bytearray, start: int) -> int:
        """The length of a line that holds the right number of numbers."""
        end = buffer.find(b"\n", start)
        if end < 0:
            return WAIT
        line = bytes(buffer[start:end])
        good = len(line) <= LONGEST and self._device.numbers(line) is not None
        return end + 1 - start if good else NO_FRAME

    def _drain(self, *, final: bool) -> list[Sample]:
        """A frame is a line here, good or bad: there is no search for a frame inside a bad line."""
        buffer, samples, position = self._buffer, list[Sample](), 0
        while (end := buffer.find(b"\n", position)) >= 0:
            length = end + 1 - position
            if not self._at_start:
                self._skip(length)
            elif self.frame_length(buffer, position) == length:
                self._accept(bytes(buffer[position : end + 1]), samples)
            elif bytes(buffer[position:end]).strip()[:1] in (b"", b"#"):  # empty, or a comment
                self.counts.skipped += length
                self._done += length
            else:
                self._reject(length)
            self._at_start = True
            position = end + 1
        rest = len(buffer) - position
        if rest > LONGEST or (final and rest):
            self._reject(rest, cut=final)
            self._at_start = False
            position = len(buffer)
        del buffer[:position]
        return samples

    def samples(self, frame: bytes) -> list[Sample]:
        """The sample of a line."""
        numbers = self._device.numbers(frame)
        return [] if numbers is None else [self._device.sample(numbers)]


class Line(Device):
    """Options: ``columns``; ``separator`` (default any white space); ``rate`` [Hz], to notice silence.

    ``whole_lines`` says that the first byte is the start of a line, as in a UDP datagram.
    """

    ASKED = False  # it cannot answer
    MEASURES = "values"
    BAUDRATE = 115200
    FRAME_BYTES = 64
    OPTIONS: ClassVar[dict[str, object]] = {"columns": [], "separator": "", "rate": 0.0, "whole_lines": False}

    def __init__(self, **options: object) -> None:
        super().__init__(**options)
        columns = self.options["columns"]
        if not isinstance(columns, list) or not columns:
            raise RigError("option 'columns' of a line device is missing: name each column and its unit")
        self._columns = [_column(text) for text in columns]
        self._separator = str(self.options["separator"]).encode() or None
        used = [name for name, _ in self._columns if name != "_"]
        if len(set(used)) < len(used):
            raise RigError("option 'columns' of a line device names a column twice: give every column its own name")
        self.names = self._order([name for name in used if name not in ("time", "counter")])
        self._where = {name: i for i, (name, _) in enumerate(self._columns)}

    @staticmethod
    def _order(names: list[str]) -> tuple[str, ...]:
        for kind in (WRENCH, IMU):
            if set(names) == set(kind):
                return kind
        return tuple(names)

    @property
    def measures(self) -> Measures:
        """Meaning of the columns."""
        if self.names == WRENCH:
            return "wrench"
        return "imu" if self.names == IMU else "values"

    def numbers(self, line: bytes) -> list[float] | None:
        """The numbers of a line, or None when it has not the right form."""
        words = line.split(self._separator)
        if len(words) != len(self._columns):
            return None
        try:
            values = [0.0 if name == "_" else float(word) for word, (name, _) in zip(words, self._columns, strict=True)]
        except ValueError:
            return None
        scaled = (value * factor for value, (_, factor) in zip(values, self._columns, strict=True))
        return values if all(map(math.isfinite, scaled)) else None

    def sample(self, numbers: list[float]) -> Sample:
        """The sample of a line's numbers, in SI."""
        scaled = [value * factor for value, (_, factor) in zip(numbers, self._columns, strict=True)]
        time = round(scaled[self._where["time"]]) if "time" in self._where else None
        counter = round(numbers[self._where["counter"]]) if "counter" in self._where else None
        return Sample(tuple(scaled[self._where[name]] for name in self.names), time=time, counter=counter)

    def parser(self) -> LineParser:
        """Return a fresh parser."""
        return LineParser(self)

    def text(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """The line of one sample."""
        by_name = {**dict(zip(self.names, values, strict=True)), "time": time * 1e9, "counter": float(index)}
        words = [repr(by_name.get(name, 0.0) / factor) for name, factor in self._columns]
        return (str(self.options["separator"]) or " ").join(words).encode() + b"\n"


def _column(text: object) -> tuple[str, float]:
    """Name and factor of a column, such as ``force_x N``, or ``force_x 0.0125 N`` where a count is 0.0125 N."""
    name, *rest = str(text).split() or [""]
    units = UNITS_OF.get(name[:-2] if name in (*WRENCH, *IMU) else name, UNITS)
    units = units if name == "time" else {"1": 1.0, **units}
    *counts, unit = rest or ["1"]
    if unit not in units or len(counts) > 1:
        raise RigError(f"column {quoted(text)} of a line device has an unknown unit: choose one of {listed(units)}")
    try:
        factor = float(*counts) if counts else 1.0
    except ValueError:
        factor = math.nan
    if not (math.isfinite(factor * units[unit]) and factor):
        raise RigError(f"column {quoted(text)} of a line device has no factor: write the size of a count and its unit")
    return name, units[unit] * factor


class LineEmulator(Emulator):
    """Prints a line per sample from the moment it is opened."""

    STREAMS = True
    device: Line

    def receive(self, data: bytes) -> bytes:
        """Answer nothing, as the device listens to nobody."""
        return b""

    def frame(self, index: int, time: float, values: tuple[float, ...]) -> bytes:
        """Return the bytes of one line."""
        return self.device.text(index, time, values)
