"""Inspection of a run and of the health of its channels: rates, gaps, held samples, clocks, saturation.

The report of a whole file; the checks are in ``rig.inspection.channel_health``. A clean run gives no finding.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from rig.bags.topics import NEEDS_WRIST, load
from rig.channels import ImuChannel, counted_together, halves
from rig.exceptions import on_one_line
from rig.inspection.channel_health import SensorChannel, TopicFinding, channel_findings, clock_skew
from rig.mcap.message_definitions import IMU, MOTIONS, WRENCH, WRENCHES
from rig.record import device_clock
from rig.runs import message_type


@dataclass
class ChannelReport:
    """One channel: number of samples, duration [s], median rate [Hz], jitter of arrivals [s], skew of its clock."""

    topic: str
    type: str
    samples: int
    seconds: float
    rate_hz: float
    arrival_jitter_s: float
    clock_skew_ppm: float


@dataclass
class Inspection:
    """All channels of a run and what is suspicious about them."""

    file: str
    channels: list[ChannelReport] = field(default_factory=list)
    findings: list[TopicFinding] = field(default_factory=list)
    imported: bool = False
    """Whether the run was imported from a table, by a map."""
    gravity_removed: bool = False
    """Whether the recording says that gravity was taken out of its acceleration."""

    def to_dict(self) -> dict[str, object]:
        """Return the inspection as plain values for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """Lines for a terminal."""
        lines = [self.file]
        lines += [
            f"  {c.topic} ({c.type}): {c.samples} samples in {c.seconds:.3f} s, {c.rate_hz:.6g} Hz, "
            f"arrival jitter {c.arrival_jitter_s * 1e6:.0f} us, clock skew {c.clock_skew_ppm:+.1f} ppm"
            for c in self.channels
        ]
        lines += [f"  suspicious {finding}" for finding in self.findings] or ["  nothing suspicious"]
        return "\n".join(map(on_one_line, lines))


Judge = Callable[[Sequence[SensorChannel], list[TopicFinding]], list[TopicFinding]]
"""Function from all channels and the findings on their health to all findings, for a caller who knows what channels
mean."""


def inspect(path: str | os.PathLike[str], *, judge: Judge = lambda channels, findings: findings) -> Inspection:
    """Look at the health of every wrench and IMU topic of a run, each by itself.

    Args:
        path: the run.
        judge: who looks further, at units, signs and axes; ``inertia inspect`` passes one.

    Raises:
        RigError: the file is no recording, cut or damaged.
        OSError: it cannot be opened.
    """
    contents = load(path)
    report, channels, findings = Inspection(os.fspath(path)), list[SensorChannel](), list[TopicFinding]()
    about = contents.metadata.get("rig.run", {})
    report.imported, report.gravity_removed = "imported" in about, about.get("accelerometer_at_rest") == "zero"
    for topic, messages in sorted(contents.topics.items()):
        channel = contents.wrench(topic) if messages.type_name == WRENCH else contents.imu(topic)
        channels.append(channel.in_order())
    if counted_together(channels):
        channels = [replace(channel, sequence=None) for channel in channels]
    for channel in channels:
        skew = clock_skew(channel)
        report.channels.append(_describe(channel, skew))
        findings += channel_findings(channel, skew)
    if apart := halves([channel for channel in channels if isinstance(channel, ImuChannel)]):
        no_gyro = apart[1].topic  # of the accelerometer alone no gyro is missed
        findings = [
            one for one in findings if (one.kind, one.topic) != ("constant", no_gyro) or "angular" not in one.text
        ]
    report.findings = [*judge(channels, findings), *_end(contents.metadata)]
    held = {kind for topic, kind in contents.types.items() if topic not in contents.named_values()}
    held = held - {WRENCH, IMU} | {channel.type for channel in report.channels}
    if contents.rest:
        text = f"{contents.rest} bytes after its end, which are not read: copy the file again"
        report.findings.append(TopicFinding("rest", report.file, text))
    report.findings += [
        TopicFinding("missing", report.file, f"no messages of type {kinds[0]}: {cure}")
        for kinds, cure in ((WRENCHES, NEEDS_WRIST), (MOTIONS, "a run needs one topic of it"))
        if not held & set(kinds)
    ]
    return report


def _end(metadata: dict[str, dict[str, str]]) -> Iterator[TopicFinding]:
    """Return the recorder's own findings."""
    if "rig.run" in metadata and "log_time" in metadata["rig.run"] and "rig.end" not in metadata:
        text = "the recording was not ended properly: its last moments may be missing"
        yield TopicFinding("unfinished", "rig.end", text)
    if metadata.get("rig.end", {}).get("complete") == json.dumps(False):
        text = "the recorder missed data: see the metadata rig.end for what and where"
        yield TopicFinding("incomplete", "rig.end", text)


def _describe(channel: SensorChannel, skew: float) -> ChannelReport:
    stamp = channel.stamp
    period = device_clock.steady_period(stamp) * 1e-9 if len(stamp) > 1 else 0.0
    return ChannelReport(
        topic=channel.topic,
        type=message_type(channel),
        samples=len(stamp),
        seconds=float(stamp[-1] - stamp[0]) * 1e-9 if len(stamp) else 0.0,
        rate_hz=1 / period if period > 0 else 0.0,
        arrival_jitter_s=float(np.std(channel.log_time - stamp)) * 1e-9 if len(stamp) else 0.0,
        clock_skew_ppm=skew * 1e6,
    )
