"""A run's motion as the IMU measures it, in B, for one value of the joint model's unknowns."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from identify.errors.imu.tilt import tilt_axes
from identify.estimation.joint.joint_model import WANDER, Model
from identify.motion.attitude import GAUSS, magnus_turn
from identify.rigid_body.regressor import cross_matrices
from identify.rigid_body.rotation import (
    closest_rotation,
    cumulative_product,
    exponential,
    rate_of_turn,
    rotation_vectors,
)


@dataclass(frozen=True, eq=False)
class MotionSignals:
    """Signals of the rows that count, samples first, SI units; ``delay`` later than the rows, and turned into B."""

    model: Model
    x: Mapping[str, np.ndarray]
    """The unknowns by name."""

    @cached_property
    def t(self) -> Float[np.ndarray, " n"]:
        """Instants from the first node [s]."""
        return np.asarray(self.model.rows.t[self.model.used])

    @cached_property
    def late(self) -> Float[np.ndarray, " n"]:
        """Instants of the IMU that belong to the rows [s]."""
        return self.t + self.x["delay"][0]

    @cached_property
    def progress(self) -> Float[np.ndarray, " n"]:
        """Progress of the run, from -1/2 to 1/2."""
        return self.t / self.model.rows.duration - 0.5

    @cached_property
    def force(self) -> Float[np.ndarray, "n 3"]:
        """Measured force on the body [N]."""
        return self.model.rows.force[:, self.model.used].T

    @cached_property
    def moment(self) -> Float[np.ndarray, "n 3"]:
        """Measured moment about Q [N·m]."""
        return self.model.rows.moment[:, self.model.used].T

    @property
    def zero_axes(self) -> Float[np.ndarray, "n 3 3"] | None:
        """Rotations from B to the axes along which the load cell's zero is constant; None: B's."""
        axes = self.model.rows.zero_axes
        return None if axes is None else axes[self.model.used]

    @cached_property
    def turn(self) -> Float[np.ndarray, "3 3"]:
        """Rotation from the IMU's axes to B."""
        return exponential(self.x["rotation"])

    @cached_property
    def turned_by_rotation(self) -> Float[np.ndarray, "3 3"]:
        """Small rotations in B by a change of each number of the rotation vector: its left Jacobian."""
        return np.stack([rate_of_turn(-self.x["rotation"], unit) for unit in np.eye(3)], axis=1)

    @cached_property
    def slow(self) -> Float[np.ndarray, "terms 3"]:
        """The gyro's bias [rad/s], drift [rad/s²] and wander [rad/s^0.5]: factors of :func:`slow_basis`."""
        return np.vstack([self.x["gyro_bias"], self.x["gyro_drift"], self.x["wander"].reshape(WANDER, 3)])

    def slow_basis(self, t: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k terms"]:
        """Return one, time from the middle, and the rates of the Karhunen–Loève terms of a random walk over the run."""
        duration = self.model.rows.duration
        # a Wiener process over T is Σ ξ_k √(2/T) sin(κ_k t)/κ_k, κ_k = (k + ½) π/T, of independent ξ_k; its first terms
        # hold most of it
        half_waves = (np.arange(WANDER) + 0.5) * np.pi / duration
        walk = np.sqrt(2 / duration) * np.cos(np.outer(t, half_waves))
        return np.column_stack([np.ones(len(t)), t - duration / 2, walk])

    @cached_property
    def _values(self) -> tuple[np.ndarray, ...]:
        """The IMU's signals at the rows, ``delay`` later, and their first two derivatives."""
        return self.model.late(float(self.x["delay"][0]))

    @cached_property
    def scale(self) -> Float[np.ndarray, "3"]:
        """The gyro's scale factors."""
        return 1 + self.x["gyro_scale"]

    @cached_property
    def imu_rate(self) -> Float[np.ndarray, "n 3"]:
        """Angular velocity in the IMU's axes, the gyro's errors removed [rad/s]."""
        return (self._values[0][:, :3] - self.slow_basis(self.t) @ self.slow) / self.scale

    @cached_property
    def omega(self) -> Float[np.ndarray, "n 3"]:
        """Angular velocity of the body [rad/s]."""
        return self.imu_rate @ self.turn.T

    @cached_property
    def imu_acceleration(self) -> Float[np.ndarray, "n 3"]:
        """Angular acceleration in the IMU's axes, the gyro's drift removed [rad/s²]."""
        return (self._values[1][:, :3] - self.x["gyro_drift"]) / self.scale

    @cached_property
    def alpha(self) -> Float[np.ndarray, "n 3"]:
        """Angular acceleration of the body [rad/s²]."""
        return self.imu_acceleration @ self.turn.T

    @cached_property
    def rate_slope(self) -> Float[np.ndarray, "n 3"]:
        """Derivative of ``omega`` by the delay [rad/s²]: slow errors stay where they are."""
        return (self._values[1][:, :3] / self.scale) @ self.turn.T

    @cached_property
    def jerk(self) -> Float[np.ndarray, "n 3"]:
        """Derivative of alpha [rad/s³]."""
        return (self._values[2][:, :3] / self.scale) @ self.turn.T

    @cached_property
    def accelerometer(self) -> Float[np.ndarray, "n 3"]:
        """Specific force at the IMU, the accelerometer's bias removed [m/s²]."""
        return (self._values[0][:, 3:] - self.x["accelerometer_bias"]) @ self.turn.T

    @cached_property
    def accelerometer_slope(self) -> Float[np.ndarray, "n 3"]:
        """Derivative of ``accelerometer`` by time [m/s³]."""
        return self._values[1][:, 3:] @ self.turn.T

    @cached_property
    def spin(self) -> Float[np.ndarray, "n 3 3"]:
        """``omega ×``, as matrices."""
        return cross_matrices(self.omega)

    @cached_property
    def levers(self) -> Float[np.ndarray, "n 3 3"]:
        """``alpha × + omega × (omega ×``, as matrices: the acceleration by a lever arm in B."""
        return cross_matrices(self.alpha) + self.spin @ self.spin

    @cached_property
    def nodes(self) -> Float[np.ndarray, " nodes"]:
        """Instants of the nodes [s]."""
        return self.model.rows.step * np.arange(self.model.rows.motion.shape[1] + 1)

    def rate_at(
        self, t: Float[np.ndarray, " k"], signals: Float[np.ndarray, "k channels"] | None = None
    ) -> Float[np.ndarray, "k 3"]:
        """Return the angular velocity in the IMU's axes at instants of the IMU [rad/s]; its signals may be known."""
        measured = self.model.spline(t) if signals is None else signals
        return np.asarray((measured[:, :3] - self.slow_basis(t) @ self.slow) / self.scale)

    @cached_property
    def rate_at_nodes(self) -> Float[np.ndarray, "nodes 3"]:
        """Angular velocity in the IMU's axes at the nodes [rad/s]."""
        return self.rate_at(self.nodes, self.model.at_nodes)

    def _turns(
        self,
        start: Float[np.ndarray, " k"],
        step: Float[np.ndarray, " k"],
        signals: tuple[np.ndarray | None, np.ndarray | None],
    ) -> Float[np.ndarray, "k 3 3"]:
        """Rotations over some steps: fourth-order Magnus steps on two Gauss points each."""
        points = zip((-1, 1), signals, strict=True)
        first, second = (self.rate_at(start + (0.5 + sign * GAUSS) * step, known) for sign, known in points)
        return exponential(magnus_turn(first, second, step))

    @cached_property
    def attitude_at_nodes(self) -> Float[np.ndarray, "nodes 3 3"]:
        """Rotations from the IMU's axes at each node to those at the first."""
        step = np.diff(self.nodes)
        turns = self._turns(self.nodes[:-1], step, self.model.between_nodes)
        return cumulative_product(np.concatenate([np.eye(3)[None], turns]))

    @cached_property
    def interval(self) -> Int[np.ndarray, " n"]:
        """Index of the interval between nodes in which each row lies, ``delay`` later."""
        return np.clip(np.floor(self.late / self.model.rows.step).astype(int), 0, len(self.nodes) - 2)

    @cached_property
    def since(self) -> Float[np.ndarray, " n"]:
        """Time from the start of that interval [s]."""
        return np.asarray(self.late - self.nodes[self.interval])

    @cached_property
    def attitude(self) -> Float[np.ndarray, "n 3 3"]:
        """Rotations from the IMU's axes at each row to those at the first node."""
        at_nodes = self.attitude_at_nodes[self.interval]
        if not self.since.any():
            return at_nodes
        return at_nodes @ self._turns(self.nodes[self.interval], self.since, (None, None))

    @cached_property
    def turning(self) -> Float[np.ndarray, "n 3"]:
        """Rotation vector from the mean attitude, in B [rad]."""
        mean = closest_rotation(self.attitude.mean(axis=0))
        return rotation_vectors(mean.T @ self.attitude) @ self.turn.T

    @cached_property
    def _tilt_axes(self) -> Float[np.ndarray, "3 2"]:
        return tilt_axes(self.model.up)

    @cached_property
    def up_at_start(self) -> Float[np.ndarray, "3"]:
        """Upward direction in the IMU's axes at the first node."""
        return np.asarray(exponential(self._tilt_axes @ self.x["tilt"]) @ self.model.up)

    @cached_property
    def up(self) -> Float[np.ndarray, "n 3"]:
        """Upward direction in B at each row."""
        return np.asarray((self.up_at_start @ self.attitude) @ self.turn.T)

    def up_by_tilt(self) -> Float[np.ndarray, "n 3 2"]:
        """Return the derivative of ``up`` by the tilt."""
        vector = self._tilt_axes @ self.x["tilt"]
        turned = np.stack([rate_of_turn(-vector, axis) for axis in self._tilt_axes.T])
        return self.turn @ self.attitude.swapaxes(1, 2) @ np.cross(turned, self.up_at_start).T

    def up_by_rate(self, rate: Float[np.ndarray, "nodes 3 p"]) -> Float[np.ndarray, "n 3 p"]:
        """Return the change of ``up`` by changes of the angular velocity, at the nodes and in the IMU's axes.

        They turn the attitude by the integral of ``attitude @ rate``: by cubics through four nodes, and within the
        intervals by those through both ends and slopes.
        """
        slope = self.attitude_at_nodes @ rate
        step = self.model.rows.step
        outer = np.concatenate([2 * slope[:1] - slope[1:2], slope, 2 * slope[-1:] - slope[-2:-1]])
        # the integral of the cubic through four nodes, h/24 (-1, 13, 13, -1); at the ends through a node that is
        # extrapolated
        increments = step / 24 * (13 * (outer[1:-2] + outer[2:-1]) - outer[:-3] - outer[3:])
        integral = np.concatenate([np.zeros_like(slope[:1]), np.cumsum(increments, axis=0)])
        u = (self.since / step)[:, None, None]
        # Hermite's basis: values and slopes at both ends of an interval
        weights = (2 * u**3 - 3 * u**2 + 1, 3 * u**2 - 2 * u**3, step * (u**3 - 2 * u**2 + u), step * (u**3 - u**2))
        ends = (integral[self.interval], integral[self.interval + 1], slope[self.interval], slope[self.interval + 1])
        turned = sum(weight * end for weight, end in zip(weights, ends, strict=True))
        in_body = self.turn @ (self.attitude.swapaxes(1, 2) @ turned)
        return np.asarray(cross_matrices(self.up) @ in_body)
