"""Connected devices: starts every reader of a rig, emulators included, and hands out their measurements."""

import json
import math
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from rig.child_process import start_module
from rig.devices.base import LEAST_RATE, MOST_RATE
from rig.exceptions import RigError, quoted
from rig.record.device_source import DeviceSource, Measurement
from rig.record.port import latency_warning
from rig.record.reader import Event, Reader
from rig.record.rig_file import DeviceEntry, Rig

CONNECT_LIMIT = 12.0  # seconds for all devices to introduce themselves
FIRST_SAMPLE = 2.0  # seconds until every device must have sent a sample, once it is started
CATCH_UP = 0.5  # seconds to read what waited in the ports; a reader that never waits is not waited for
LAST_BYTES = 0.05  # seconds
COARSE = 1e-3  # seconds; what Windows had before Python 3.13
EMULATOR_OPTIONS = {
    "skew_ppm": (-100_000.0, 100_000.0),
    "delay": (-3600.0, 3600.0),
    "rate": (LEAST_RATE, MOST_RATE),
    "loop": (0.0, 1.0),
    "lose": (0.0, 1e9),
    "swap": (0.0, 1e9),
}
"""Least and greatest value of each option of an emulator."""


class Emulators:
    """The process that plays a run through emulated sensors, for the rig's ports ``emulator:RUN.mcap``."""

    def __init__(self, entries: list[DeviceEntry], folder: Path) -> None:
        if not hasattr(os, "openpty"):
            raise RigError("no emulated sensors on this system, which has no pseudo-terminals: use Linux, macOS or WSL")
        specs = [_spec(entry, folder) for entry in entries]
        self.process = start_module(
            "rig.emulation", stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        self.command(json.dumps(specs))

    def ports(self) -> dict[str, str]:
        """Wait until the emulators are there; their ports by device name, and how long the run is in ``duration``."""
        answer = self._answer()
        self.duration: float | None = answer["duration"]
        return answer["ports"]

    def go(self) -> float:
        """Start the run; returns when it starts [s, monotonic]."""
        self.command("go")
        return self._answer()["start"]

    def command(self, text: str) -> None:
        """Send one command line (see ``rig.emulation.__main__``)."""
        assert self.process.stdin is not None  # noqa: S101
        with suppress(BrokenPipeError):  # the missing answer shows it
            self.process.stdin.write(text.encode() + b"\n")
            self.process.stdin.flush()

    def _answer(self) -> dict:
        assert self.process.stdout is not None  # noqa: S101
        line = self.process.stdout.readline()
        answer = (
            json.loads(line)
            if line.endswith(b"\n")
            else {"error": "the emulators have ended unexpectedly: start again"}
        )
        if "error" in answer:
            raise RigError(answer["error"])
        return answer

    def close(self) -> None:
        """End the process."""
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        try:
            self.process.wait(2)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _spec(entry: DeviceEntry, folder: Path) -> dict:
    name, _, query = entry.port.removeprefix("emulator:").partition("?")
    spec: dict = {"name": entry.name, "kind": entry.device.kind, "options": entry.device.options}
    spec |= dict(_emulator_option(entry, text) for text in query.split("&") if text)
    if entry.device.NETWORK != "udp" and spec.keys() & {"lose", "swap"}:
        raise RigError(f"options 'lose' and 'swap' in the port of {entry.name} are for devices on UDP: remove them")
    run = name if os.path.isabs(name) else str(folder / name)
    if not os.path.isfile(run):
        raise RigError(f"no run {run} for the emulated {entry.name}: write one with `inertia simulate`")
    return {**spec, "run": run, "baudrate": entry.baudrate, "matrix": entry.matrix}


def _emulator_option(entry: DeviceEntry, text: str) -> tuple[str, float]:
    """Name and value of one option behind a port's question mark."""
    key, _, written = text.partition("=")
    if key not in EMULATOR_OPTIONS:
        raise RigError(
            f"unknown option {quoted(key)} in the port of {entry.name}: it takes {', '.join(EMULATOR_OPTIONS)}"
        )
    least, most = EMULATOR_OPTIONS[key]
    try:
        value = float(written)
    except ValueError:
        value = math.nan
    if not least <= value <= most:  # so written that NaN is refused
        raise RigError(
            f"option '{key}' in the port of {entry.name} is {quoted(written)}: give a number from {least:g} to {most:g}"
        )
    return key, value


class Stop:
    """A request for the end, from any thread or a signal's handler.

    A handler runs between two steps of the thread that waits here. :class:`threading.Event` holds a lock in some of
    these steps, for which its handler would then wait for ever.
    """

    def __init__(self) -> None:
        self._asked = False

    def set(self) -> None:
        """Ask for the end."""
        self._asked = True

    def is_set(self) -> bool:
        """Return whether the end was asked for."""
        return self._asked

    def wait(self, seconds: float) -> bool:
        """Wait so long, and return whether the end was asked for."""
        if not self._asked:
            time.sleep(seconds)
        return self._asked


class Session:
    """All devices of a rig, connected. Use as a context manager.

    Raises:
        RigError: a port cannot be opened, or a device does not answer or sends no samples.
    """

    def __init__(self, rig: Rig, cancelled: Stop | None = None) -> None:
        self._rig = rig
        self._cancelled = cancelled or Stop()
        self._emulators: Emulators | None = None
        self._readers: list[Reader] = []
        self.sources: list[DeviceSource] = []

    def __enter__(self) -> "Session":
        try:
            self._connect()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _connect(self) -> None:
        emulated = [e for e in self._rig.entries if e.port.startswith("emulator:")]
        ports = {e.name: e.port for e in self._rig.entries}
        if emulated:
            self._emulators = Emulators(emulated, self._rig.path.parent)
            ports |= self._emulators.ports()
        self._readers = [Reader(entry, ports[entry.name]) for entry in self._rig.entries]
        for reader in self._readers:
            reader.start()
        cure = "from {0.name} on {0.port}: check its power, cable and `kind`"
        self._wait(
            lambda: [reader.entry for reader in self._readers if reader.identity is None],
            CONNECT_LIMIT,
            f"no answer {cure}",
        )
        self._wait(
            lambda: [reader.entry for reader in self._readers if reader.entry.required and not reader.events],
            FIRST_SAMPLE,
            f"no bytes {cure}",
        )
        now = time.monotonic_ns()
        self.sources = [DeviceSource(reader.entry, reader, now=now) for reader in self._readers]
        self._wait(
            self._without_sample, FIRST_SAMPLE, "no valid data in the bytes of {0.name} on {0.port}: {0.wrong_device}"
        )

    def _wait(self, missing: Callable[[], list[DeviceEntry]], seconds: float, complaint: str) -> None:
        """Wait so long until no device is missing; then complain of the first."""
        deadline = time.monotonic() + seconds
        while entries := missing():
            self.raise_failures()
            if self._cancelled.is_set():
                raise RigError("stopped before all devices had answered: nothing was recorded, start again")
            if time.monotonic() > deadline:
                raise RigError(complaint.format(entries[0]))
            time.sleep(0.002)

    def _without_sample(self) -> list[DeviceEntry]:
        """Take what has come; every device must send something that makes sense before a recording starts."""
        for source in self.sources:
            for _ in self.measurements(source):
                pass
        return [s.entry for s in self.sources if s.entry.required and not s.counts.samples]

    @property
    def warnings(self) -> list[str]:
        """Warnings of the devices and ports."""
        texts = [f"{s.entry.name}: {text}" for s in self.sources for text in s.identity.warnings]
        if (step := time.get_clock_info("monotonic").resolution) > COARSE:
            texts.append(f"the clock steps by {1000 * step:.0f} ms: Python 3.13 or newer has a better one")
        return texts + [text for e in self._rig.entries if (text := latency_warning(e.port))]

    @property
    def duration(self) -> float | None:
        """Duration of the emulated run, with some time for its last bytes [s]; None with real devices."""
        duration = self._emulators.duration if self._emulators else None
        return None if duration is None else duration + LAST_BYTES

    def go(self) -> None:
        """Discard what came until now and restart the counts; emulated runs start."""
        start = self._emulators.go() if self._emulators else 0.0
        while time.monotonic() < start - 0.005:
            time.sleep(0.001)
        deadline = time.monotonic() + CATCH_UP
        while not all(reader.caught_up for reader in self._readers) and time.monotonic() < deadline:
            time.sleep(0.001)
        self._without_sample()
        for source in self.sources:
            source.begin(time.monotonic_ns())

    def events(self, source: DeviceSource) -> Iterator[Event]:
        """Return the events that have come from a device and were not taken yet."""
        queue = source.reader.events
        for _ in range(len(queue)):
            event = queue.popleft()
            source.reader.taken += len(event.data)
            yield event

    def measurements(self, source: DeviceSource) -> Iterator[Measurement]:
        """The measurements that have come from a device and were not taken yet."""
        for event in self.events(source):
            yield from source.take(event)

    def raise_failures(self) -> None:
        """Raise what ended a reader thread: a dead thread is never left behind in silence."""
        for reader in self._readers:
            if reader.failure is not None:
                failure, reader.failure = reader.failure, None
                if isinstance(failure, RigError):
                    raise failure
                raise RigError(f"the reader of {reader.entry.name} failed ({failure!r}): please report this")

    def command(self, text: str) -> None:
        """Send a command to the emulators, for tests."""
        if self._emulators:
            self._emulators.command(text)

    def halt(self) -> None:
        """Stop the devices and wait for their reader threads; what they still sent can be taken afterwards."""
        for reader in self._readers:
            reader.halt()
        for reader in self._readers:
            if reader.is_alive():
                reader.join(3.0)

    def close(self) -> None:
        """Stop all readers and emulators."""
        self.halt()
        if self._emulators:
            self._emulators.close()
