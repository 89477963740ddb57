"""One device of a running recording: from queued bytes to stamped samples in the body frame, and how it fares."""

from collections.abc import Iterator
from dataclasses import fields, replace
from numbers import Integral
from typing import NamedTuple

import numpy as np

from rig.devices.conversation import Identity
from rig.devices.parser import Counts, Sample, turned
from rig.record.device_clock import ClockTracker, CounterClock
from rig.record.reader import Event, Reader
from rig.record.rig_file import IDENTITY, DeviceEntry

SILENCE = 1.0  # seconds without a sample that are worth a message
LAST_SILENCE = 0.3  # the same at the end of a recording
JUMPED = 20  # samples in a row off the device's clock, after which it counts as set anew
BUFFERED = 8192  # bytes that adapter and system may hold back and give at once
BABBLE = 2000  # bytes without a sample that are worth a message
LATE = 10_000_000  # ns by which a stamp of the device's clock has proved late, that are worth a message


class Measurement(NamedTuple):
    """A sample on the host's clock: arrival and time of measurement [ns], counter, values in the body frame."""

    arrival: int
    stamp: int
    sequence: int
    values: tuple[float, ...]


class DeviceSource:
    """Follows one device. ``state`` is 'ok', 'unplugged', 'silent' or 'babbling'."""

    def __init__(self, entry: DeviceEntry, reader: Reader, *, now: int) -> None:
        self.entry, self.reader = entry, reader
        self.state = "ok"
        self.troubles: list[str] = []
        self.reconnects = 0
        self.downtime = 0  # ns without samples, in states other than ok
        self.clock_jumps = 0  # samples whose device time is no clock's; they are stamped by their arrival
        self._was_late, self._untimed = False, False
        self.identity = reader.identity or Identity()
        self._past = Counts()
        serial = not entry.device.NETWORK and not entry.port.startswith(("udp:", "tcp:"))
        self._byte_time = 10e9 / entry.baudrate if serial and entry.paced else 0.0
        self._paced_bytes, self._paced_from = 0, now
        self._matrix = np.array(entry.matrix)
        self._plain = entry.matrix == IDENTITY or entry.device.measures == "values"
        self._stamped_by = ""
        self._fresh()
        self.begin(now)

    def begin(self, now: int) -> None:
        """Restart counts and stamps here; the fit of the clocks goes on."""
        self.parser.begin()
        self.clock.begin()
        self._forget_counter()  # the parser has forgotten its wraps
        self._last_sample, self._bytes_since, self._before = now, 0, 0
        self._jumped_over = 0  # samples that only a jump of the clock makes seem missing

    def _fresh(self) -> None:
        self.parser = self.entry.device.parser()
        self.clock, self._latest = ClockTracker(), 0
        self._jumped, self._after_jump, self._jumped_over = 0, False, 0
        self._forget_counter()

    def _forget_counter(self) -> None:
        if self._stamped_by == "counter":
            self.clock = ClockTracker()
        self._counter = CounterClock()

    @property
    def counts(self) -> Counts:
        """All counts since the start, over reconnections."""
        now = replace(self.parser.counts, missing=self.parser.counts.missing - self._jumped_over)
        return Counts(**{f.name: getattr(self._past, f.name) + getattr(now, f.name) for f in fields(Counts)})

    def take(self, event: Event) -> Iterator[Measurement]:
        """The measurements that an event completes; keeps ``state`` up to date."""
        if event.lost:
            self._change("unplugged", event.time)
        elif event.answered is not None:
            yield from self._reconnect(event.answered, event.time)
        else:
            self._bytes_since += len(event.data)
            self._check_pace(event)
            before = self.parser.counts.bytes
            samples = self.parser.feed(event.data)
            end = before + len(event.data)
            if samples:
                yield from self._measure_all(samples, event.time, end)
                self._change("ok", event.time)
                self._last_sample, self._bytes_since = event.time, 0

    def _check_pace(self, event: Event) -> None:
        """Bytes that come faster than the baud rate are proof that there is none, as on USB: none waits for others."""
        self._paced_bytes += len(event.data)
        least = (self._paced_bytes - BUFFERED) * self._byte_time  # ns that they take at the baud rate
        if self._byte_time and least > 1.05 * (event.time - self._paced_from):
            self._byte_time, self.clock = 0.0, ClockTracker()
            self._forget_counter()
            what = f"faster than {self.entry.baudrate} baud, as on USB, which has none"
            self.troubles.append(f"{self.entry.name}: {what}")

    def _reconnect(self, identity: Identity, now: int) -> Iterator[Measurement]:
        yield from self._rest(now)
        self._past, self.identity = self.counts, identity
        self._before = self._past.samples + self._past.missing
        self.reconnects += 1
        self._fresh()
        self._bytes_since = 0

    def _rest(self, now: int) -> Iterator[Measurement]:
        """Take the samples that the parser still held back when the bytes ended."""
        if samples := self.parser.finish():
            yield from self._measure_all(samples, now, self.parser.counts.bytes)

    def _measure_all(self, samples: list[Sample], arrival: int, end: int) -> Iterator[Measurement]:
        """Measurements of samples that were read together."""
        last = end + self.entry.device.FRAME_BYTES
        arrived = [arrival - round((last - sample.end) * self._byte_time) for sample in samples]
        samples = self._timed(samples)
        times = [self._device_time(sample) for sample in samples]
        known = [(time, at) for time, at in zip(times, arrived, strict=True) if time is not None]
        if len(known) > 1:
            self.clock.foresee(known)
        ordered = arrived if known else self._in_order(arrived)
        for sample, at, in_order in zip(samples, arrived, ordered, strict=True):
            yield self._measure(sample, arrival, at, in_order)

    def _timed(self, samples: list[Sample]) -> list[Sample]:
        """Samples without device times that are no whole numbers of ns, which another package's parser may give."""
        if all(sample.time is None or isinstance(sample.time, Integral) for sample in samples):
            return samples
        if not self._untimed:
            self._untimed = True
            what = "gives times that are no int in ns: its samples are stamped on arrival until its parser is corrected"
            self.troubles.append(f"{self.entry.name}: its kind '{self.entry.device.kind}' {what}")
        return [sample._replace(time=None) for sample in samples]

    def _device_time(self, sample: Sample) -> int | None:
        """Device time [ns] of a sample, by its clock or by a counter whose period is known."""
        by_counter = sample.counter is not None and self._counter.period and self._stamped_by == "counter"
        return self._counter.time(sample.counter or 0) if sample.time is None and by_counter else sample.time

    def _measure(self, sample: Sample, arrival: int, arrived: int, in_order: int) -> Measurement:
        jumps = self.clock_jumps
        if sample.time is not None:
            self._stamped_by, stamp = "clock", self._stamp(sample.time, arrived)
        elif sample.counter is not None and self._stamped_by != "arrival":
            stamp = self._count(sample.counter, arrived, in_order)
        else:
            stamp = in_order
        self._jumped_over += sample.gap * (self._after_jump or self.clock_jumps > jumps)
        self._after_jump = self.clock_jumps > jumps
        number = sample.number if sample.counter is not None else sample.number + self._before - self._jumped_over
        return Measurement(
            arrival, stamp, number, sample.values if self._plain else turned(self._matrix, sample.values)
        )

    def _in_order(self, arrived: list[int]) -> list[int]:
        """Arrivals, half a sample apart where bytes were held up: none later than it was, all after those before."""
        times, half = list(arrived), round(0.5e9 / self.entry.device.rate) if self.entry.device.rate else 0
        for k in range(len(times) - 1, 0, -1):
            times[k - 1] = min(times[k - 1], times[k] - half)
        if times[0] < (before := self._latest) + bool(half):
            count, room = len(times), max(times[-1] - before, len(times))
            times = [before + room * (k + 1) // count for k in range(count)]
        self._latest = times[-1]
        return times

    def _stamp(self, device: int, arrived: int) -> int:
        """The time of measurement, by the device's clock as long as it is one."""
        if not self.clock.jumps(device, arrived):
            self._jumped = 0
            stamp = self.clock.stamp(device, arrived)
            if self.clock.stamp_excess > LATE and self._stamped_by == "clock" and not self._was_late:
                self._was_late = True
                why = "its bytes waited to be read, or its clock is not steady"
                self.troubles.append(
                    f"{self.entry.name}: stamps until here are late by {LATE // 10**6} ms or more: {why}"
                )
            return stamp
        if not self.clock_jumps:
            self.troubles.append(f"{self.entry.name}: its clock jumps: these samples are stamped on arrival")
        self.clock_jumps += 1
        self._jumped += 1
        if self._jumped == JUMPED:
            self.clock, self._jumped = ClockTracker(), 0
            self._forget_counter()
        return arrived

    def _count(self, counter: int, arrived: int, in_order: int) -> int:
        """The time of measurement by a device's counter, once its period is known and as long as it is steady."""
        self._stamped_by = "counter"
        if not self._counter.period:
            if clock := self._counter.learn(counter, arrived):
                self.clock = clock
                clock.go_on(self._counter.time(counter), in_order)
            return in_order
        jumped = self.clock_jumps
        stamp = self._stamp(self._counter.time(counter), arrived)
        if self.clock_jumps == jumped and not self._counter.watch(arrived, stamp):
            self._stamped_by = "arrival"
            self.troubles.append(
                f"{self.entry.name}: its counter has no steady rate: samples are stamped on arrival from here on"
            )
        return stamp

    @property
    def stamping(self) -> dict[str, object]:
        """Origin of the stamps, and the quality of a counter's fit."""
        facts: dict[str, object] = {"stamped_by": self._stamped_by or "arrival"}
        if self._stamped_by == "counter":
            uncertainty = self._counter.uncertainty
            facts["counter_period_ns"] = round(self._counter.period * (1 + self.clock.fit.skew), 3)
            facts["stamp_uncertainty_us"] = None if uncertainty is None else round(uncertainty * 1e-3, 1)
        return facts

    def look(self, now: int, *, patience: float = SILENCE) -> None:
        """Notice silence and babble of more than ``patience`` [s] and 20 sample periods; call a few times a second."""
        rate = self.entry.device.rate
        patience = max(patience, 20 / rate) if rate else 5.0
        if self.entry.required and self.state != "unplugged" and now - self._last_sample > patience * 1e9:
            self._change("babbling" if self._bytes_since > BABBLE else "silent", now)

    def _change(self, state: str, now: int) -> None:
        if state == self.state:
            return
        if state == "ok":
            self.downtime += now - self._last_sample
            self.troubles.append(f"{self.entry.name}: samples again after {(now - self._last_sample) * 1e-9:.1f} s")
        else:
            self.troubles.append(f"{self.entry.name}: {TROUBLES[state].format(port=self.entry.port)}")
        self.state = state

    def finish(self, now: int) -> list[Measurement]:
        """The recording has ended; a sensor that went silent just before has lost data all the same."""
        self.look(now, patience=LAST_SILENCE)
        if self.state != "ok":
            self.downtime += now - self._last_sample
        return list(self._rest(now))

    @property
    def incomplete(self) -> str:
        """Reasons why data are missing, as far as host and device can tell; empty if none are."""
        counts, line = self.counts, self.entry.device.kind == "line"
        kind = "lines that are not as `columns` says" if line else "frames with a wrong checksum"
        reasons = {
            f"{counts.missing} missing": counts.missing,
            f"{counts.failures} bad ({kind})": counts.failures,
            "bytes between frames": counts.resynchronisations and not counts.failures,
            f"{self.reader.overflow} bytes came faster than they were written": self.reader.overflow,
            f"{self.downtime * 1e-9:.1f} s without samples": self.downtime,
            "no samples": self.entry.required and not counts.samples,
        }
        return ", ".join(text for text, count in reasons.items() if count)

    @property
    def complete(self) -> bool:
        """Whether no sample is missing, as far as host and device can tell."""
        return not self.incomplete


TROUBLES = {
    "unplugged": "port {port} lost, waiting for it to come back: check the cable",
    "silent": "no more samples from {port}: check its power and cable",
    "babbling": "invalid data from {port}: check the cable, the baud rate and that only one device is on it",
}
