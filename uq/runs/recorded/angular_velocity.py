"""The angular velocity of a run, whatever tells it: IMU, twist, odometry, pose, or joints with a robot's description.

Every source becomes an IMU's channel in its sensor's own frame; a pose or a joint's position is differentiated here.
Joints tell the specific force, too, where gravity in their base is declared, and so do poses whose origin travels.

The attitude, too, is what a recording tells of it: joints with a description, poses, or an IMU's quaternion.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float, Int

from identify.display.text_tables import counted
from identify.signals.angular_velocity_from_attitude import (
    angular_velocity,
    band_by_turning,
    continuous,
    differentiator,
)
from identify.signals.held_samples import repeats
from identify.signals.resample import in_gap, interpolate, interval, is_uniform
from identify.signals.run import LARGEST, RunError, refuse_excess
from identify.signals.shaped_noise import ShapedNoise
from rig import channels
from rig.channels import ImuChannel, MotionChannel
from rig.exceptions import quoted
from rig.mcap.message_definitions import JOINTS, POSE, TWIST
from uq.experiment.recording_table import RecordingTable
from uq.runs.recorded.joint_kinematics import Chain

AT_REST = ("map", "odom", "world", "earth")
"""Frames that do not turn with a body (REP 105)."""
NANOSECONDS = 1_000_000_000
UNJUDGED = "the wrench is as declared: nothing judges its sign, units, axes and weight without recording.urdf_gravity"


UNIT = 1e-2
"""Departure of a quaternion's norm from 1 beyond which messages hold none."""
TURNS = 1e-6
"""Change of a quaternion's components below which messages hold a constant in its place."""


@dataclass(frozen=True, eq=False)
class RecordedAttitude:
    """Rotations from a sensor's frame to one at rest, at increasing instants."""

    instants: Int[np.ndarray, " n"]
    """Times of the rotations, on the clock of the run [ns]."""
    rotation: Float[np.ndarray, "n 3 3"]
    """Matrices from components along the sensor's axes to those along axes at rest."""

    @classmethod
    def of(cls, instants: np.ndarray, rotation: np.ndarray) -> "RecordedAttitude | None":
        """Return an attitude by samples, of which repeated instants count once; None: fewer than two."""
        times, first = np.unique(instants, return_index=True)
        return cls(times, rotation[first]) if len(times) > 1 else None

    def at(self, instants: np.ndarray) -> Float[np.ndarray, "m 3 3"]:
        """Return the attitude at other instants [ns], on the shortest way between samples; beyond the ends, theirs."""
        rotation = scipy.spatial.transform.Rotation.from_matrix(self.rotation)
        slerp = scipy.spatial.transform.Slerp((self.instants - self.instants[0]) * 1e-9, rotation)
        within = np.clip(instants, self.instants[0], self.instants[-1]) - self.instants[0]
        return np.asarray(slerp(within * 1e-9).as_matrix())

    def of_body(self, to_body: Float[np.ndarray, "3 3"]) -> "RecordedAttitude":
        """Return the attitude of the body, into whose axes a rotation turns the sensor's."""
        return replace(self, rotation=self.rotation @ to_body.T)


def recorded_attitude(source: ImuChannel | MotionChannel, instants: np.ndarray) -> RecordedAttitude | None:
    """Return the attitude that a channel's quaternions tell; None: it has none that turn.

    Args:
        source: channel of poses, odometry or an IMU, whose quaternions take components in the sensor's frame to those
            in a frame at rest (REP 103, REP 145).
        instants: of its messages [ns].
    """
    quaternion = source.orientation
    if quaternion is None or len(quaternion) < 2:
        return None
    if max(float(np.ptp(column)) for column in quaternion.T) < TURNS:
        return None
    norm = np.linalg.norm(np.clip(quaternion, -2, 2), axis=1)  # the square of 1e300 would be no number
    if not (np.abs(norm - 1) < UNIT).all():
        return None
    return RecordedAttitude.of(instants, scipy.spatial.transform.Rotation.from_quat(quaternion).as_matrix())


@dataclass(frozen=True)
class RecordedMotion:
    """An angular velocity as an IMU's channel, and what is to be known of it."""

    imu: ImuChannel
    """Channel of the angular velocity in the sensor's frame; its acceleration is zero where none was recorded."""
    noise: ShapedNoise | None = None
    """The noise of an angular velocity that was differentiated; None: it is taken for white."""
    notes: tuple[str, ...] = ()
    """Assumptions of the result about the angular velocity."""
    warnings: tuple[str, ...] = ()
    attitude: RecordedAttitude | None = None
    """The sensor's attitude; None: the channel does not tell it."""
    gravity: np.ndarray | None = None
    """Gravity along the axes at rest to which the attitude refers [m/s²]; None: it is not declared."""


class Differentiated(NamedTuple):
    """Signals from uniform angles, without as many instants at either end as the differentiator takes."""

    omega: np.ndarray
    """Angular velocity of the frame, (m, 3) [rad/s]."""
    sigma: np.ndarray
    """The white noise of the angles on each axis [rad]."""
    taps: np.ndarray
    specific_force: np.ndarray | None = None
    """Specific force of the frame, (m, 3) [m/s²]; None: the angles do not give it."""


def motion(
    bag: channels.Recording,
    declared: RecordingTable,
    instants: np.ndarray,
    *,
    gravity: float,
    band: float | None = None,
) -> RecordedMotion:
    """Return the angular velocity that a run's motion topic tells.

    Args:
        bag: the run.
        declared: the experiment's ``[recording]``.
        instants: of the motion's messages, on the clock that is used for them [ns].
        gravity: its local size [m/s²].
        band: highest frequency of the motion [Hz], where it is declared.

    Raises:
        RunError: the topic does not tell it, or not so that it could be used.
        ExperimentError: joints without ``urdf`` or ``urdf_frame``, or a URDF that does not fit them.
        RigError: the optional package for URDF is missing.
    """
    source = bag.motion
    for signal in ("position", "orientation", "velocity", "angular_velocity"):
        values = getattr(source, signal, None)
        if values is not None and values.size:
            wild = np.where(np.abs(values) > LARGEST, values, 0.0)  # and not the NaN of a joint that is missing
            refuse_excess(f"{signal} of {source.topic}", wild, bag.path.name)
    pose_gravity = declared.gravity_of_poses(gravity)
    turning, attitude = _turning(bag, declared, instants, pose_gravity, band), recorded_attitude(source, instants)
    if attitude is None:
        return turning
    # An accelerometer tells gravity better than a quaternion, which may refer to axes of its own.
    posed = isinstance(source, MotionChannel) or not source.linear_acceleration.any()
    return replace(turning, attitude=attitude, gravity=pose_gravity if posed else None)


def _turning(
    bag: channels.Recording, declared: RecordingTable, instants: np.ndarray, gravity: np.ndarray, band: float | None
) -> RecordedMotion:
    source = bag.motion
    if isinstance(source, ImuChannel):
        return RecordedMotion(source)
    name = f"{source.topic} in {bag.path.name}"
    if source.type == JOINTS:
        return _of_joints(source, declared, instants, name, band)
    turning = source.angular_velocity
    if source.type == TWIST and source.frame_id.strip("/") in AT_REST:
        raise RunError(
            f"the twist of {name} is in the frame {quoted(source.frame_id)}, which does not turn with the body: "
            "record it in the body's frame, or a pose"
        )
    if turning is not None and turning.any():
        note = f"the noise of {source.topic} ({source.type}) is white"
        measured = RecordedMotion(_channel(source, turning), notes=(note,))
        if not _travels(source):
            return measured
        return _with_poses(measured, _of_pose(source, declared, instants, name, gravity, band))
    if source.orientation is None:
        raise RunError(f"the angular velocity of {name} is zero throughout: record a body that moves")
    from_poses = _of_pose(source, declared, instants, name, gravity, band)
    if source.type == POSE:
        return from_poses
    warning = f"the twist of {name} is zero throughout: its poses were differentiated instead"
    return RecordedMotion(from_poses.imu, from_poses.noise, from_poses.notes, (warning,))


def _travels(source: MotionChannel) -> bool:
    """Whether a channel of poses tells where its origin is."""
    return source.orientation is not None and source.position is not None and bool(np.ptp(source.position, 0).any())


def _with_poses(measured: RecordedMotion, posed: RecordedMotion) -> RecordedMotion:
    """A measured angular velocity with the specific force by poses, within the instants that these tell."""
    stamps, known = measured.imu.log_time, posed.imu.log_time
    imu = measured.imu.taken((stamps >= known[0]) & (stamps <= known[-1]))
    force = interpolate((known - known[0]) * 1e-9, posed.imu.linear_acceleration, (imu.log_time - known[0]) * 1e-9)
    return replace(measured, imu=replace(imu, linear_acceleration=force), notes=(*measured.notes, posed.notes[-1]))


def _of_pose(
    source: MotionChannel, declared: RecordingTable, instants: np.ndarray, name: str, gravity: np.ndarray,
    band: float | None,
) -> RecordedMotion:  # fmt: skip
    if declared.angular_velocity_unit is not None:
        raise RunError(f"{name} holds poses: remove recording.angular_velocity_unit, their rate is in rad/s")
    quaternion = continuous(np.asarray(source.orientation), name)
    travels = _travels(source)
    pose = np.hstack([quaternion, np.asarray(source.position)]) if travels else quaternion

    def turn(uniform: np.ndarray, rate: float) -> Differentiated:
        unit = uniform[:, :4] / np.linalg.norm(uniform[:, :4], axis=1, keepdims=True)
        taps = differentiator(unit, rate, name, band=band, by_turning=band_by_turning(unit, rate))
        omega, sigma = angular_velocity(unit, taps)
        if not travels:
            return Differentiated(omega, sigma, taps)
        inner = slice(2 * len(taps), len(unit) - 2 * len(taps))
        acceleration = _slope(_slope(uniform[:, 4:], taps), taps)
        to_rest = scipy.spatial.transform.Rotation.from_quat(unit[inner])
        omega = omega[len(taps) : len(omega) - len(taps)]
        return Differentiated(omega, sigma, taps, to_rest.inv().apply(acceleration - gravity))

    differentiated = _differentiated(source, pose, instants, turn, name, "its poses")
    return replace(differentiated, notes=(*differentiated.notes, *_gravity_note("poses", gravity) * travels))


def _gravity_note(what: str, gravity: np.ndarray) -> tuple[str]:
    size = float(np.linalg.norm(gravity))
    return (f"the specific force is that of the {what}, with gravity of {size:.6g} m/s²",)


def _of_joints(
    source: MotionChannel, declared: RecordingTable, instants: np.ndarray, name: str, band: float | None
) -> RecordedMotion:
    chain, gravity = Chain.load(declared, source.names, name), declared.urdf_gravity
    for unit, si in (("angular_velocity_unit", "rad/s"), ("acceleration_unit", "m/s²")):
        if getattr(declared, unit) is not None:
            raise RunError(f"{name} holds joint states: remove recording.{unit}, theirs is {si}")
    joints = _joint_states(source, chain, instants, name, by_positions=gravity is not None)
    source, instants, position, velocity = joints.source, joints.instants, joints.position, joints.velocity
    attitude = RecordedAttitude.of(instants, chain.attitude(position))
    notes: tuple[str, ...] = (
        f"the base of the robot rests; {source.topic} moves frame {quoted(declared.urdf_frame)} of {declared.urdf}",
        *chain.notes,
        *joints.notes,
        *([UNJUDGED] if gravity is None else []),
    )
    if velocity is not None:
        white = (f"the noise of the velocities in {source.topic} is white",)
        omega = chain.angular_velocity(position, velocity)
        return RecordedMotion(_channel(source, omega), notes=(*notes, *white), attitude=attitude)

    def turn(uniform: np.ndarray, rate: float) -> Differentiated:
        taps = differentiator(uniform, rate, name, band=band)
        slope, inner = _slope(uniform, taps), uniform[len(taps) : len(uniform) - len(taps)]
        joint_sigma = np.sqrt(np.mean(np.diff(uniform, 4, axis=0) ** 2, axis=0) / 70)
        sigma, force = chain.spread(inner, joint_sigma), None
        if gravity is not None:
            curve, within = _slope(slope, taps), slice(len(taps), len(inner) - len(taps))
            inner, slope = inner[within], slope[within]
            force = chain.motion(inner, slope, curve, gravity).specific_force
        return Differentiated(chain.angular_velocity(inner, slope), sigma, taps, force)

    differentiated = _differentiated(source, position, instants, turn, name, "its joints' positions")
    if gravity is not None:
        notes = (*notes, *_gravity_note("joints' positions", gravity))
    return replace(differentiated, notes=(*notes, *differentiated.notes), attitude=attitude, gravity=gravity)


class _JointStates(NamedTuple):
    """The messages with all joints that are used."""

    source: MotionChannel
    instants: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    """Velocities of the joints; None: the positions tell them."""
    notes: tuple[str, ...]


def _joint_states(
    source: MotionChannel, chain: Chain, instants: np.ndarray, name: str, *, by_positions: bool
) -> _JointStates:
    """The messages with all joints that are used, their angles without jumps; by_positions: velocities are not used."""
    position, velocity = np.asarray(source.position), np.asarray(source.velocity)
    for what, values in (("position", position), ("velocity", velocity)):
        if values.shape[1] not in ((0, len(source.names)) if what == "velocity" else (len(source.names),)):
            raise RunError(f"{what} of {name} has {values.shape[1]} values for {len(source.names)} joints")
    columns = list(chain.columns)
    complete, position = _complete(position, columns, instants, name)
    measured = np.zeros(len(velocity), bool)
    if velocity.shape[1] and not by_positions:
        measured = complete & np.isfinite(velocity[:, columns]).all(axis=1)
    measures = measured.sum() > 1 and velocity[measured][:, columns].any()  # a driver may write zeros
    used = measured if measures else complete
    chain.check_limits(position[used], name)
    angles, notes = chain.unwrapped(position[used])
    angles = np.nan_to_num(angles, nan=0.0)  # of joints that are not used, which other messages name
    if measures:
        chain.check_velocities((instants[used] - instants[used][0]) / NANOSECONDS, angles, velocity[used], name)
    if not used.all():
        left_out = int((~used).sum())
        notes = (*notes, f"{counted(left_out, 'message')} of {source.topic} without all its joints left out")
    return _JointStates(source.taken(used), instants[used], angles, velocity[used] if measures else None, notes)


def _complete(
    position: np.ndarray, columns: list[int], instants: np.ndarray, name: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return which messages hold all joints that are used, and positions; those of several publishers are interpolated.

    Raises:
        RunError: fewer than two messages hold a joint.
    """
    held = np.isfinite(position)
    for k in columns:
        if held[:, k].sum() < 2:
            raise RunError(f"a joint's position of {name} is a number in fewer than two messages: record it")
    if held[:, columns].all(axis=1).sum() >= 2:
        return held[:, columns].all(axis=1), position
    # Each publisher names other joints: at the instants of the first joint's, within all others'.
    first, position, t = held[:, columns[0]], position.copy(), (instants - instants[0]) / NANOSECONDS
    for k in columns:
        own = t[held[:, k]]
        first = first & (t >= own[0]) & (t <= own[-1]) & ~in_gap(own, t, 0.0)
        position[:, k] = np.interp(t, own, np.unwrap(position[held[:, k], k]))
    return first, position


def _slope(uniform: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """The derivative of uniform samples, without as many at either end as there are taps."""
    kernel = np.concatenate([-taps[::-1], [0.0], taps])
    return np.stack([np.convolve(column, kernel[::-1], "valid") for column in uniform.T], axis=1)


Turn = Callable[[np.ndarray, float], Differentiated]


def _differentiated(
    source: MotionChannel, values: np.ndarray, instants: np.ndarray, turn: Turn, name: str, what: str
) -> RecordedMotion:
    """The rate of change of uniform samples; instants near a gap are left out."""
    start, fresh = int(instants[0]), ~repeats(values)[0]
    instants, values, stamp = instants[fresh], values[fresh], source.stamp[fresh]
    t, uniform, missing = _uniform((instants - start) / NANOSECONDS, values, name)
    rate = (len(t) - 1) / float(t[-1] - t[0])
    told = turn(uniform, rate)
    half = (len(t) - len(told.omega)) // 2
    near = np.convolve(missing, np.ones(2 * half + 1), "same") > 0.5
    inner = slice(half, len(t) - half)
    clear = ~near[inner]
    if clear.sum() < 2:
        raise RunError(f"fewer than two samples of {name} outside its gaps: record without gaps")
    grid = (start + np.round(t[inner][clear] * NANOSECONDS)).astype(np.int64)
    stamped = bool((instants == stamp).all())
    omega, window = told.omega[clear], (2 * len(told.taps) + 1) / rate
    force = np.zeros_like(omega) if told.specific_force is None else told.specific_force[clear]
    imu = ImuChannel(
        topic=source.topic, frame_id=source.frame_id, log_time=grid, stamp=grid if stamped else np.zeros_like(grid),
        angular_velocity=omega, linear_acceleration=force,
    )  # fmt: skip
    note = f"the angular velocity is that of {source.topic}, by a fit over {window:.3g} s of {what}"
    return RecordedMotion(imu, ShapedNoise(told.sigma, told.taps, rate), (f"{note}, whose noise is white",))


def _uniform(t: np.ndarray, values: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Uniform instants [s], the values there, and which of the instants lie in a gap."""
    if len(t) < 2 or not (np.diff(t) > 0).all():
        raise RunError(f"time of {name} does not increase: use the other clock (recording.time)")
    if is_uniform(t):
        return t, values, np.zeros(len(t), bool)
    step = interval(t)
    at = t[0] + step * np.arange(int((t[-1] - t[0]) / step * (1 + 1e-9)) + 1)
    return at, interpolate(t, values, at), in_gap(t, at, 0.0)


def _channel(source: MotionChannel, omega: np.ndarray) -> ImuChannel:
    return ImuChannel(
        topic=source.topic, frame_id=source.frame_id, log_time=source.log_time, stamp=source.stamp,
        angular_velocity=omega, linear_acceleration=np.zeros_like(omega),
    )  # fmt: skip
