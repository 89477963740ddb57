"""Live values of a rig without a file: rates, and at rest the force, the moment and gravity that the sensors see."""

import math
import time
from collections.abc import Iterator

import numpy as np

from rig.record.device_source import DeviceSource
from rig.record.rig_file import Rig
from rig.record.session import Session, Stop

PERIOD = 1.0  # seconds that a line averages over


def watch(rig: Rig, stop: Stop, *, seconds: float | None = None) -> Iterator[str]:
    """One line per device and second: rate, mean values and their standard deviations, until ``stop``.

    Raises:
        RigError: a device is not there.
    """
    with Session(rig, stop) as session:
        yield from (f"warning: {text}" for text in session.warnings)
        start = last = time.monotonic()
        rows: dict[str, list[tuple[float, ...]]] = {source.entry.name: [] for source in session.sources}
        while not stop.wait(0.05) and (seconds is None or time.monotonic() - start < seconds):
            for source in session.sources:
                rows[source.entry.name] += [m.values for m in session.measurements(source)]
                source.look(time.monotonic_ns())
            session.raise_failures()
            if (now := time.monotonic()) - last >= PERIOD:
                yield from (describe(source, rows[source.entry.name], now - last) for source in session.sources)
                rows, last = {name: [] for name in rows}, now


def describe(source: DeviceSource, rows: list[tuple[float, ...]], seconds: float) -> str:
    """Return the device's readings of the last ``seconds``, in one line."""
    name, measures = source.entry.name, source.entry.device.measures
    if not rows:
        return f"{name}: no samples ({source.state})"
    values = np.array(rows)
    with np.errstate(all="ignore"):  # of absurd readings the line tells enough
        mean, deviation = values.mean(axis=0), values.std(axis=0)
    head = f"{name}: {len(rows) / seconds:.0f} Hz, {source.counts.missing} missing, {source.counts.failures} bad"
    if measures == "wrench":
        return f"{head}, force {_triple(mean[:3], deviation[:3])} N, moment {_triple(mean[3:6], deviation[3:6])} N*m"
    if measures == "imu":
        gravity = math.hypot(*mean[3:])
        return (
            f"{head}, angular velocity {_triple(mean[:3], deviation[:3])} rad/s, "
            f"specific force {_triple(mean[3:], deviation[3:])} m/s^2, gravity {gravity:.4f} m/s^2"
        )
    return f"{head}, values {_triple(mean, deviation)}"


def _triple(mean: np.ndarray, deviation: np.ndarray) -> str:
    return "(" + ", ".join(f"{m:.4g}±{d:.2g}" for m, d in zip(mean, deviation, strict=True)) + ")"
