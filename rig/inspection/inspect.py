"""What is wrong with a recorded run: rates, gaps, held samples, clocks, saturation, units and axes.

The report of a whole file; the checks are in ``rig.inspection.suspicions``. A clean run gives no finding.
"""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field

import numpy as np

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from rig.inspection.detective import detect
from rig.inspection.suspicions import Finding, findings, skew
from rig.mcap.message_definitions import IMU, WRENCH


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
    findings: list[Finding] = field(default_factory=list)

    def to_dict(self) -> dict[str, object]:
        """As JSON shows it."""
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
        return "\n".join(lines)


Judge = Callable[[str], list[Finding]]


def inspect(path: str | os.PathLike[str], *, judge: Judge | None = None) -> Inspection:
    """Look at every wrench and IMU topic of a run, each by itself, and at what one pair of them says together.

    Args:
        path: the run.
        judge: who looks at units, signs and frames instead, knowing what was declared.

    Raises:
        RigError: the file is no MCAP, cut or damaged.
        OSError: it cannot be opened.
    """
    contents = runs.load(path)
    report = Inspection(os.fspath(path))
    channels: list[WrenchChannel | ImuChannel] = []
    for topic, pieces in sorted(contents.topics.items()):
        channel = contents.wrench(topic) if pieces.type_name == WRENCH else contents.imu(topic)
        channels.append(channel)
        report.channels.append(_describe(channel, pieces.type_name))
        if len(channel.stamp) >= 10:
            report.findings += findings(channel)
        else:
            report.findings.append(Finding("short", topic, f"only {len(channel.stamp)} samples: record longer"))
    sound = all(finding.kind == "unit" for finding in report.findings)
    if judge is None and sound:
        report.findings += _together(channels)
    elif judge is not None:
        report.findings = [f for f in report.findings if f.kind not in ("unit", "axes")] + judge(os.fspath(path))
    report.findings += _end(contents.metadata)
    _add_missing(contents, report)
    return report


def _together(channels: list[WrenchChannel | ImuChannel]) -> list[Finding]:
    """What wrench and motion say of each other, where there is one of each and neither is faulty by itself."""
    wrenches = [channel for channel in channels if isinstance(channel, WrenchChannel)]
    imus = [channel for channel in channels if isinstance(channel, ImuChannel)]
    return detect(wrenches[0], imus[0]) if len(wrenches) == len(imus) == 1 else []


def _add_missing(contents: runs.Contents, report: Inspection) -> None:
    types = {c.type for c in report.channels}
    for name in {WRENCH, IMU} - types:
        report.findings.append(
            Finding("missing", report.file, f"no messages of type {name}: a run needs one topic of it")
        )


def _end(metadata: dict[str, dict[str, str]]) -> Iterator[Finding]:
    """What the recorder itself noticed."""
    if "rig.run" in metadata and "log_time" in metadata["rig.run"] and "rig.end" not in metadata:
        yield Finding("unfinished", "rig.end", "the recording was not ended properly: its last moments may be missing")
    if metadata.get("rig.end", {}).get("complete") == json.dumps(False):
        yield Finding("incomplete", "rig.end", "the recorder missed data: see the metadata rig.end for what and where")


def _describe(channel: WrenchChannel | ImuChannel, type_name: str) -> ChannelReport:
    stamp = channel.stamp
    steps = np.diff(stamp)
    seconds = float(stamp[-1] - stamp[0]) * 1e-9 if len(stamp) else 0.0
    period = float(np.median(steps)) * 1e-9 if len(steps) else 0.0
    return ChannelReport(
        topic=channel.topic,
        type=type_name,
        samples=len(stamp),
        seconds=seconds,
        rate_hz=1 / period if period > 0 else 0.0,
        arrival_jitter_s=float(np.std(channel.log_time - stamp)) * 1e-9 if len(stamp) else 0.0,
        clock_skew_ppm=skew(channel) * 1e6,
    )
