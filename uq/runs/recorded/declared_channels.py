"""Meaning of a recorded run's channels, from the experiment's declaration and the run's own metadata.

What both say must agree; what one says is used; what neither says is an assumption of the result.
"""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from identify.rigid_body.dynamics import moment_about
from identify.signals.run import RunError
from rig import channels
from rig.channels import ImuChannel, WrenchChannel
from rig.exceptions import quoted
from rig.read_limits import parse_json
from uq.experiment.recording_table import UNITS, RecordingTable
from uq.files.units import UnitError, printed, scale
from uq.runs.recorded.angular_velocity import AT_REST

EQUAL = 1e-9
"""Difference that two declarations of the same may have, for rounding."""


@dataclass(frozen=True)
class DeclaredConventions:
    """Conventions by which a run's channels become wrench on the body about Q and motion, in B and in SI."""

    sign: float
    scales: dict[str, float]
    calibration: np.ndarray
    wrench_rotation: np.ndarray
    imu_rotation: np.ndarray
    wrench_point: np.ndarray
    imu_position: np.ndarray | None
    """The accelerometer, from Q; None: nobody says."""
    assumptions: tuple[str, ...]
    cell_axes: bool = True
    """Whether the wrench is recorded in the load cell's own axes; not in those of the body, as a run of ours is."""
    accelerometer_delay: float = 0.0
    """Time by which the accelerometer's samples are older than the gyro's [s]."""
    wrench_time_constant: float = 0.0
    """Time constant of the low-pass of first order through which the wrench went [s]."""
    gravity_removed: bool = False
    """Whether gravity was taken out of the accelerometer's readings."""

    def wrench(self, channel: WrenchChannel, attitude: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return force and moment on the body about Q, in B: by calibration, units, sign, rotation, attitude, point.

        Args:
            channel: of the load cell.
            attitude: rotation of each sample from B to the axes at rest along which the wrench was recorded, (n, 3, 3);
                None: its axes turn with the body.
        """
        to_body = scipy.linalg.block_diag(*(self.scales[name] * self.wrench_rotation for name in ("force", "moment")))
        measured = np.concatenate([channel.force.T, channel.moment.T])
        wrench = (self.sign * to_body @ self.calibration @ measured).T
        force, moment = wrench[:, :3], wrench[:, 3:]
        if attitude is not None:
            force, moment = (np.einsum("nji,nj->ni", attitude, values) for values in (force, moment))
        return force, moment_about(moment, force, self.wrench_point) if self.wrench_point.any() else moment

    def motion(self, channel: ImuChannel) -> tuple[np.ndarray, np.ndarray]:
        """Return angular velocity and specific force in B."""
        rate, acceleration = (self.scales[name] * self.imu_rotation for name in ("angular_velocity", "acceleration"))
        return (rate @ channel.angular_velocity.T).T, (acceleration @ channel.linear_acceleration.T).T


def declared(bag: channels.Recording, recording: RecordingTable) -> DeclaredConventions:
    """Bring a run's metadata and the experiment's declaration together.

    Raises:
        RunError: the two contradict each other, or the metadata names a unit that there is not.
    """
    metadata = _Metadata(bag)
    _check_wrench(bag, recording, metadata)
    assumed: list[str] = []
    scales = _scales(metadata, recording, assumed)
    scales["acceleration"] *= -1.0 if recording.accelerometer_at_rest == "down" else 1.0
    if metadata.gravity_removed and recording.accelerometer_at_rest not in (None, "zero"):
        stated = "gravity was taken out of its acceleration"
        raise metadata.contradiction(stated, "accelerometer_at_rest", recording.accelerometer_at_rest)
    meaning = recording.wrench or metadata.wrench
    if meaning is None:
        assumed.append("the wrench is that on the body")
    elif metadata.wrench not in (None, meaning):
        raise metadata.contradiction(f"its wrench is {metadata.wrench}", "wrench", meaning)
    wrench_rotation = _rotation(metadata, "wrench", recording.wrench_rotation_to_body, metadata.wrench_in_body)
    imu_rotation = _rotation(metadata, "imu", recording.imu_rotation_to_body, metadata.imu_in_body)
    point = _point(metadata, "wrench_point", recording.wrench_point, metadata.wrench_at_q)
    position = _point(metadata, "imu_position", recording.imu_position, metadata.imu_at_q)
    silent = {"the load cell's axes": wrench_rotation, "the IMU's axes": imu_rotation}
    if unsaid := [name for name, value in silent.items() if value is None]:
        assumed.append(f"{' and '.join(unsaid)} are the body's")
    if point is None:
        assumed.append("the moment is taken about Q")
    return DeclaredConventions(
        sign=-1.0 if meaning == "on_sensor" else 1.0, scales=scales,
        calibration=np.eye(6) if recording.calibration is None else recording.calibration,
        wrench_rotation=np.eye(3) if wrench_rotation is None else wrench_rotation,
        imu_rotation=np.eye(3) if imu_rotation is None else imu_rotation,
        wrench_point=np.zeros(3) if point is None else point, imu_position=position, assumptions=tuple(assumed),
        cell_axes=not metadata.wrench_in_body, accelerometer_delay=recording.accelerometer_delay or 0.0,
        wrench_time_constant=0.0 if recording.wrench_lowpass is None else 1 / (2 * np.pi * recording.wrench_lowpass),
        gravity_removed=metadata.gravity_removed or recording.accelerometer_at_rest == "zero",
    )  # fmt: skip


WRENCH_AT_REST = (*AT_REST, "base")
"""Frames of a wrench that do not turn with the body: REP 105, and the base of an arm."""


def _check_wrench(bag: channels.Recording, recording: RecordingTable, metadata: "_Metadata") -> None:
    """Refuse a wrench along axes that rest, and one whose weight a robot has removed without a word of it."""
    frame = bag.wrench.frame_id.lstrip("/")
    if frame in WRENCH_AT_REST and recording.wrench_frame is None:
        raise RunError(
            f"the wrench of {metadata.name} is along the axes of {quoted(frame)}, which do not turn with the body: "
            'set wrench_frame = "base" in [recording] where joints, poses or a quaternion give its attitude, or record '
            "it in the sensor's frame"
        )
    if metadata.compensated == "gravity" and not recording.removes_weight:
        raise RunError(
            f"{metadata.name} says that the robot removed the weight of its payload: set compensated = "
            '"gravity" in [recording], with payload_mass and payload_r_cg_from_q where that payload is not the body, '
            'or record with compensated = "none"'
        )


class _Metadata:
    """Statements of a run's metadata ``rig.run`` on its channels."""

    def __init__(self, bag: channels.Recording) -> None:
        self.name = bag.path.name
        about = bag.metadata.get("rig.run", {})
        meaning = about.get("wrench")
        self.wrench = meaning if meaning in ("on_body", "on_sensor") else None
        frames = _json(about.get("frames"))
        wrench_meaning = str(frames.get(bag.wrench.topic, about.get("wrench_meaning", "")))
        imu_meaning = str(frames.get(bag.imu.topic, about.get("imu", "")))
        devices = [key.removesuffix(".topic") for key, value in about.items() if value == bag.wrench.topic]
        self.compensated = next(
            (about[f"{name}.compensated"] for name in devices if f"{name}.compensated" in about), ""
        )
        self.wrench_in_body, self.imu_in_body = _in_body(wrench_meaning), _in_body(imu_meaning)
        self.gravity_removed = about.get("accelerometer_at_rest") == "zero"
        self.wrench_at_q, self.imu_at_q = _at_q(wrench_meaning), _at_q(imu_meaning)
        self.units = {name: unit for name, unit in _json(about.get("units")).items() if isinstance(unit, str)}
        if "[N]" in wrench_meaning and "[N*m]" in wrench_meaning:
            self.units = {"force": "N", "moment": "N*m"} | self.units
        if "[rad/s]" in imu_meaning and "[m/s^2]" in imu_meaning:
            self.units = {"angular_velocity": "rad/s", "acceleration": "m/s^2"} | self.units

    def contradiction(self, stated: str, key: str, declared: str) -> RunError:
        """The error that names both."""
        return RunError(
            f"{self.name} says that {stated}, recording.{key} in the experiment says {declared}: correct the experiment"
        )


def _json(text: str | None) -> dict[str, Any]:
    try:
        content = parse_json(text or "{}")
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def _in_body(text: str) -> bool:
    return re.search(r"\bin B\b|\bbody frame\b", text) is not None


def _at_q(text: str) -> bool:
    return re.search(r"\b(at|centre|about) Q\b", text) is not None


def _scales(metadata: _Metadata, recording: RecordingTable, assumed: list[str]) -> dict[str, float]:
    """Return the factor from the unit of each quantity to SI."""
    scales, silent = {}, []
    for quantity, si in UNITS.items():
        declared, unit_name = recording.unit(quantity), metadata.units.get(quantity)
        run_scale = None if unit_name is None else _scale(metadata, quantity, unit_name, si)
        if declared is not None:
            scales[quantity] = scale(declared, si)
            if run_scale is not None and abs(run_scale / scales[quantity] - 1) > EQUAL:
                raise metadata.contradiction(
                    f"its {quantity.replace('_', ' ')} is in {unit_name}", f"{quantity}_unit", declared
                )
        else:
            scales[quantity] = 1.0 if run_scale is None else run_scale
            silent += [printed(si)] * (run_scale is None)
    if silent:
        assumed.append(f"values are in {', '.join(silent)}")
    return scales


def _scale(metadata: _Metadata, quantity: str, name: str, si: str) -> float:
    try:
        return scale(name, si)
    except UnitError:
        raise RunError(
            f"{metadata.name} says that its {quantity.replace('_', ' ')} is in {quoted(name)}, which is no unit of it: "
            "repair the metadata rig.run"
        ) from None


def _rotation(metadata: _Metadata, sensor: str, declared: np.ndarray | None, in_body: bool) -> np.ndarray | None:
    if declared is not None and in_body and np.abs(declared - np.eye(3)).max() > EQUAL:
        raise metadata.contradiction(f"its {sensor} is in the body frame", f"{sensor}_rotation_to_body", "another")
    return np.eye(3) if declared is None and in_body else declared


def _point(metadata: _Metadata, key: str, declared: np.ndarray | None, at_q: bool) -> np.ndarray | None:
    what = {"wrench_point": "its moment is taken about Q", "imu_position": "its IMU is at Q"}[key]
    if declared is not None and at_q and np.abs(declared).max() > EQUAL:
        raise metadata.contradiction(what, key, f"{np.round(1e3 * declared, 6).tolist()} mm")
    return np.zeros(3) if declared is None and at_q else declared
