"""Recorded runs: from MCAP files and an experiment file to the tensor.

What a recording states of its instruments and its day comes along, for a report that has none of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy

from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.signals.held_samples import repeats, saturated
from identify.signals.power_spectrum import occupied_band
from identify.signals.resample import UNEQUAL, interpolate, interval
from identify.signals.run import Run, RunError, refuse_excess
from rig import channels
from rig.bags.marks import Notes, read_marks
from rig.inspection.channel_health import channel_columns, dead_axes, dead_channel
from rig.runs import read_any
from uq.experiment.recording_table import RecordingTable
from uq.runs.recorded.angular_velocity import RecordedAttitude, motion
from uq.runs.recorded.declared_channels import DeclaredConventions, declared
from uq.runs.recorded.message_times import check_overlap, in_order, instants, steadily_stamped, with_accelerometer
from uq.runs.recorded.time_window import on_clock


@dataclass(frozen=True)
class Recorded:
    """A whole recorded run, before a part of it is chosen."""

    run: Run
    marks: tuple[tuple[float, str], ...]
    """Seconds from the run's start, and name."""
    assumptions: tuple[str, ...]
    """Assumptions about what neither the experiment nor the run's metadata states."""
    rig: DeclaredConventions
    """Conventions by which the channels became force, moment and motion in B."""


def load_run(path: str | Path, recording: RecordingTable | None = None) -> Run:
    """Read a recorded run: force and moment on the body at Q, angular velocity, all in B.

    Args:
        path: a file or rosbag2 folder with a wrench and what tells the motion.
        recording: what its channels mean; None for our own runs.

    Raises:
        RigError: the file cannot be read, or a topic is missing.
        RunError: its data cannot be used, or what it says of itself contradicts the declaration.
    """
    return load(path, recording or RecordingTable(), marks=False).run


def load(
    path: str | Path, recording: RecordingTable, *, gravity: float = STANDARD_GRAVITY, band: float | None = None,
    marks: bool = True,
) -> Recorded:  # fmt: skip
    """Read a whole recorded run with its marks and with what is assumed of it.

    Args:
        path: a file or rosbag2 folder with a wrench and what tells the motion.
        recording: what its channels mean.
        gravity: its local size, which turns poses into specific force [m/s²].
        band: highest frequency of the motion [Hz], where declared.
        marks: whether the run's marks are needed.

    Raises:
        RigError, RunError: see :func:`load_run`.
    """
    bag = read_any(
        path, wrench=recording.wrench_topic, motion=recording.motion_topic, accelerometer=recording.accelerometer_topic
    )
    ours = "log_time" in bag.metadata.get("rig.run", {})
    return of_channels(bag, recording, read_marks(path) if marks or ours else Notes((), ()), gravity=gravity, band=band)


def of_channels(
    bag: channels.Recording,
    recording: RecordingTable,
    extra: Notes,
    *,
    gravity: float = STANDARD_GRAVITY,
    band: float | None = None,
    start: int | None = None,
) -> Recorded:
    """Turn the channels of a run, or of a part of it, into the run in B.

    Args:
        bag: its channels and metadata.
        recording: what its channels mean.
        extra: its marks, and when a sensor said that it was out of range.
        gravity: as for :func:`load`.
        band: highest frequency of the motion [Hz], where declared.
        start: when the run began, on the clock of its samples [ns]; None: with the first of these samples.

    Raises:
        RigError, RunError: see :func:`load_run`.
    """
    read = len(bag.wrench.stamp) + len(bag.motion.stamp)
    bag = replace(bag, wrench=finite_samples(bag.wrench), motion=finite_samples(bag.motion))
    lost = read - len(bag.wrench.stamp) - len(bag.motion.stamp)
    if dead := _dead_channels(bag.wrench):
        raise RunError(f"{bag.path.name}: {dead[0]}")
    dead = _dead_channels(bag.motion) if isinstance(bag.motion, channels.ImuChannel) else []
    if recording.quaternion is not None and bag.motion.orientation is not None:
        motion_read = replace(bag.motion, orientation=bag.motion.orientation @ recording.quaternion)
        bag = replace(bag, motion=motion_read)
    bag, reordered = in_order(bag, recording.time)
    bag, steady = steadily_stamped(bag, recording)
    bag, joined = with_accelerometer(bag, recording.time)
    reordered += (*steady, *joined)
    pair = bag.wrench, bag.motion
    times, time_notes = instants(pair, recording.time)
    check_overlap(pair, times, bag.path.name)
    early = channels.stamps_early(*pair) if times[0] is bag.wrench.stamp else 0.0
    source = motion(bag, recording, times[1], gravity=gravity, band=band)
    for key, stated in (
        ("accelerometer_delay", recording.accelerometer_delay),
        ("accelerometer_at_rest", recording.accelerometer_at_rest == "zero"),
    ):
        if stated and not (source.imu is bag.motion and bag.imu.linear_acceleration.any()):
            raise RunError(
                f"recording.{key} is declared, and {bag.motion.topic} in {bag.path.name} holds no accelerometer's "
                "specific force: remove it"
            )
    if source.imu is not bag.motion:
        bag = replace(bag, motion=source.imu)
        times, _ = instants((bag.wrench, bag.imu), recording.time)
    rig, at_rest = declared(bag, recording), source.gravity
    if rig.gravity_removed:
        at_rest = recording.gravity_of_poses(gravity)
        bag, unused = _with_gravity(bag, rig, source.attitude, times[1], at_rest)
        reordered += unused
    start = min(int(times[0][0]), int(times[1][0])) if start is None else start
    seconds = [(stamp - start) * 1e-9 for stamp in times]
    attitude = None if source.attitude is None else source.attitude.of_body(rig.imu_rotation)
    if attitude is None and recording.turns_back:
        raise RunError(
            f"recording.wrench_frame is {recording.wrench_frame}, and nothing in {bag.path.name} gives the attitude "
            "that turns its wrench back: record joint states, poses or a quaternion, or the wrench in the sensor's axes"
        )
    turning = attitude.at(times[0]) if attitude is not None and recording.turns_back else None
    common = _Channels(bag, rig, seconds, extra, turning)
    common.left_out |= {"not finite": lost} if lost else {}
    _check_rates(common, band)
    run = common.run()
    return Recorded(
        run=replace(
            run,
            attitude=None if attitude is None else attitude.at(start + np.round(run.t * 1e9).astype(np.int64)),
            gravity=None if attitude is None else at_rest,
            stamps_early=early,
            zero_at_rest=recording.zero_frame == "base",
            warnings=(*run.warnings, *source.warnings, *time_notes, *dead),
            noise=None if source.noise is None else source.noise.turned(rig.imu_rotation),
            about=about(bag.metadata, bag.wrench.log_time),
        ),
        marks=tuple(on_clock(extra.marks, bag.wrench.log_time, times[0], start)),
        assumptions=(*rig.assumptions, *source.notes, *reordered),
        rig=rig,
    )


def _dead_channels(channel: channels.WrenchChannel | channels.ImuChannel) -> list[str]:
    """Return what is said of components that never change while others of their vector do."""
    return [
        f"{channel.topic}: {dead_channel(name, int(axis), values)}"
        for name, values in channel_columns(channel).items() for axis in dead_axes(values)
    ]  # fmt: skip


LEAST_GRAVITY = 5.0
"""Mean specific force along axes at rest from which there is gravity in it [m/s²]."""
LEAST_SECONDS = 2.0
"""Seconds over which it is averaged: a shorter motion may be as fast."""


def _with_gravity(
    bag: channels.Recording, rig: DeclaredConventions, attitude: RecordedAttitude | None, instants: np.ndarray,
    gravity: np.ndarray,
) -> tuple[channels.Recording, tuple[str, ...]]:  # fmt: skip
    """Put back the gravity that was taken out of the accelerometer's readings, by the attitude of its sensor.

    Without an attitude the readings become zero, which is no accelerometer, and an assumption says so.

    Raises:
        RunError: gravity is in them.
    """
    imu, scale, name = bag.imu, rig.scales["acceleration"], bag.path.name
    if attitude is None:
        unused = (
            f"the acceleration of {imu.topic} in {name} holds no gravity, and nothing tells the attitude that puts it "
            "back: it is not used, and the mass is not determined; record the quaternion, too, or the accelerometer as "
            "it reads"
        )
        return replace(bag, motion=replace(imu, linear_acceleration=np.zeros_like(imu.linear_acceleration))), (unused,)
    to_rest = attitude.at(instants)
    mean = scale * np.einsum("nij,nj->ni", to_rest, imu.linear_acceleration).mean(axis=0)
    if np.linalg.norm(mean) > LEAST_GRAVITY and instants[-1] - instants[0] > LEAST_SECONDS * 1e9:
        raise RunError(
            f"accelerometer_at_rest is zero, and the acceleration of {imu.topic} in {name} holds gravity "
            f"({np.linalg.norm(mean):.3g} m/s^2 on average, along axes at rest): remove accelerometer_at_rest"
        )
    specific = imu.linear_acceleration - np.einsum("nji,j->ni", to_rest, gravity) / scale
    return replace(bag, motion=replace(imu, linear_acceleration=specific)), ()


NOT_MEASURED = ("linear_acceleration", "orientation", "angular_velocity", "position")
"""Signals of a motion sensor that drivers fill with NaN where it does not measure them."""


AnyChannel = TypeVar("AnyChannel", bound=channels.RecordedChannel)


def finite_samples(channel: AnyChannel) -> AnyChannel:
    """Return a channel without the samples that are no numbers; what is none in most of them is not measured: zero.

    Joints, which may be missing in a message, are judged by those that are used.

    Raises:
        RunError: hardly a sample is finite.
    """
    keep, joints = np.ones(len(channel.stamp), bool), bool(getattr(channel, "names", ()))
    for name in ("force", "moment", *NOT_MEASURED):
        values = None if name == "position" and joints else getattr(channel, name, None)
        finite = True if values is None or np.isfinite(values).all() else np.isfinite(values).all(axis=1)
        if values is not None and name in NOT_MEASURED and np.mean(finite) < 0.5:
            channel = replace(channel, **{name: np.zeros_like(values)})
        else:
            keep &= finite
    if len(keep) and not keep.any():
        raise RunError(f"no sample of {channel.topic} holds numbers alone: check sensor and driver")
    return channel if keep.all() else channel.taken(keep)


class _Channels:
    """Load cell and motion sensor in the body frame, without the samples that they did not really take."""

    def __init__(
        self,
        bag: channels.Recording,
        rig: DeclaredConventions,
        seconds: list[np.ndarray],
        extra: Notes,
        turning: np.ndarray | None,
    ) -> None:
        self.bag, self.rig, self.left_out = bag, rig, dict[str, int]()
        wrench, imu = bag.wrench, bag.imu
        of_wrench, of_motion = (wrench.force, wrench.moment), (imu.angular_velocity, imu.linear_acceleration)
        for signal, parts in (("wrench", of_wrench), ("motion", of_motion)):
            for values in parts:
                refuse_excess(signal, values, bag.path.name)
        constant = [all((column == column[0]).all() for column in values.T) for values in of_wrench]
        if constant[1] or (constant[0] and wrench.force.any()):  # a force of zero throughout is not measured
            what = "force and moment" if all(constant) else "the moment" if constant[1] else "the force"
            verb = "change" if all(constant) else "changes"
            raise RunError(f"{what} in {bag.path.name} never {verb}: check load cell and driver")
        flagged = [self._flagged(channel.topic, channel.log_time, extra) for channel in (wrench, imu)]
        usable, self.bad = zip(
            *(self._sift(*channel) for channel in zip((of_wrench, of_motion), seconds, flagged, strict=True)),
            strict=True,
        )
        usable = [slice(None) if keep.all() else keep for keep in usable]  # nothing is copied
        self.t_wrench, self.t_imu = (t[keep] for t, keep in zip(seconds, usable, strict=True))
        turning = None if turning is None else turning[usable[0]]
        self.force, self.moment = rig.wrench(unfiltered(wrench.taken(usable[0]), self.t_wrench, rig), turning)
        self.omega, self.specific_force = rig.motion(imu.taken(usable[1]))
        if rig.accelerometer_delay and len(self.t_imu) > 1 and (np.diff(self.t_imu) > 0).all():
            self._advance(rig.accelerometer_delay)

    def _advance(self, delay: float) -> None:
        """Take the specific force so much later [s] than the angular velocity, where both are known."""
        later = self.t_imu + delay
        in_both = (later >= self.t_imu[0]) & (later <= self.t_imu[-1])
        self.specific_force = interpolate(self.t_imu, self.specific_force, later[in_both])
        self.t_imu, self.omega = self.t_imu[in_both], self.omega[in_both]

    def _sift(self, parts: tuple[np.ndarray, ...], t: np.ndarray, flagged: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the mask of the samples of a sensor to keep, and the instants near which nothing must be used."""
        # the components lie together: what looks for samples looks at one after the other
        values = np.concatenate([part.T for part in parts]).T
        slower, frozen = repeats(values)
        clipped = saturated(values)
        for reason, flags in (("held", slower | frozen), ("saturated", clipped), ("overrange", flagged)):
            if flags.any():
                self.left_out[reason] = self.left_out.get(reason, 0) + int(flags.sum())
        return ~slower, t[frozen | clipped | flagged]

    def _flagged(self, topic: str, log_time: np.ndarray, extra: Notes) -> np.ndarray:
        """Samples of the seconds in which the device said that it was out of range."""
        about = self.bag.metadata.get("rig.run", {})
        flags = np.zeros(len(log_time), bool)
        for status in extra.flagged:
            if about.get(f"{status.device}.topic") == topic:
                flags |= (log_time > status.after) & (log_time <= status.until)
        return flags

    def run(self) -> Run:
        """The two at common instants."""
        accelerates = bool(self.specific_force.any())
        run = Run.from_channels(
            self.t_wrench,
            self.force,
            self.moment,
            self.t_imu,
            self.omega,
            name=self.bag.path.name,
            sha256=self.bag.sha256,
            specific_force=self.specific_force if accelerates else None,
            bad=self.bad,
        )
        return replace(
            run,
            left_out=self.left_out | dict(run.left_out),
            imu_position=self.rig.imu_position,
            mounting=self.bag.metadata.get("rig.run", {}).get("mounting") or None,
        )


def unfiltered(channel: channels.WrenchChannel, t: np.ndarray, rig: DeclaredConventions) -> channels.WrenchChannel:
    """Return a wrench before the low-pass of first order through which it went, by its slope.

    Args:
        channel: of the load cell.
        t: its instants [s]; where they do not increase, the run says so later.
        rig: what is declared of the filter.
    """
    if not rig.wrench_time_constant or len(t) < 4 or not (np.diff(t) > 0).all():
        return channel
    values = np.hstack([channel.force, channel.moment])
    before = values + rig.wrench_time_constant * scipy.interpolate.make_interp_spline(t, values).derivative()(t)
    return replace(channel, force=before[:, :3], moment=before[:, 3:])


def _check_rates(channels: _Channels, band: float | None) -> None:
    """Refuse a motion that the slower sensor cannot follow."""
    topics = (channels.bag.wrench.topic, channels.bag.imu.topic)
    if min(len(channels.t_wrench), len(channels.t_imu)) < 10:
        return
    intervals = [interval(t) for t in (channels.t_wrench, channels.t_imu)]
    if min(intervals) <= 0:  # the run says where its time stands still or runs backwards
        return
    rates = [1 / step for step in intervals]
    slow, fast = int(np.argmin(rates)), int(np.argmax(rates))
    if not rates[fast] > UNEQUAL * rates[slow] or not all(
        np.isfinite(part).all() for part in (channels.force, channels.moment)
    ):
        return
    signal = channels.moment if fast == 0 else channels.omega
    reached = max(band or 0.0, occupied_band(signal, rates[fast]))
    if reached > rates[slow] / 2:
        raise RunError(
            f"the motion in {channels.bag.path.name} reaches {reached:.3g} Hz, beyond the Nyquist frequency "
            f"{rates[slow] / 2:.3g} Hz of {topics[slow]}: record {topics[slow]} at a higher rate"
        )


FACTS = ("model", "serial_number", "firmware")
EARLIEST = 946_684_800_000_000_000
"""Start of the year 2000 [ns]: before it, a stamp counts from the run's start and tells no day."""


def about(metadata: Mapping[str, Mapping[str, str]], log_time: np.ndarray) -> dict[str, Any]:
    """Return day, note, instruments and whether it is a simulation, as far as a recording tells.

    Args:
        metadata: the recording's metadata records; ``rig.run`` is read.
        log_time: arrival of its messages at the host [ns since 1970].

    Returns:
        Keys ``date`` (ISO, UTC), ``note``, ``instruments`` (a mapping of ``FACTS`` and ``name`` each), ``made_up``
        (``"simulated"`` or ``"emulated"``), ``imported`` (from a table); what is not known is not there.
    """
    record = metadata.get("rig.run", {})
    facts: dict[str, Any] = {"instruments": _instruments(record)}
    if len(log_time) and log_time[0] >= EARLIEST:
        facts["date"] = datetime.fromtimestamp(int(log_time[0]) // 10**9, UTC).date().isoformat()
    if record.get("note"):
        facts["note"] = record["note"]
    if "imported" in record:
        facts["imported"] = True
    if "simulated" in record:
        facts["made_up"] = "simulated"
    elif any(value.startswith("emulator:") for key, value in record.items() if key.endswith(".port")):
        facts["made_up"] = "emulated"
    return {key: value for key, value in facts.items() if value}


def _instruments(record: Mapping[str, str]) -> list[dict[str, str]]:
    """Each device that the recording names, with what is known of it."""
    names = [key.removesuffix(".model") for key in record if key.endswith(".model") and key.count(".") == 1]
    return [{"name": name} | {fact: text for fact in FACTS if (text := record.get(f"{name}.{fact}"))} for name in names]
