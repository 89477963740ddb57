"""Recorded runs: from MCAP files and an experiment file to the tensor."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identify.consistency import Verdict, consistency
from identify.estimator import EstimatorSpec
from identify.filters import occupied_band
from identify.identification import identify
from identify.identification_result import Identification, Method
from identify.offsets import OffsetChoice, rest_of
from identify.resample import UNEQUAL, interval
from identify.run import Run, RunError
from identify.samples import repeats, saturated
from identify.stretches import Stretch, still
from rig import notes
from rig.bag import read_any
from rig.channels import Recording as BagRecording
from uq.centre_prior import known_by, load_centre, told
from uq.certificate import cautions
from uq.clocks import instants
from uq.compensation import undo
from uq.declared import Rig, declared
from uq.devices import about
from uq.experiment import Experiment
from uq.measured_noise import noise_warnings
from uq.motion import motion, upward
from uq.mountings import check_count, labelled
from uq.parts import Part, cut, on_clock
from uq.provenance import provenance
from uq.recording import Recording
from uq.repeatability import ScatterVerdict, of_runs
from uq.suspected import warned
from uq.systematic import with_declared_sources


@dataclass(frozen=True)
class Recorded:
    """A whole recorded run, before a part of it is chosen."""

    run: Run
    marks: tuple[tuple[float, str], ...]
    """Seconds from the run's start, and name."""
    assumptions: tuple[str, ...]
    """What neither the experiment nor the run's metadata says."""
    rig: Rig
    """How its channels became force, moment and motion in B."""
    attitude: tuple[np.ndarray, np.ndarray] | None = None
    """Instants [s] and upward direction in the sensor's frame (n, 3), where poses were recorded."""


def load_run(path: str | Path, recording: Recording | None = None) -> Run:
    """Read a recorded run: force and moment on the body at Q, angular velocity, all in B.

    Args:
        path: a file or rosbag2 folder with a wrench and what tells the motion.
        recording: what its channels mean; None for our own runs.

    Raises:
        RigError: the file cannot be read, or a topic is missing.
        RunError: its data cannot be used, or what it says of itself contradicts the declaration.
    """
    return load(path, recording or Recording(), marks=False).run


def load(path: str | Path, recording: Recording, *, band: float | None = None, marks: bool = True) -> Recorded:
    """Read a whole recorded run with its marks and with what is assumed of it.

    Args:
        path: a file or rosbag2 folder with a wrench and what tells the motion.
        recording: what its channels mean.
        band: highest frequency of the motion [Hz], where declared.
        marks: whether the run's marks are needed.

    Raises:
        RigError, RunError: see :func:`load_run`.
    """
    bag = read_any(path, wrench=recording.wrench_topic, motion=recording.motion_topic)
    times, said = instants((bag.wrench, bag.motion), recording.time)
    told = motion(bag, recording, times[1], band=band)
    posed = (times[1], upward(bag.motion))
    if told.imu is not bag.motion:
        bag = replace(bag, motion=told.imu)
        times, _ = instants((bag.wrench, bag.imu), recording.time)
    rig = declared(bag, recording)
    start = min(int(times[0][0]), int(times[1][0]))
    seconds = [(stamp - start) * 1e-9 for stamp in times]
    ours = "log_time" in bag.metadata.get("rig.run", {})
    extra = notes.read(path) if marks or ours else notes.Notes((), ())
    channels = _Channels(bag, rig, seconds, extra)
    _check_rates(channels, band)
    run = channels.run()
    return Recorded(
        replace(
            run,
            warnings=(*run.warnings, *told.warnings, *said),
            noise=None if told.noise is None else told.noise.turned(rig.imu_rotation),
            about=about(bag.metadata, bag.wrench.log_time),
        ),
        tuple(on_clock(extra.marks, bag.wrench.log_time, times[0], start)),
        (*rig.assumptions, *told.notes),
        rig,
        None if posed[1] is None else ((posed[0] - start) * 1e-9, posed[1]),
    )


class _Channels:
    """Load cell and motion sensor in the body frame, without the samples that they did not really take."""

    def __init__(self, bag: BagRecording, rig: Rig, seconds: list[np.ndarray], extra: notes.Notes) -> None:
        self.bag, self.rig, self.left_out = bag, rig, dict[str, int]()
        wrench, imu = bag.wrench, bag.imu
        self.wrench = np.hstack(rig.wrench(wrench))
        self.motion = np.hstack(rig.motion(imu))
        raw = (np.hstack([wrench.force, wrench.moment]), np.hstack([imu.angular_velocity, imu.linear_acceleration]))
        flagged = [self._flagged(channel.topic, channel.log_time, extra) for channel in (wrench, imu)]
        kept, self.bad = zip(*(self._sift(*one) for one in zip(raw, seconds, flagged, strict=True)), strict=True)
        self.t_wrench, self.t_imu = (t[keep] for t, keep in zip(seconds, kept, strict=True))
        self.wrench, self.motion = self.wrench[kept[0]], self.motion[kept[1]]

    def _sift(self, values: np.ndarray, t: np.ndarray, flagged: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which samples of a sensor to keep, and when those were taken near which nothing must be used."""
        slower, frozen = repeats(values)
        clipped = saturated(values)
        for reason, found in (("held", slower | frozen), ("saturated", clipped), ("overrange", flagged)):
            if found.any():
                self.left_out[reason] = self.left_out.get(reason, 0) + int(found.sum())
        return ~slower, t[frozen | clipped | flagged]

    def _flagged(self, topic: str, log_time: np.ndarray, extra: notes.Notes) -> np.ndarray:
        """Samples of the seconds in which the device said that it was out of range."""
        about = self.bag.metadata.get("rig.run", {})
        found = np.zeros(len(log_time), bool)
        for one in extra.flagged:
            if about.get(f"{one.device}.topic") == topic:
                found |= (log_time > one.after) & (log_time <= one.until)
        return found

    def run(self) -> Run:
        """The two at common instants."""
        accelerates = bool(self.motion[:, 3:].any() and np.isfinite(self.motion[:, 3:]).all())
        run = Run.from_channels(
            self.t_wrench,
            self.wrench[:, :3],
            self.wrench[:, 3:],
            self.t_imu,
            self.motion[:, :3],
            name=self.bag.path.name,
            sha256=self.bag.sha256,
            specific_force=self.motion[:, 3:] if accelerates else None,
            bad=self.bad,
        )
        return replace(
            run,
            left_out=self.left_out | dict(run.left_out),
            imu_position=self.rig.imu_position,
            mounting=self.bag.metadata.get("rig.run", {}).get("mounting") or None,
        )


def _check_rates(channels: _Channels, band: float | None) -> None:
    """Refuse a motion that the slower sensor cannot follow."""
    topics = (channels.bag.wrench.topic, channels.bag.imu.topic)
    if min(len(channels.t_wrench), len(channels.t_imu)) < 10:
        return
    rates = [1 / interval(t) for t in (channels.t_wrench, channels.t_imu)]
    slow, fast = int(np.argmin(rates)), int(np.argmax(rates))
    if not rates[fast] > UNEQUAL * rates[slow] or not np.isfinite(channels.wrench).all():
        return
    signal = channels.wrench[:, 3:] if fast == 0 else channels.motion[:, :3]
    reached = max(band or 0.0, occupied_band(signal, rates[fast]))
    if reached > rates[slow] / 2:
        raise RunError(
            f"the motion in {channels.bag.path.name} reaches {reached:.3g} Hz, beyond the Nyquist frequency "
            f"{rates[slow] / 2:.3g} Hz of {topics[slow]}: record {topics[slow]} at a higher rate"
        )


def identify_files(
    paths: Sequence[str | Path],
    experiment: Experiment,
    *,
    estimator: str | None = None,
    offsets: OffsetChoice | None = None,
    parts: Sequence[Part] | None = None,
    mountings: Sequence[str] | None = None,
    centre: str | Path | None = None,
    method: Method | None = None,
) -> Identification:
    """Identify the tensor from recorded runs of one body.

    Args:
        paths: files or rosbag2 folders, one a run.
        experiment: r_CG with its uncertainty, estimators, what the channels mean.
        estimator: name of the estimator; None for the recording's, or the first.
        offsets: where constant offsets come from; None: as the experiment says.
        parts: the parts of each run that count; None: where it moves.
        mountings: name of the mounting that each run was made with; None: as the runs' metadata say.
        centre: the centre.json of static poses, whose mass and centre of gravity count; None: the experiment's.
        method: the estimator of :func:`identify.identify`; None: the recording's.

    Raises:
        ExperimentError, RigError, RunError: see :func:`load_run`, :func:`uq.parts.resolve`,
            :func:`uq.compensation.undo`, :func:`uq.mountings.labelled`, :func:`identify.identify` and
            :func:`uq.systematic.with_declared_sources`.
    """
    if len({Path(path).resolve() for path in paths}) < len(paths):
        raise RunError("a run is given twice: name each file once")
    check_count(mountings, len(paths))
    if offsets is not None:
        experiment = replace(experiment, recording=replace(experiment.recording, offsets=offsets))
    declared_inputs, differing, prior = experiment.inputs(), tuple[str, ...](), None
    if centre is not None:
        prior = load_centre(centre)
        experiment, differing = known_by(experiment, prior)
        declared_inputs |= {"centre": told(centre, prior)}
    elif experiment.scale is not None:
        experiment = replace(experiment, mass=experiment.scale[0])
    spec = experiment.estimator(estimator)
    prepared = [_prepared(path, experiment, spec, parts) for path in paths]
    runs = labelled([run for run, _ in prepared], mountings)
    result = identify(
        runs,
        r_cg=experiment.stated_r_cg,
        sigma_r_cg=experiment.sigma_r_cg,
        estimator=spec,
        offsets=experiment.recording.offsets,
        mass=experiment.mass,
        centre=prior,
        method=method or experiment.recording.method,
        alignment=experiment.recording.alignment,
        cg_motion=experiment.recording.cg_motion,
        gravity=experiment.gravity,
        mass_uncertainty=None if experiment.scale is None else experiment.scale[1],
    )
    if prior is None and experiment.scale is not None and result.method != "joint":
        result = replace(result, mass_uncertainty=experiment.scale[1])
    result = with_declared_sources(result, runs, experiment, anew=experiment.recording.drawn_by_mounting)
    followed = [one for run in runs for one in _followed(run, result)]
    repeats = of_runs(result.pooling) if result.pooling else None
    suspicious = [text for run in runs for text in warned(run, experiment)]
    noisy = [text for run in runs for text in noise_warnings(run, experiment.sources)]
    assumed = dict.fromkeys(text for _, texts in prepared for text in texts)
    inputs = [{"file": str(path), "sha256": run.sha256, **run.about} for path, run in zip(paths, runs, strict=True)]
    said = cautions(experiment.report, inputs)
    return replace(
        result,
        warnings=(*differing, *result.warnings, *suspicious, *noisy, *(verdict.text for verdict in followed), *said),
        consistency=(*followed, *([] if repeats is None or repeats.describes else [_repeatability(repeats)])),
        assumptions=(*assumed, *result.assumptions),
        provenance=provenance(**declared_inputs, inputs=inputs),
        datum=experiment.datum,
    )


def _followed(run: Run, result: Identification) -> tuple[Verdict, ...]:
    """What the run's residuals follow; not of a method that turns and delays the signals before it fits them."""
    if result.method == "joint" or result.seen is not None:
        return ()
    return consistency(run, result.estimator, result.r_cg, result.inertia, offsets=result.offsets)


def _repeatability(repeats: ScatterVerdict) -> Verdict:
    worst = int(np.argmin(repeats.probability))
    return Verdict("repeatability", repeats.names[worst], float(repeats.ratio[worst]), repeats.text)


def _prepared(
    path: str | Path, experiment: Experiment, spec: EstimatorSpec, parts: Sequence[Part] | None
) -> tuple[Run, tuple[str, ...]]:
    """The part of a run that counts, its weight put back, its rest known; and what is assumed."""
    recording = experiment.recording
    named = any(isinstance(one, str) for part in parts or () for one in part)
    recorded = load(path, recording, band=spec.band, marks=named)
    kept = cut(recorded.run, parts, recorded.marks)
    assumed = (*recorded.assumptions, *_of_weight(recording))
    if kept.specific_force is not None and experiment.mass is not None and kept.imu_position is None:
        assumed = (*assumed, "the accelerometer is at Q")
    weighed = recording.compensated in ("gravity", "gravity_from_force")
    if not weighed and recording.offsets == "estimate":
        return kept, assumed
    rests = _near(recorded.run, kept)
    begin = min([float(kept.t[0]), *(rest.start for rest in rests)])
    end = max([float(kept.t[-1]), *(rest.stop for rest in rests)])
    run = recorded.run.between(begin, end)
    rests = tuple(Stretch(one.start - begin, one.stop - begin) for one in rests)
    run, more = undo(run, rests, experiment)
    if recording.offsets == "still":
        run = replace(run, rest=rest_of(run, rests))
    part = run.within(kept.parts) if kept.parts else run
    return replace(part, parts=kept.parts, found=kept.found, left_out=kept.left_out, overview=kept.overview), (
        *assumed,
        *more,
    )


def _of_weight(recording: Recording) -> tuple[str, ...]:
    return () if recording.compensated else ("no driver removed the body's weight from the wrench",)


def _near(run: Run, kept: Run) -> tuple[Stretch, ...]:
    """The stretches of rest within the part of a run that counts, the last before and the first after it [s]."""
    shift = float(run.t[0])
    found = still(run.rate, run.omega, run.force, run.moment)
    rests = [Stretch(one.start + shift, one.stop + shift) for one in found]
    start, stop = float(kept.t[0]), float(kept.t[-1])
    before = [rest for rest in rests if rest.stop < start][-1:]
    after = [rest for rest in rests if rest.start > stop][:1]
    return (*before, *(rest for rest in rests if rest.stop >= start and rest.start <= stop), *after)
