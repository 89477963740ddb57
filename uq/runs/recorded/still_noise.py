"""Noise of every channel of a recording at rest, and the ``[[source]]`` tables that declare it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.display.reporting import Result
from identify.signals.allan_noise import HIGHEST, MISFIT, PARAMETERS, AllanNoise, allan_deviation, allan_noise
from identify.signals.power_spectrum import noise_level
from identify.signals.run import RunError, refuse_excess
from identify.signals.segments import Segment, still
from rig.channels import ImuChannel, WrenchChannel
from rig.runs import read_any
from uq.experiment.recording_table import RecordingTable
from uq.files.provenance import plain_values, provenance
from uq.runs.recorded.declared_channels import declared
from uq.runs.recorded.load_run import finite_samples
from uq.runs.recorded.message_times import in_order, instants, steadily_stamped
from uq.sources.kinds.coloured import UNITS
from uq.sources.source import SIGNAL_UNITS

SHORTEST = 10.0
"""Rest that is needed [s]."""
GAP = 0.5
"""Time without samples that ends a rest [s]."""
LOST = 0.01
"""Part of a channel's samples that may be lost without a word."""
STEP_COUNTS = 0.01
"""Part of the white noise's variance from which a step's, step²/12, is declared as a quantisation."""
WHOLE = 0.98
"""Part of the recording that may be left out without a word."""
GROUPS = {"F": "load_cell", "M": "load_cell", "omega": "imu"}
ACCELEROMETER = "f"
SENSORS = (("F", "M"), ("omega", ACCELEROMETER))
"""Signals of the load cell and of the IMU."""
TARGETS = {**SIGNAL_UNITS, ACCELEROMETER: "m/s^2"}
"""Signals and their units; no source errs on the last, the specific force."""


class ChannelNoise(NamedTuple):
    """Noise of one axis of one signal."""

    quantity: str
    """Signal: F, M, omega, or f, the specific force."""
    axis: int
    """0, 1 or 2, in the body frame."""
    rate: float
    """Sample rate of the channel [Hz]."""
    noise: AllanNoise
    tau: np.ndarray
    """Averaging times of the measured Allan deviation [s]."""
    deviation: np.ndarray
    """Overlapping Allan deviation at each, the straight line taken off, in the signal's unit."""

    @property
    def unit(self) -> str:
        """Unit of the signal."""
        return TARGETS[self.quantity]


@dataclass(frozen=True, repr=False)
class StillNoise(Result):
    """Noise of every channel of a recording at rest.

    Example: ``still_noise("still.mcap").sources()``.
    """

    channels: tuple[ChannelNoise, ...]
    file: str
    """Name of the recording."""
    seconds: float
    """Duration of the rest that was used [s]."""
    warnings: tuple[str, ...] = ()
    name: str = "noise"
    kind = "inertia noise"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def sources(self) -> dict[str, Any]:
        """Return the content of a file that an experiment includes: coloured noise, steps, drifts.

        Not those of an accelerometer, on which no source errs. A random walk or flicker that is not seen is left out.
        """
        by_target = {quantity: [c for c in self.channels if c.quantity == quantity] for quantity in SIGNAL_UNITS}
        return {"source": [table for quantity, axes in by_target.items() for table in self._tables(quantity, axes)]}

    def _tables(self, quantity: str, channels: Sequence[ChannelNoise]) -> Iterator[dict[str, Any]]:
        values, steps, drifts = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
        rate = channels[0].rate if channels else 1.0
        for noise, axis in ((channel.noise, channel.axis) for channel in channels):
            values[axis] = np.where(noise.interval95[:, 0] > 0, noise.values, 0.0)
            steps[axis] = noise.step
            if abs(noise.drift) > 1.96 * noise.drift_uncertainty:
                drifts[axis] = abs(noise.drift)
        rounding, white = steps**2 / 12 / rate, values[:, 0] ** 2
        stepped = bool(steps.all() and (rounding > STEP_COUNTS * white).any())
        if stepped:
            values[:, 0] = np.sqrt(np.maximum(white - rounding, 0))
        reference = f"{self.file} at rest, {self.seconds:.4g} s"
        unit = SIGNAL_UNITS[quantity]

        def table(kind: str, **keys: Any) -> dict[str, Any]:
            about = {"name": f"{quantity}_{kind}", "target": quantity, "kind": kind}
            return {**about, **keys, "group": GROUPS[quantity], "reference": reference}

        seen = {
            name: _written(column, pattern.format(unit))
            for (name, pattern), column in zip(UNITS.items(), values.T, strict=True)
            if column.any()
        }
        if seen:
            yield table("coloured", **seen)
        if stepped:
            yield table("quantisation", step=_written(steps, unit))
        if drifts.any():
            yield table("drift", sigma=_written(drifts, f"{unit}/s"))

    def records(self) -> list[dict[str, Any]]:
        """Return the figures of each channel, in SI."""
        return [
            {"channel": f"{channel.quantity}{channel.axis + 1}", "unit": channel.unit}
            | {
                f"{name}{suffix}": float(figure)
                for name, value, ends in zip(PARAMETERS, channel.noise.values, channel.noise.interval95, strict=True)
                for suffix, figure in zip(("", "_low95", "_high95"), (value, *ends), strict=True)
            }
            | {"drift": channel.noise.drift, "drift_standard_uncertainty": channel.noise.drift_uncertainty}
            | {"step": channel.noise.step}
            for channel in self.channels
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json."""
        lines = [
            {"channel": f"{channel.quantity}{channel.axis + 1}", **line._asdict()}
            for channel in self.channels
            for line in channel.noise.lines
        ]
        content = {"file": self.file, "seconds": self.seconds, "channels": self.records(), "lines": lines}
        return {**self.form(), **content, "warnings": list(self.warnings), "provenance": plain_values(self.provenance)}


def still_noise(path: str | Path, recording: RecordingTable | None = None) -> StillNoise:
    """Return the noise of every channel of a recording at rest, of its longest part at rest where something moves.

    Args:
        path: a file or rosbag2 folder with a wrench and an IMU.
        recording: what its channels mean; None for our own runs.

    Raises:
        RigError: the file cannot be read, or its motion is no IMU's.
        RunError: it cannot be used, or does not rest for ten seconds.
    """
    recording = recording or RecordingTable()
    bag = read_any(path, wrench=recording.wrench_topic, motion=recording.motion_topic)
    bag = replace(bag, wrench=finite_samples(bag.wrench), motion=finite_samples(bag.motion))
    bag, _ = steadily_stamped(in_order(bag, recording.time)[0], recording)
    for targets, read in zip(SENSORS, _raw(bag.wrench, bag.imu), strict=True):
        refuse_excess(" and ".join(targets), read, bag.path.name)
    stamps, notes = instants((bag.wrench, bag.imu), recording.time)
    rig, name = declared(bag, recording), bag.path.name
    start = min(int(stamp[0]) for stamp in stamps)
    signals: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for stamp, targets, values in zip(stamps, SENSORS, (rig.wrench(bag.wrench), rig.motion(bag.imu)), strict=True):
        seconds = (stamp - start) * 1e-9
        signals |= {quantity: (seconds, signal) for quantity, signal in zip(targets, values, strict=True)}
    rest, whole = _rest(signals, name), max(float(seconds[-1]) for seconds, _ in signals.values())
    warnings = list(notes)
    if rest.seconds < WHOLE * whole:
        warnings.append(f"{name} rests from {rest.start:.1f} to {rest.stop:.1f} s of {whole:.1f} s: this part is used")
    channels = []
    for quantity, (seconds, signal) in signals.items():
        inside = (seconds >= rest.start) & (seconds <= rest.stop)
        if quantity == ACCELEROMETER and not signal.any():  # none was recorded
            continue
        steps = np.diff(seconds[inside])
        lost = 1 - float(np.median(steps)) / float(np.mean(steps))
        if lost > LOST and quantity != "M":  # the cell is named once
            warnings.append(f"{name}: {100 * lost:.0f} % of the samples of {quantity} are lost: record it again")
        channels += _of_axes(quantity, signal[inside], 1 / float(np.mean(steps)), warnings)
    if not channels:
        raise RunError(f"no channel of {name} varies: a recording of sensors at rest shows their noise")
    about = provenance(inputs=[{"file": str(path), "sha256": bag.sha256}])
    return StillNoise(
        channels=tuple(channels), file=name, seconds=rest.seconds, warnings=tuple(warnings), provenance=about
    )


def _raw(wrench: WrenchChannel, imu: ImuChannel) -> tuple[np.ndarray, np.ndarray]:
    """Return the readings of load cell and IMU in their recorded units."""
    return np.hstack([wrench.force, wrench.moment]), np.hstack([imu.angular_velocity, imu.linear_acceleration])


def _rest(signals: Mapping[str, tuple[np.ndarray, np.ndarray]], name: str) -> Segment:
    """The longest rest in which every signal is steady, seconds from the recording's start.

    Raises:
        RunError: it is too short.
    """
    rests = [rest for part in _parts([seconds for seconds, _ in signals.values()]) for rest in _rests(signals, part)]
    if not rests:
        raise RunError(f"{name} does not rest for {SHORTEST:g} s: record the rig at rest, as long as a measurement")
    return max(rests, key=lambda segment: segment.seconds)


def _parts(times: Sequence[np.ndarray]) -> list[Segment]:
    """Parts, long enough, in which every channel has samples."""
    if not all(len(seconds) for seconds in times):
        return []
    gaps = [
        (float(seconds[k]), float(seconds[k + 1])) for seconds in times for k in np.flatnonzero(np.diff(seconds) > GAP)
    ]
    start, stop, parts = max(seconds[0] for seconds in times), min(seconds[-1] for seconds in times), []
    for before, after in [*sorted(gaps), (stop, stop)]:
        parts.append(Segment(start, min(before, stop)))
        start = max(start, after)
    return [part for part in parts if part.seconds >= SHORTEST]


def _rests(signals: Mapping[str, tuple[np.ndarray, np.ndarray]], part: Segment) -> list[Segment]:
    """The rests within a part, at the instants of the slowest channel; no more of them than its samples."""
    step = max(float(np.median(np.diff(seconds))) for seconds, _ in signals.values())
    step = max(step, part.seconds / max(2 * len(seconds) for seconds, _ in signals.values()))  # samples in bursts
    instant = np.arange(part.start, part.stop, step)
    at = {
        quantity: np.stack([np.interp(instant, seconds, column) for column in signal.T], axis=1)
        for quantity, (seconds, signal) in signals.items()
    }
    omega = at.pop("omega")
    # each axis over its noise: then all of them tell whether something shakes
    scaled = [signal / np.where((level := noise_level(signal)) > 0, level, 1.0) for signal in at.values()]
    segments = still(1 / step, omega, *scaled, shortest=SHORTEST - 2 * step)
    return [Segment(part.start + start, part.start + stop) for start, stop in segments]


def _of_axes(quantity: str, signal: Float[np.ndarray, "n 3"], rate: float, warnings: list[str]) -> list[ChannelNoise]:
    channels = []
    for axis, values in enumerate(signal.T):
        channel = f"{quantity}{axis + 1}"
        try:
            noise = allan_noise(values, rate)
        except ValueError as error:
            warnings.append(f"{channel}: {error}")
            continue
        time = np.arange(len(values)) / rate
        tau, deviation = allan_deviation(values - noise.drift * time, rate)
        channels.append(ChannelNoise(quantity, axis, rate, noise, tau, deviation))
        if noise.misfit > MISFIT:
            warnings.append(
                f"{channel}: its spectrum has another shape than white noise, flicker and random walk together; the "
                f"intervals are {np.sqrt(noise.misfit):.2g} times as wide for it: look at the figure"
            )
        elif noise.band[1] < 0.99 * HIGHEST * rate / 2:
            warnings.append(f"{channel}: fitted up to {noise.band[1]:.3g} Hz, above which its filter falls off")
    return channels


def _written(values: np.ndarray, unit: str) -> list[str]:
    return [f"{value:.3g} {unit}" for value in values]
