"""Static poses to mass, centre of gravity and offsets: the function behind ``inertia centre``.

Findings name other ways to read a table's attitudes than that declared, with the keys that declare each.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from identify.display.rounding import fixed, significant
from identify.estimation.static_poses.accelerometer import Accelerometer
from identify.estimation.static_poses.attitude_turn import attitude_turn
from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.centre_result import Centre
from identify.estimation.static_poses.creep import creeping
from identify.estimation.static_poses.pose_fit import PoseSignals
from identify.estimation.static_poses.sampled_rows import sampled, turning
from identify.judge.conventions.convention_fit import DeclaredRig
from identify.judge.conventions.findings.gravity import gravity_entry
from identify.judge.conventions.findings.sign import DOWNWARDS, SignReading
from identify.judge.conventions.pose_findings import PoseReading, axis_findings, pose_findings, unit_findings
from identify.judge.cure import Cure, Entries, written
from identify.judge.findings import Finding
from identify.signals.run import Run, RunError, refuse_excess
from identify.signals.segments import still
from uq.experiment.experiment import Experiment
from uq.experiment.pose_table import (
    CONVENTIONS,
    ROTATIONS,
    Poses,
    need_table,
    of_accelerometer,
    rotations,
    uncertain,
    upward,
)
from uq.experiment.recording_table import RecordingTable
from uq.files.csv_columns import read_columns
from uq.files.provenance import provenance
from uq.files.units import scale
from uq.runs.identification.centre_errors import ATTITUDE_AXIS, calibrated_error, weight_errors
from uq.runs.identification.undeclared import centre_with_undeclared
from uq.runs.inspection.experiment_findings import declared_rig
from uq.runs.recorded.declared_channels import DeclaredConventions, declared
from uq.runs.recorded.joint_kinematics import Chain
from uq.runs.recorded.load_run import Recorded, load
from uq.runs.recorded.time_window import TimeWindow, names_marks, resolve
from uq.runs.tables.table_samples import as_recording, silenced

TABLES = (".csv", ".tsv", ".txt")

SLOW = 1.0
"""Highest frequency of interest where poses are turned to angular velocity [Hz]: only rest is looked for."""


ALIGNED = "the axes of the attitude are the load cell's"
"""Assumption where no uncertainty of the attitude sensor's axes is declared."""


class _Lean(NamedTuple):
    """Specific force of each pose, which tells the body's attitude, and what measured it."""

    specific_force: np.ndarray
    """Specific force in B, (n, 3) [m/s²]."""
    accelerometer: Accelerometer | None = None
    """Offset and gain of the accelerometer that tells it; None: something else does."""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Wrenches:
    """Mean wrench on the body at Q and specific force of each pose, in B, and where both come from."""

    force: np.ndarray
    moment: np.ndarray
    lean: _Lean
    rig: DeclaredConventions
    sha256: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    used: np.ndarray
    """Poses that count, (n,)."""
    labels: tuple[str, ...]
    """Names of the poses in messages: ``pose 7``, and when it was held."""
    measured: bool
    """Whether an accelerometer tells the attitudes."""
    progress: np.ndarray | None = None
    """Times at which the poses were held, in any unit, (n,); None: one after another."""
    findings: Sequence[Finding] = ()
    """Contradictions of the declared attitudes by the forces, each with its cure."""


def centre_file(
    path: str | Path, experiment: Experiment, *, windows: Sequence[TimeWindow] = (), without: Sequence[int] = ()
) -> Centre:
    """Estimate mass, centre of gravity and the load cell's offsets from static poses.

    Args:
        path: a table (.csv, .tsv, .txt), whose columns ``[poses]`` names, with one row per pose, or a row per sample at
            ``poses.rate``; or a recorded run with an accelerometer or with the platform's pose. Of samples each still
            segment is a pose.
        experiment: what columns or channels mean (``[recording]``, ``[poses]``) and local gravity (``[platform]``).
        windows: the parts of the samples that count; none: all of them.
        without: numbers of poses to leave out, from 1, as messages have them.

    Raises:
        ExperimentError: nothing declares the columns, or the wrench lacks the weight.
        RunError: the data cannot be used, its rows are samples of a motion, or its poses do not determine the centre of
            gravity.
        RigError, OSError: the file cannot be read.
    """
    name = Path(path).name
    if experiment.recording.removes_weight:
        raise RunError(
            f"recording.compensated is {experiment.recording.compensated}, and mass and centre follow from the "
            f"weight, which {name} lacks: record without compensation"
        )
    if experiment.recording.zero_frame == "base":
        raise RunError(
            f"recording.zero_frame is base, and at rest such a zero in {name} cannot be told from weight: identify a "
            "run that moves, by the method joint"
        )
    of_file = _table_wrenches if Path(path).suffix.lower() in TABLES else _run_wrenches
    wrenches = _without(of_file(path, experiment, windows), without, name)
    force, moment, specific_force = wrenches.force, wrenches.moment, wrenches.lean.specific_force
    rig = _declared_rig(experiment, wrenches)
    findings = [*(wrenches.findings or _axes(wrenches, experiment, rig, name))]
    estimate = partial(
        centre, force, moment, specific_force, mass=experiment.scale, name=name, used=wrenches.used,
        labels=wrenches.labels, progress=wrenches.progress,
    )  # fmt: skip
    poses = experiment.poses or Poses()
    attitudes = uncertain(specific_force, poses, wrenches.lean.accelerometer, wrenches.rig.imu_rotation)
    try:
        plain = estimate(attitudes=attitudes)
    except RunError as error:
        raise RunError("; ".join(_texts(findings)) or str(error)) from None
    findings = findings or unit_findings(plain, rig, name)
    push = plain.mass * specific_force
    weight = np.hstack([push, np.cross(plain.r_cg, push)])
    if (expected := calibrated_error(experiment, weight)).any():
        force, moment = force - expected[:, :3], moment - expected[:, 3:]
        estimate = partial(estimate.func, force, moment, specific_force, **estimate.keywords)
        plain = estimate(attitudes=attitudes)
    errors, names = weight_errors(experiment, weight)
    result = estimate(attitudes=replace(attitudes, wrench=errors)) if names else plain
    result = centre_with_undeclared(
        result, experiment, wrench=np.hstack([force, moment]), specific_force=specific_force,
        sensed=wrenches.lean.accelerometer is not None,
    )  # fmt: skip
    offset = np.hstack([result.force_offset, result.moment_offset])
    aligned = () if poses.sigma_alignment > 0 else (ALIGNED,)
    gravity = () if "gravity" in experiment.document.get("platform", {}) else (
        f"local gravity is {experiment.gravity:g} m/s²",
    )  # fmt: skip
    return replace(
        result,
        lasting_names=(*(f"{ATTITUDE_AXIS}{k + 1}" for k in range(attitudes.lasting)), *names),
        zero=reading_of(offset, wrenches.rig) if wrenches.rig.cell_axes else None,
        warnings=(*(_texts(findings) or _turned(wrenches, poses, result)), *wrenches.warnings, *result.warnings),
        assumptions=(*wrenches.rig.assumptions, *gravity, *aligned, *wrenches.notes),
        provenance=provenance(**experiment.inputs(), inputs=[{"file": str(path), "sha256": wrenches.sha256}]),
    )


def _without(wrenches: _Wrenches, numbers: Sequence[int], name: str) -> _Wrenches:
    """The wrenches without the poses of these numbers."""
    count = len(wrenches.used)
    for number in numbers:
        if not 1 <= number <= count:
            raise RunError(f"no pose {number} in {name}: it has {count}, counted from 1")
    left_out = np.isin(np.arange(1, count + 1), numbers)
    notes = [f"left out as asked: {label}" for label in np.array(wrenches.labels)[left_out]]
    return replace(wrenches, used=wrenches.used & ~left_out, notes=(*wrenches.notes, *notes))


def _texts(findings: Sequence[Finding]) -> tuple[str, ...]:
    return tuple(f"suspicious {finding.topic}: {finding.text}" for finding in findings)


def _declared_rig(experiment: Experiment, wrenches: _Wrenches) -> DeclaredRig:
    """Return the declarations of body and rig; a scale's mass counts before the body's."""
    rig = declared_rig(experiment, measured=wrenches.measured)
    return rig if experiment.scale is None else replace(rig, mass=experiment.scale[0])


def _axes(wrenches: _Wrenches, experiment: Experiment, rig: DeclaredRig, name: str) -> list[Finding]:
    """Contradictions of axes and signs; of a wrench that the attitude turned back only those of signs."""
    signals = (wrenches.force, wrenches.moment, wrenches.lean.specific_force)
    used = PoseSignals(*(values[wrenches.used] for values in signals))
    found = axis_findings(used, rig, _upside_down(wrenches, experiment), name)
    return [finding for finding in found if finding.label == "sign" or not experiment.recording.turns_back]


def _upside_down(wrenches: _Wrenches, experiment: Experiment) -> SignReading:
    """Words and cure where the attitudes have the other sign."""
    if wrenches.measured:
        return DOWNWARDS
    if experiment.poses is not None and experiment.poses.attitude == "gravity":
        points = "down" if experiment.poses.gravity_points == "up" else "up"
        return SignReading(f"the vectors of gravity point {points}", Entries({"gravity_points": points}, table="poses"))
    gravity = -experiment.recording.gravity_of_poses(experiment.gravity)
    return SignReading("gravity is upside down", gravity_entry(gravity))


def _turned(wrenches: _Wrenches, poses: Poses, result: Centre) -> tuple[str, ...]:
    """Return the warning that the attitude sensor is turned by more than is declared."""
    further = None if result.further is None else result.further[:, :3]
    turn = attitude_turn(wrenches.force[wrenches.used], wrenches.lean.specific_force[wrenches.used], further)
    if turn is None or float(np.linalg.norm(turn.vector)) < 3 * poses.sigma_alignment:
        return ()
    rotation = Entries({"imu_rotation_to_body": turn.matrix @ wrenches.rig.imu_rotation})
    cure = Cure(choices=[rotation], then=", or correct wrench_rotation_to_body, or declare sigma_alignment")
    return (
        f"the forces fit the attitudes only with a turn of the attitudes' axes into the load cell's by {turn}: "
        f"{written(cure)}",
    )


def _table_wrenches(path: str | Path, experiment: Experiment, windows: Sequence[TimeWindow]) -> _Wrenches:
    poses, name = need_table(experiment.poses, path), Path(path).name
    table = read_columns(path, poses.columns)
    attitude, force, moment = (
        table.numbers(signal, complete=True) for signal in (str(poses.attitude), "force", "moment")
    )
    for signal, values in ((str(poses.attitude), attitude), ("force", force), ("moment", moment)):
        refuse_excess(signal, values, name)
    if poses.joints is not None:
        attitude, poses = _by_joints(attitude, poses, experiment.recording, name)
        experiment = replace(experiment, poses=poses)
    sensed = poses.attitude == "acceleration"
    nothing = np.zeros((len(attitude), 3))
    bag = as_recording(path, force, moment, nothing, attitude if sensed else nothing)
    unused = {"angular_velocity"} if sensed else {"angular_velocity", "acceleration"}
    rig = declared(bag, silenced(experiment.recording, unused))
    to_rest = rotations(attitude, poses, name) if poses.attitude in ROTATIONS else None
    if to_rest is None and experiment.recording.turns_back:
        raise RunError(
            f"recording.wrench_frame is {experiment.recording.wrench_frame}, and {poses.attitude} of {name} does not "
            f"turn its wrench back: name the columns of one of {', '.join(ROTATIONS)} in [poses]"
        )
    of_body = None if to_rest is None else to_rest @ rig.imu_rotation.T
    force, moment = rig.wrench(bag.wrench, of_body if experiment.recording.turns_back else None)
    notes: tuple[str, ...] = ()
    if sensed:
        readings = rig.scales["acceleration"] * attitude
    elif to_rest is None:
        readings = upward(attitude, poses, name)
    else:
        gravity = experiment.recording.gravity_of_poses(experiment.gravity)
        readings = -np.einsum("nji,j->ni", to_rest, gravity / np.linalg.norm(gravity))
        notes = (_upwards(experiment.recording),)
    if poses.rate is not None:
        t, in_body = np.arange(len(force)) / poses.rate, readings @ rig.imu_rotation.T
        run = Run(t, force, moment, turning(readings, poses.rate), name=name, sha256=bag.sha256)
        run = replace(run, specific_force=in_body if sensed else None)
        held = _held(Recorded(run, (), (), rig), experiment, windows, None if sensed else in_body)
        return replace(held, notes=(*held.notes, *notes))
    if windows:
        raise RunError(f"{name} is a table, which has no times: leave --from and --to out")
    if sampled(readings):
        raise RunError(
            f"the attitude changes from row to row of {name}: its rows are samples of a motion, not poses. Write how "
            'many there are a second in [poses], such as rate = "125 Hz": then each still segment is a pose'
        )
    findings: Sequence[Finding] = ()
    if to_rest is not None:
        along = rig.wrench(bag.wrench)[0]
        findings = pose_findings(along, pose_readings(attitude, experiment, rig.imu_rotation, name), name)
    if sensed:
        lean = _by_accelerometer(readings, experiment, rig.imu_rotation)
    else:
        lean = _Lean((experiment.gravity * readings) @ rig.imu_rotation.T)
    return _Wrenches(
        force=force, moment=moment, lean=lean, rig=rig, sha256=bag.sha256, warnings=lean.warnings,
        notes=(*lean.notes, *notes), used=np.ones(len(force), bool),
        labels=tuple(f"pose {number}" for number in range(1, len(force) + 1)), findings=findings, measured=sensed,
        progress=table.numbers("time", complete=True)[:, 0] if poses.time is not None else None,
    )  # fmt: skip


def _by_joints(angles: np.ndarray, poses: Poses, recording: RecordingTable, name: str) -> tuple[np.ndarray, Poses]:
    """The matrices of the attitudes that joints tell by the robot's description, and what they mean."""
    chain = Chain.load(recording, tuple(poses.joints or ()), name)
    turns = chain.attitude(angles * scale(str(poses.angle_unit), "rad"))
    rows = tuple(f"R{k}" for k in range(9))
    as_matrix = msgspec.structs.replace(poses, joints=None, matrix=rows, takes="sensor_to_level")
    return turns.reshape(-1, 9), as_matrix


def _by_accelerometer(readings: np.ndarray, experiment: Experiment, to_body: np.ndarray) -> _Lean:
    """Return the specific force by an accelerometer's readings along its own axes; ``to_body`` turns these into B's."""
    poses = experiment.poses or Poses()
    specific_force, accelerometer, warnings = of_accelerometer(readings, poses, experiment.gravity)
    offset = f"offset is {_vector(accelerometer.offset)} m/s²" if accelerometer.fitted else "offset is zero"
    note = f"the accelerometer's {offset}, its gain {accelerometer.gain:.4f}"
    return _Lean(specific_force @ to_body.T, accelerometer, warnings, (note,))


def _run_wrenches(path: str | Path, experiment: Experiment, windows: Sequence[TimeWindow]) -> _Wrenches:
    recorded = load(path, experiment.recording, gravity=experiment.gravity, band=SLOW, marks=names_marks(windows))
    run = recorded.run
    if run.specific_force is not None:
        return _held(recorded, experiment, windows)
    if run.attitude is None or run.gravity is None:
        raise RunError(
            f"neither acceleration nor poses in {run.name}: static poses need an accelerometer, a topic of the "
            "platform's pose, or a table with their attitude"
        )
    held = _held(recorded, experiment, windows, -np.einsum("nji,j->ni", run.attitude, run.gravity))
    return replace(held, notes=(*held.notes, _upwards(experiment.recording)))


def _held(
    recorded: Recorded, experiment: Experiment, windows: Sequence[TimeWindow], up: np.ndarray | None = None
) -> _Wrenches:
    """The poses that samples hold, each still segment one; ``up`` tells their attitude where no accelerometer does."""
    run = recorded.run
    wanted = resolve(windows, float(run.t[-1]), recorded.marks, run.name) if windows else ((0.0, float(run.t[-1])),)
    rests = resting(run, wanted)
    wrench = np.hstack([run.force, run.moment])
    used, left_out = _steady(run, rests)
    if used.sum() < 3:
        out = f", {len(left_out)} more drift" if left_out else ""
        raise RunError(
            f"{used.sum()} poses in {run.name}{out}: hold three or more still for a second, tilted about two axes"
        )
    means = np.array([wrench[rest].mean(axis=0) for rest in rests])
    lean = _lean(recorded, rests, experiment, up)
    seconds = sum(len(rest) for rest, counts in zip(rests, used, strict=True) if counts) / run.rate
    held = f"{used.sum()} still segments are its poses, {seconds:.1f} s in all"
    return _Wrenches(
        force=means[:, :3], moment=means[:, 3:], lean=lean, rig=recorded.rig, sha256=str(run.sha256),
        warnings=(*run.warnings, *left_out, *lean.warnings), notes=(held, *lean.notes),
        used=used, labels=_labels(run, rests), measured=run.specific_force is not None and run.gravity is None,
        progress=np.array([run.t[rest].mean() for rest in rests]),
    )  # fmt: skip


def _labels(run: Run, rests: Sequence[np.ndarray]) -> tuple[str, ...]:
    spans = enumerate(((run.t[rest[0]], run.t[rest[-1]]) for rest in rests), start=1)
    return tuple(f"pose {number} ({start:.1f} to {stop:.1f} s)" for number, (start, stop) in spans)


def _lean(recorded: Recorded, rests: Sequence[np.ndarray], experiment: Experiment, up: np.ndarray | None) -> _Lean:
    """Return the specific force of each pose, by what points up, or by the accelerometer."""
    if up is not None:
        means = np.array([up[rest].mean(axis=0) for rest in rests])
        return _Lean(experiment.gravity * means / np.linalg.norm(means, axis=1, keepdims=True))
    run, to_body = recorded.run, recorded.rig.imu_rotation
    assert run.specific_force is not None  # noqa: S101 - the callers have seen it
    means = np.array([run.specific_force[rest].mean(axis=0) for rest in rests])
    return _by_accelerometer(means @ to_body, experiment, to_body)


def _upwards(recording: RecordingTable) -> str:
    if recording.urdf_gravity is not None:
        return "gravity along the axes of the attitudes' frame is as urdf_gravity says"
    return "the z axis of the frame to which the attitudes refer points up"


def _steady(run: Run, rests: list[np.ndarray]) -> tuple[np.ndarray, list[str]]:
    """Return which poses count, those in which the load cell neither drifts nor creeps, and warnings of the others."""
    if len(rests) < 3:
        return np.ones(len(rests), bool), []
    wrench = np.hstack([run.force, run.moment])
    drifting, slopes, all_drift = creeping([wrench[rest] for rest in rests], run.rate)
    warnings = [
        f"{label} left out: within it the force changes by {_size(slope[:3])} N and the moment by "
        f"{_size(slope[3:])} N·m"
        for label, slope, drifts in zip(_labels(run, rests), slopes, drifting, strict=True)
        if drifts
    ]
    if all_drift:
        warnings.append(
            "force or moment drift in most poses: let the load cell warm up, or hold each pose for a shorter time"
        )
    return ~drifting, warnings


def resting(run: Run, wanted: Sequence[tuple[float, float]]) -> list[np.ndarray]:
    """Return the usable samples of each still segment of a second or more within the wanted parts [s]."""
    others = () if run.specific_force is None else (run.specific_force,)
    segments = still(run.rate, run.omega, run.force, run.moment, *others)
    usable = run.usable
    rests = []
    for start, stop in wanted:
        for rest in segments:
            since = run.t - run.t[0]
            inside = (since >= max(rest.start, start - run.t[0])) & (since <= min(rest.stop, stop - run.t[0]))
            if (inside & usable).sum() >= run.rate:
                rests.append(np.flatnonzero(inside & usable))
    return rests


def reading_of(wrench: np.ndarray, rig: DeclaredConventions) -> np.ndarray:
    """Return what the cell reads [N, N·m] of a wrench (6,) on the body at Q: in its own sign and axes."""
    force, moment = wrench[:3], wrench[3:] - np.cross(rig.wrench_point, wrench[:3])
    return rig.sign * np.concatenate([rig.wrench_rotation.T @ force, rig.wrench_rotation.T @ moment])


def _size(vector: np.ndarray) -> str:
    return significant(float(np.linalg.norm(vector)), 2)


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(fixed(value, 3) for value in values)})"


OTHER = {"sensor_to_level": "level_to_sensor", "level_to_sensor": "sensor_to_level"}


class _Choice(NamedTuple):
    """One of the values that something may have in the reading of attitudes."""

    value: Any
    words: str = ""
    """Difference from the reading that is declared; empty: there is none."""
    settings: Sequence[Entries] = ()
    """Keys that declare the value."""


def pose_readings(
    values: np.ndarray, experiment: Experiment, to_body: np.ndarray, name: str
) -> tuple[PoseReading, ...]:
    """Return the ways to read a table's attitudes, that declared first.

    Args:
        values: columns of the attitude.
        experiment: what is declared of poses and recording.
        to_body: rotation from the axes of the attitude's sensor to the body's.
        name: what messages call the table.
    """
    poses, recording = experiment.poses, experiment.recording
    assert poses is not None  # noqa: S101 - the table was read by it
    gravity = recording.gravity_of_poses(experiment.gravity)
    gravity = experiment.gravity / np.linalg.norm(gravity) * gravity
    # of each choice, what is declared comes first
    other = OTHER[str(poses.takes)]
    takes = Entries({"takes": other}, table="poses")
    directions = [_Choice(str(poses.takes)), _Choice(other, "taken the other way", [takes])]
    downs = [_Choice(gravity), _Choice(None, "with gravity along other axes")]
    turns, rests = (
        _Choice(False, "with the wrench along axes that turn", [Entries({"wrench_frame": "sensor"})]),
        _Choice(True, "with the wrench along axes at rest", [Entries({"wrench_frame": "base"})]),
    )
    frames = (_Choice(True), turns) if recording.turns_back else (_Choice(False), rests)
    readings = []
    for order, direction, frame, down in product(_orders(poses), directions, frames, downs):
        if frame.words and direction.words:  # the same as gravity along other axes, weight and zero swapped
            continue
        reading, columns = order.value
        try:
            to_rest = rotations(values[:, columns], msgspec.structs.replace(reading, takes=direction.value), name)
        except RunError:
            continue
        changed = [choice for choice in (order, direction, frame, down) if choice.words]
        readings.append(
            PoseReading(
                how=" and ".join(choice.words for choice in changed),
                settings=[entries for choice in changed for entries in choice.settings],
                to_rest=to_rest @ to_body.T, at_rest=frame.value, gravity=down.value, changes=len(changed),
            )
        )  # fmt: skip
    return tuple(readings)


def _orders(poses: Poses) -> Iterator[_Choice]:
    """Orders of a quaternion's components, or conventions of angles, those declared first: poses and their columns."""
    columns = poses.columns.names[str(poses.attitude)]
    declared = list(range(len(columns)))
    yield _Choice((poses, declared))
    if poses.quaternion is not None:  # w stands first where others have it last
        for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
            by_component = {name: columns[k] for name, k in zip("wxyz", order, strict=True)}
            fields = Entries({"quaternion": by_component}, table="poses")
            yield _Choice((poses, order), "with the quaternion's components in another order", [fields])
    if poses.euler is not None:
        for axes in sorted({*CONVENTIONS.values(), "zyx"} - {str(poses.euler_convention)}):
            convention = Entries({"euler_convention": axes}, table="poses")
            other = msgspec.structs.replace(poses, euler_convention=axes)
            yield _Choice((other, declared), f"with angles about {axes}", [convention])
