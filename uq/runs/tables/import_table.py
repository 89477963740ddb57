"""Tables of samples to our runs: the function behind ``inertia import``."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.signals.run import RunError, refuse_excess
from rig.channels import ImuChannel, MotionChannel, Recording, WrenchChannel
from rig.exceptions import on_one_line
from rig.mcap.message_definitions import JOINTS, POSE
from rig.runs import write
from uq.experiment.recording_table import UNITS, RecordingTable
from uq.files.mistakes import ExperimentError
from uq.files.provenance import sha256
from uq.files.units import scale
from uq.runs.recorded.declared_channels import declared
from uq.runs.tables.gravity_columns import pointing, put_back
from uq.runs.tables.table_map import MOTIONS, WRENCH, Map
from uq.runs.tables.table_samples import DeclaredTable, as_recording, silenced


def import_table(paths: Sequence[str | Path], mapping: Map, output: str | Path) -> str:
    """Write tables of samples as a run of ours: SI units, the wrench on the body at Q, body frame.

    Args:
        paths: a table in a text file, one row per sample; or two that are joined by their times.
        mapping: what their columns mean.
        output: the MCAP file to write.

    Returns:
        What was written, and what was assumed, for a reader.

    Raises:
        ExperimentError: the map does not fit the tables.
        RunError: a table cannot be used, or its time does not increase.
        RigError: the output exists.
        OSError: a file cannot be read or written.
    """
    if len(paths) != len(mapping.parts):
        needed = "one table: name the other's columns in [second]" if mapping.second is None else "two tables"
        raise ExperimentError(f"{len(paths)} {'table' if len(paths) == 1 else 'tables'}, but a map of {needed}")
    tables = [DeclaredTable(path, columns) for path, columns in zip(paths, mapping.parts, strict=True)]
    cell = next(table for table in tables if table.declared.force is not None)
    sensor = next(table for table in tables if table.declared.motion)
    conventions = _conventions(mapping, cell, sensor)
    keys = dict.fromkeys((sensor.declared.motion, "acceleration", sensor.declared.attitude, "position", "gravity"))
    signals = [key for key in keys if key in sensor.table.places]
    loads, motion = cell.samples(WRENCH), sensor.samples(signals)
    _check_overlap(cell, loads.stamp, sensor, motion.stamp)
    zero = min(0, int(loads.stamp.min()), int(motion.stamp.min()))
    nothing = np.zeros((len(motion.stamp), 3))
    turns = sensor.declared.motion == MOTIONS[0]
    force, moment = loads.values
    values = dict(zip(signals, motion.values, strict=True))
    omega, acceleration = (values.get(key, nothing) for key in (MOTIONS[0], "acceleration"))
    raw = as_recording(cell.path, force, moment, omega, acceleration)
    rig = declared(raw, silenced(conventions, set(UNITS) - {*WRENCH, *signals}))
    of_gravity: tuple[str, ...] = ()
    if restored := "gravity" in values:
        raw, of_gravity = _with_gravity(
            raw, sensor, values["gravity"], (loads.stamp, motion.stamp), rig.scales["acceleration"]
        )
    force, moment = rig.wrench(raw.wrench)
    wrench = WrenchChannel(
        topic="/wrench", frame_id="body", log_time=loads.stamp - zero, stamp=loads.stamp - zero, force=force,
        moment=moment,
    ).in_order()  # fmt: skip
    channel = _motion(sensor, motion.stamp - zero, values, rig.motion(raw.imu)).in_order()
    cell.check_order(wrench.stamp)
    sensor.check_order(channel.stamp)
    notes = (*rig.assumptions, *of_gravity, *dict.fromkeys((*loads.notes, *motion.notes)))
    frames = {wrench.topic: "force and moment on the body at Q, in B"}
    if turns:
        accelerates = "acceleration" in signals
        frames[channel.topic] = "in B" if accelerates else "in B; no acceleration was imported: it is zero"
    files = [{"file": table.path.name, "sha256": sha256(table.path)} for table in tables]
    about = {
        "imported": json.dumps(files if len(files) > 1 else files[0]),
        "assumed": json.dumps(notes, ensure_ascii=False),
        "wrench": "on_body",
        "frames": json.dumps(frames),
        "units": json.dumps(UNITS),
    }
    if mapping.recording.accelerometer_at_rest == "zero" and not restored:
        about["accelerometer_at_rest"] = "zero"
    write(output, wrench=wrench, imu=channel, metadata={"rig.run": about})
    count = f"{len(wrench.stamp):,} samples"
    if len(channel.stamp) != len(wrench.stamp):
        count += f" of the wrench and {len(channel.stamp):,} of the motion"
    lines = [f"{count} written to {Path(output)}", *(f"assumed: {note}" for note in notes)]
    return "\n".join(map(on_one_line, lines))


def _conventions(mapping: Map, cell: DeclaredTable, sensor: DeclaredTable) -> RecordingTable:
    """The declaration, with the units that the tables state.

    Raises:
        ExperimentError: map and table contradict each other, or neither states a unit.
    """
    units = {}
    for signal in UNITS:
        key, table = f"{signal}_unit", cell if signal in WRENCH else sensor
        if signal not in table.table.places:
            continue
        units[key] = table.unit(signal, f"recording.{key}", mapping.recording.unit(signal))
        if units[key] is None and signal != "acceleration":
            raise ExperimentError(f"missing key recording.{key}: add it, {table.path.name} does not state it")
    if sensor.declared.motion != MOTIONS[0] and mapping.recording.imu_rotation_to_body is not None:
        raise ExperimentError(
            f"recording.imu_rotation_to_body turns an angular velocity, not {sensor.declared.motion}: remove it, "
            "and declare it in the experiment"
        )
    return RecordingTable(**mapping.recording.to_dict() | units)


def _motion(
    sensor: DeclaredTable, stamp: np.ndarray, values: dict[str, np.ndarray], rates: tuple[np.ndarray, np.ndarray]
) -> ImuChannel | MotionChannel:
    """The channel of the motion; ``rates``: angular velocity and specific force, where the table holds them."""
    if "joints" in values:
        position = values["joints"] * scale(sensor.declared.joint_unit, "rad")
        return MotionChannel(
            topic="/joint_states", frame_id="", log_time=stamp, stamp=stamp, type=JOINTS,
            names=tuple(sensor.declared.joints or ()), position=position,
        )  # fmt: skip
    attitude, name = sensor.declared.attitude, sensor.path.name
    orientation = sensor.declared.quaternions(values[attitude], attitude, name) if attitude else None
    origin = values["position"] * scale(sensor.declared.position_unit, "m") if "position" in values else None
    if MOTIONS[0] not in values:
        return MotionChannel(
            topic="/pose", frame_id="world", log_time=stamp, stamp=stamp, type=POSE, orientation=orientation,
            position=origin,
        )  # fmt: skip
    return ImuChannel(
        topic="/imu", frame_id="body", log_time=stamp, stamp=stamp, angular_velocity=rates[0],
        linear_acceleration=rates[1], orientation=orientation,
    )  # fmt: skip


def _with_gravity(
    raw: Recording, sensor: DeclaredTable, gravity: np.ndarray, stamps: tuple[np.ndarray, np.ndarray], scale: float
) -> tuple[Recording, tuple[str, ...]]:
    """Put back gravity by its columns, along the IMU's axes; with what was assumed of it.

    Args:
        raw: force, and acceleration without gravity, as they stand in the tables.
        sensor: the IMU's table.
        gravity: its vectors, (n, 3).
        stamps: instants of wrench and motion [ns].
        scale: unit of the acceleration [m/s²].

    Raises:
        ExperimentError: the force shows that they point the other way.
        RunError: their length is not that of gravity.
    """
    for signal, vectors in {
        "force": raw.wrench.force,
        "acceleration": raw.imu.linear_acceleration,
        "gravity": gravity,
    }.items():
        refuse_excess(signal, vectors, sensor.path.name)
    linear, declared_points = raw.imu.linear_acceleration, sensor.declared.gravity_points or "down"
    zero, order = stamps[1][0], np.argsort(stamps[0])
    seconds = [(stamp - zero) * 1e-9 for stamp in stamps]
    force = [np.interp(seconds[1], seconds[0][order], component[order]) for component in raw.wrench.force.T]
    points = pointing(np.stack(force, axis=1), linear, gravity)
    if points not in (None, declared_points):
        raise ExperimentError(
            f"the vectors of gravity in {sensor.path.name} point {points}, by the force: write gravity_points = "
            f'"{points}" beside their columns in the map'
        )
    specific, assumed = put_back(linear, gravity, scale, declared_points, sensor.path.name)
    return replace(raw, motion=replace(raw.imu, linear_acceleration=specific)), (assumed,) * bool(assumed)


def _check_overlap(cell: DeclaredTable, loads: np.ndarray, sensor: DeclaredTable, motion: np.ndarray) -> None:
    """Refuse two tables of different clocks."""
    if cell is sensor:
        return
    for table, place in ((cell, "columns"), (sensor, "second")):
        if table.declared.time is None and table.declared.time_offset is None:
            raise ExperimentError(f"no times in {table.path.name} to join it by: name {place}.time, or its time_offset")
    if max(loads.min(), motion.min()) >= min(loads.max(), motion.max()):
        ranges = [f"{table.path.name} goes from {_instant(int(t.min()))} to {_instant(int(t.max()))}"
                  for table, t in ((cell, loads), (sensor, motion))]  # fmt: skip
        raise RunError(f"{', '.join(ranges)}: state time_offset of one of them, or give tables of the same run")


def _instant(stamp: int) -> str:
    """An instant for a reader: a date, or seconds where the clock does not count from 1970."""
    return f"{np.datetime64(stamp, 'ns').astype('datetime64[ms]')}" if stamp > 1e17 else f"{stamp * 1e-9:.3f} s"
