"""The recorder: one writer that takes what the readers queued and writes it, chunk by chunk, to an MCAP file."""

import contextlib
import json
import platform
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rig.exceptions import RigError, cure
from rig.mcap import cdr, message_definitions
from rig.mcap.records import seal
from rig.mcap.writer import new_writer, register
from rig.record import command_delay, memory
from rig.record.device_source import DeviceSource, Measurement
from rig.record.recording_file import OutputChannel, Sink, outputs
from rig.record.rig_file import Rig
from rig.record.session import Session, Stop

TICK = 0.01  # seconds between two looks at the queues
FLUSH = 0.05  # seconds of data that a killed recorder may lose, at most, with TICK
STATUS = 1.0  # seconds between two status messages
TRIM = 10.0  # seconds between two returns of free memory
ODD_SKEW = 0.005  # no crystal is so far off: the device counts something else than it says
DELAY_SAMPLES = 60_000  # samples kept for the delay between a command and the IMU
MEANING = {
    "wrench": "on_body",
    "wrench_meaning": "force [N] and moment [N*m] on the body at the load cell's centre Q, body frame",
    "imu": "angular velocity [rad/s] and specific force [m/s^2], body frame",
    "log_time": "arrival at host; header.stamp: device clock or counter in host time, or arrival less transmission",
}
"""Meaning of a recording's numbers, for its metadata ``rig.run``."""


@dataclass
class Summary:
    """Summary of a finished recording.

    Attributes:
        file: where it is.
        seconds: how long it ran.
        bytes: size of the file.
        complete: whether nothing is missing, as far as devices and host can tell.
        devices: per device its counts, rates, clock and troubles.
        marks: number of marks.
        warnings: what the user should know.
        delays: per command device its delay to the IMU [s] and their correlation.
    """

    file: str
    seconds: float = 0.0
    bytes: int = 0
    complete: bool = False
    devices: dict[str, dict[str, object]] = field(default_factory=dict)
    marks: int = 0
    warnings: list[str] = field(default_factory=list)
    delays: dict[str, dict[str, float]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return the summary as plain values for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Progress:
    """Progress of a recording: seconds, bytes in the file, and its sources."""

    seconds: float
    bytes: int
    sources: list[DeviceSource]


class Recorder:
    """Records a rig to a file. ``stop`` may be called from anywhere, ``mark`` from any thread."""

    def __init__(self, rig: Rig, path: Path, *, note: str = "", say: Callable[[str], None] = lambda text: None) -> None:
        self._rig, self._path, self._note, self._say = rig, path, note, say
        self._stopped = Stop()
        self._marks: deque[tuple[int, str]] = deque()
        self._epoch = time.time_ns() - time.monotonic_ns()  # once: a wall clock that is set later changes nothing
        self.summary = Summary(str(path))
        self._signals: dict[str, command_delay.Signal] = {}

    def stop(self) -> None:
        """End the recording at the next tick."""
        self._stopped.set()

    def mark(self, name: str) -> None:
        """Write a named mark to ``/mark``."""
        self._marks.append((time.monotonic_ns(), name))

    def run(self, seconds: float | None = None, *, progress: Callable[[Progress], None] | None = None) -> Summary:
        """Record for so long, or until ``stop``, or to the end of an emulated run.

        Raises:
            RigError: a device is not there, the file exists or was deleted meanwhile, or the disk is full.
            OSError: the file cannot be written.
        """
        with Session(self._rig, self._stopped) as self._session:
            self._say_all(self._session.warnings)
            with contextlib.closing(Sink(self._path)) as self._sink:
                try:
                    self._record(seconds or self._session.duration, progress)
                except OSError as error:
                    raise self._full(error) from error
                finally:
                    if not self._sink.whole:
                        self._sink.remove()
                self._check_place()
        return self.summary

    def _check_place(self) -> None:
        """Say that the file is no longer where it was opened. Raises ``RigError`` when it is gone."""
        if self._sink.place == "deleted":
            raise RigError(
                f"output deleted while recording {self._path}: what was recorded is lost, "
                "record again and leave the file until the end"
            )
        if self._sink.place == "cut":
            self._say_all(
                [
                    f"{self._path} was cut by another program while recording: what was written until then is lost, "
                    f"`inertia recover {self._path} -o NEW.mcap` saves the rest"
                ]
            )
        if self._sink.place == "moved":
            self._say_all([f"{self._path} was moved or replaced while recording: look for the file under its new name"])

    def _say_all(self, warnings: list[str]) -> None:
        self.summary.warnings += warnings
        for text in warnings:
            self._say(f"warning: {text}")

    def _full(self, error: OSError) -> RigError:
        with contextlib.suppress(OSError):
            self._sink.cut_back()
        if not self._sink.whole:
            return RigError(f"cannot write {self._path} ({error.strerror}): nothing was recorded, {cure(error)}")
        return RigError(
            f"cannot write {self._path} ({error.strerror}) after {self.summary.seconds:.1f} s: {cure(error)}; "
            f"what was recorded until then is kept, `inertia recover {self._path} -o NEW.mcap` reads it"
        )

    def _record(self, seconds: float | None, progress: Callable[[Progress], None] | None) -> None:
        self._writer = new_writer(self._sink, chunk_size=2**20)
        self._writer.add_metadata("rig.run", seal("rig.run", self._metadata()))
        self._register()
        self._session.go()
        start = time.monotonic_ns()
        self._say("ready: recording")
        try:
            self._follow(start, seconds, progress)
        except RigError as error:
            self._finish(start)
            raise RigError(f"{error}; what was recorded until then is in {self._path}") from error
        self._finish(start)

    def _follow(self, start: int, seconds: float | None, progress: Callable[[Progress], None] | None) -> None:
        """Write what arrives until the time is over."""
        next_flush, next_status, next_trim = start, start, start
        end = float("inf") if seconds is None else start + seconds * 1e9
        while not self._stopped.wait(TICK) and (now := time.monotonic_ns()) < end:
            self._drain()
            self.summary.seconds = (now - start) * 1e-9
            for source in self._session.sources:
                source.look(now)
            if now >= next_status:
                next_status = now + round(STATUS * 1e9)
                self._status(now)
                if self._sink.place == "deleted":
                    return
                if progress is not None:
                    progress(Progress(self.summary.seconds, self._sink.tell(), self._session.sources))
            if now >= next_flush:
                next_flush = now + round(FLUSH * 1e9)
                self._writer.flush()
                self._sink.mark_whole()
            if now >= next_trim:
                next_trim = now + round(TRIM * 1e9)
                memory.give_back()
            self._session.raise_failures()

    def _register(self) -> None:
        """Announce every channel."""
        self._outputs: dict[str, list[OutputChannel]] = {}
        self._raw = {}
        for source in self._session.sources:
            entry = source.entry
            self._outputs[entry.name] = outputs(self._writer, entry)
            self._raw[entry.name] = register(self._writer, message_definitions.BYTES, f"/raw/{entry.name}")
            if entry.delay_to:
                for name in (entry.name, entry.delay_to):
                    self._signals[name] = deque(maxlen=DELAY_SAMPLES)
        self._status_channel = register(self._writer, message_definitions.DIAGNOSTICS, "/diagnostics")
        self._mark_channel = register(self._writer, message_definitions.TEXT, "/mark")

    def _drain(self) -> None:
        """Write everything that has arrived."""
        for source in self._session.sources:
            name = source.entry.name
            channels, signal = self._outputs[name], self._signals.get(name)
            for event in self._session.events(source):
                if event.data:
                    self._add(self._raw[name], event.time, cdr.encode_bytes(event.data))
                for measurement in source.take(event):
                    self._write(channels, measurement)
                    if signal is not None:
                        signal.append((measurement.stamp, measurement.values))
        self._report_troubles()
        while self._marks:
            time_, text = self._marks.popleft()
            self._add(self._mark_channel, time_, cdr.encode_text(text), self.summary.marks)
            self.summary.marks += 1

    def _report_troubles(self) -> None:
        for source in self._session.sources:
            while source.troubles:
                text = source.troubles.pop(0)
                self._say(text)
                self._diagnose(time.monotonic_ns(), [(cdr.WARN, source, text)])

    def _write(self, channels: list[OutputChannel], measurement: Measurement) -> None:
        arrival, stamp, number, values = measurement
        stamp += self._epoch
        for channel, encode, part in channels:
            data = encode(stamp, values[part])
            self._writer.add_message(channel, arrival + self._epoch, data, stamp, number & 0xFFFFFFFF)

    def _status(self, now: int) -> None:
        states = [(source, source.state) for source in self._session.sources]
        self._diagnose(now, [(cdr.OK if state == "ok" else cdr.ERROR, source, state) for source, state in states])

    def _diagnose(self, now: int, rows: list[tuple[int, DeviceSource, str]]) -> None:
        """Write a status message of (level, device, text)."""
        statuses = [(level, source.entry.name, text, self._facts(source)) for level, source, text in rows]
        self._add(self._status_channel, now, cdr.encode_diagnostics(now + self._epoch, statuses))

    def _add(self, channel: int, now: int, data: bytes, sequence: int = 0) -> None:
        """Write a message of this time [ns, monotonic]."""
        self._writer.add_message(channel, now + self._epoch, data, now + self._epoch, sequence)

    @staticmethod
    def _facts(source: DeviceSource) -> dict[str, object]:
        return {
            **asdict(source.counts),
            "overflow_bytes": source.reader.overflow,
            "reconnects": source.reconnects,
            "clock_jumps": source.clock_jumps,
            "down_s": round(source.downtime * 1e-9, 3),
        }

    def _finish(self, start: int) -> None:
        now = time.monotonic_ns()
        self._session.halt()
        self._drain()
        summary = self.summary
        for source in self._session.sources:
            name = source.entry.name
            for measurement in source.finish(now):
                self._write(self._outputs[name], measurement)
            summary.devices[name] = self._device_summary(source)
            if abs(skew := source.clock.fit.skew) > ODD_SKEW:
                self._say_all([f"{name}: its clock and this computer's differ by {abs(skew):.1%}: verify its rate"])
        self._report_troubles()
        self._status(now)
        self._estimate_delays()
        summary.seconds = (now - start) * 1e-9
        summary.complete = all(source.complete for source in self._session.sources) and self._sink.place != "cut"
        facts = {"complete": json.dumps(summary.complete), "seconds": f"{summary.seconds:.3f}"}
        for name, device in summary.devices.items():
            facts |= {f"{name}.{key}": str(value) for key, value in device.items()}
        for name, values in summary.delays.items():
            facts |= {f"{name}.{key}": str(value) for key, value in values.items()}
        self._writer.add_metadata("rig.end", seal("rig.end", facts))
        self._writer.finish()
        self._sink.mark_whole()
        summary.bytes = self._sink.tell()

    def _device_summary(self, source: DeviceSource) -> dict[str, object]:
        fit = source.clock.fit
        counts = source.counts
        return {
            "topic": source.entry.topic,
            "state": source.state,
            "complete": source.complete,
            "incomplete": source.incomplete,
            **self._facts(source),
            "rate_hz": round(counts.samples / max(self.summary.seconds, 1e-9), 3),
            "clock_offset_ns": round(fit.offset),
            "clock_skew_ppm": round(fit.skew * 1e6, 4),
            "clock_origin_ns": fit.origin,
            **source.stamping,
        }

    def _estimate_delays(self) -> None:
        for source in self._session.sources:
            entry = source.entry
            if entry.delay_to:
                delay = command_delay.of_command(
                    getattr(entry.device, "names", ()), self._signals[entry.name], self._signals[entry.delay_to]
                )
                if delay is None:
                    self._say_all([f"{entry.name}: its delay to {entry.delay_to} cannot be determined from this run"])
                else:
                    self.summary.delays[entry.name] = {
                        "delay_s": round(delay.seconds, 6),
                        "delay_correlation": round(delay.correlation, 4),
                    }

    def _metadata(self) -> dict[str, str]:
        pairs = [pair for entry in self._rig.entries for pair in zip(entry.device.channels, entry.topics, strict=True)]
        facts = {
            "note": self._note,
            "rig_file": self._rig.path.read_text(encoding="utf-8"),
            "host": platform.platform(),
            "epoch_minus_monotonic_ns": str(self._epoch),
            **MEANING,
            # named values have the type of joint states and are none
            "values_topics": json.dumps([topic for channel, topic in pairs if channel.measures == "values"]),
        }
        for source in self._session.sources:
            name, identity = source.entry.name, source.identity
            facts |= {f"{name}.{key}": value for key, value in source.entry.settings.items()}
            facts |= {f"{name}.port": source.entry.port, f"{name}.model": identity.model}
            facts |= {f"{name}.topic": source.entry.topic}
            if more := source.entry.topics[1:]:
                facts |= {f"{name}.more_topics": json.dumps(more)}
            facts |= {f"{name}.serial_number": identity.serial, f"{name}.firmware": identity.firmware}
            if identity.warnings:
                facts[f"{name}.warnings"] = "; ".join(identity.warnings)
            facts |= {f"{name}.read_back.{key}": value for key, value in identity.settings.items()}
        return facts
