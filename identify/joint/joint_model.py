"""The joint model: the signals of load cell and IMU as a function of all unknowns.

Rows are (4) and (5) at the load cell's instants, with the motion of the IMU taken ``delay`` later and turned into the
load cell's frame. The specific force f at the centre of gravity comes from one of three:

- ``still``: the centre of gravity is at rest, f is opposite to gravity, whose direction follows from the gyro;
- ``accelerometer``: f is what the accelerometer reads, carried to the centre of gravity;
- ``none``: f is not measured; (5) alone counts, with the measured force in it.

Beside the body and the alignment there are the sensors' constant errors. All are zero unless a prior leaves them free.
"""

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.attitude import magnus_turn
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import acceleration_at, moment_about_cg
from identify.rigid_body.regressor import cross_matrix
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import InBand, cell_of, evaluate

SpecificForce = Literal["still", "accelerometer", "none"]
"""Source of the specific force at the centre of gravity."""
WANDER = 3
"""Terms of the slow wander of the attitude that the gyro's white noise causes."""
SIZES = {
    "inertia": 6, "mass": 1, "r_cg": 3, "force_offset": 3, "moment_offset": 3, "gyro_bias": 3, "tilt": 2, "delay": 1,
    "rotation": 3, "accelerometer_bias": 3, "force_drift": 3, "moment_drift": 3, "wander": 3 * WANDER,
    "cg_from_still": 3, "gravity": 1, "gyro_scale": 3, "gyro_drift": 3, "cell_matrix": 36,
}  # fmt: skip
"""The unknowns in their order, and how many numbers each is."""
_ENDS = np.cumsum(list(SIZES.values()))
SLICES = {name: slice(int(end) - size, int(end)) for (name, size), end in zip(SIZES.items(), _ENDS, strict=True)}
"""Slice of each unknown in the vector of all unknowns."""
COUNT = int(_ENDS[-1])


class Unknowns(NamedTuple):
    """Everything that a run may leave unknown, SI units."""

    inertia: Float[Array, "6"]
    """Packed tensor about the centre of gravity, in B [kg·m²]."""
    mass: Float[Array, "1"]
    """Mass of the body [kg]."""
    r_cg: Float[Array, "3"]
    """Centre of gravity from Q, in B [m]."""
    force_offset: Float[Array, "3"]
    """Constant that the load cell adds to the force [N]."""
    moment_offset: Float[Array, "3"]
    """Constant that the load cell adds to the moment about Q [N·m]."""
    gyro_bias: Float[Array, "3"]
    """Constant that the gyro adds to the angular velocity, in the gyro's axes [rad/s]."""
    tilt: Float[Array, "2"]
    """Rotation of the vertical at the first node, about two axes at right angles to it [rad]."""
    delay: Float[Array, "1"]
    """Delay of the IMU: time from the measurement of a sample to its stamp [s]."""
    rotation: Float[Array, "3"]
    """Rotation vector of the rotation from the IMU's axes to B [rad]."""
    accelerometer_bias: Float[Array, "3"]
    """Constant that the accelerometer adds to the specific force, in the accelerometer's axes [m/s²]."""
    force_drift: Float[Array, "3"]
    """Change of the force's offset from the run's start to its end [N]."""
    moment_drift: Float[Array, "3"]
    """Change of the moment's offset about Q from the run's start to its end [N·m]."""
    wander: Float[Array, "9"]
    """Amplitudes of the gyro's slow noise, three axes of each term [rad/s^0.5], in the unit of its white noise's
    density."""
    cg_from_still: Float[Array, "3"]
    """The centre of gravity from the point that is at rest, in B [m], where it is declared still."""
    gravity: Float[Array, "1"]
    """Local gravity less what is stated [m/s²]."""
    gyro_scale: Float[Array, "3"]
    """Relative error of the gyro's scale factor on each axis."""
    gyro_drift: Float[Array, "3"]
    """Slope of the gyro's bias, counted from the run's middle, in the gyro's axes [rad/s²]."""
    cell_matrix: Float[Array, "36"]
    """``D`` row by row, the load cell reading ``(1 + D)`` times the wrench (force, moment): scale factors, cross-talk
    and a small misalignment [1, N per N·m, N·m per N]."""


class Model(Pytree):
    """A run's rows and what is needed to predict them."""

    rows: InBand
    up: Float[Array | np.ndarray, "3"]
    """Direction opposite to gravity at the first node, in the IMU's axes, about which ``tilt`` is."""
    gravity: Float[Array | np.ndarray, ""]
    """Local gravity that is stated [m/s²]."""
    imu_position: Float[Array | np.ndarray, "3"]
    """The accelerometer, from Q, in B [m]."""
    specific_force: SpecificForce = static_field()


def unknowns(theta: Float[Array, " count"]) -> Unknowns:
    """Return the unknowns of a flat vector."""
    return Unknowns(*(theta[where] for where in SLICES.values()))


class Kinematics(NamedTuple):
    """The body's motion at the rows' instants, in B."""

    omega: Float[Array, "3 n"]
    """Angular velocity of the body [rad/s]."""
    alpha: Float[Array, "3 n"]
    """Angular acceleration of the body [rad/s²]."""
    specific_force: Float[Array, "3 n"] | None
    """Specific force at the centre of gravity [m/s²]; None: not measured."""


def kinematics(model: Model, x: Unknowns) -> Kinematics:
    """Return the motion that the IMU measures, ``delay`` later and turned into B."""
    rows, turn, at_rows = model.rows, exponential(x.rotation), jnp.asarray(model.rows.t)
    t = at_rows + x.delay[0]
    value, slope, _ = evaluate(rows.motion, rows.step, t)
    scale = (1 + x.gyro_scale)[:, None]
    omega = turn @ ((value[:3] - slow_terms(rows, at_rows, x)) / scale)
    alpha = turn @ ((slope[:3] - x.gyro_drift[:, None]) / scale)
    if model.specific_force == "none":
        return Kinematics(omega, alpha, None)
    if model.specific_force == "still":
        weight = (jnp.asarray(model.gravity) + x.gravity[0]) * (turn @ _vertical(model, x, t))
        return Kinematics(omega, alpha, weight + _carried(omega, alpha, x.cg_from_still))
    at_imu = turn @ (value[3:] - x.accelerometer_bias[:, None])
    return Kinematics(omega, alpha, at_imu + _carried(omega, alpha, x.r_cg - model.imu_position))


def residuals(model: Model, x: Unknowns, motion: Kinematics) -> Float[Array, "rows n"]:
    """Return measured less predicted: force and moment (6 rows), or the moment about the centre of gravity (3).

    [N], [N·m]; zero where a row must not be used.
    """
    rows = model.rows
    along = progress(rows)
    force = jnp.asarray(rows.force) - x.force_offset[:, None] - jnp.outer(x.force_drift, along)
    moment = jnp.asarray(rows.moment) - x.moment_offset[:, None] - jnp.outer(x.moment_drift, along)
    spin = moment_about_cg(x.inertia, motion.omega, motion.alpha)
    error = x.cell_matrix.reshape(6, 6)
    if motion.specific_force is None:
        true = force - error[:3] @ jnp.concatenate([force, moment])
    else:
        true = x.mass[0] * motion.specific_force
    # the error acts on what is predicted: on what is measured it would scale the noise, which the fit then makes small
    wrench = jnp.concatenate([true, spin + levered(x.r_cg, true)])
    misfit = jnp.concatenate([force, moment]) - wrench - error @ wrench
    return jnp.asarray(rows.used)[None] * (misfit[3:] if motion.specific_force is None else misfit)


def levered(arm: Float[Array, "3"], force: Float[Array, "3 n"]) -> Float[Array, "3 n"]:
    """Return ``arm × force``."""
    return cross_matrix(arm) @ force


def progress(rows: InBand) -> Float[Array, " n"]:
    """Return how far the run has come, from -1/2 to 1/2."""
    return jnp.asarray(rows.t) / rows.duration - 0.5


def _carried(omega: Float[Array, "3 n"], alpha: Float[Array, "3 n"], arm: Float[Array, "3"]) -> Float[Array, "3 n"]:
    return jax.vmap(acceleration_at, in_axes=(None, 1, 1), out_axes=1)(arm, omega, alpha)


def slow_basis(rows: InBand, t: Float[Array, " n"]) -> Float[Array, "terms n"]:
    """Return one, time from the middle, and the rates of the Karhunen–Loève terms of a random walk over the run."""
    half_waves = jnp.asarray((np.arange(WANDER) + 0.5) * np.pi / rows.duration, t.dtype)
    walk = float(np.sqrt(2 / rows.duration)) * jnp.cos(jnp.outer(half_waves, t))
    return jnp.concatenate([jnp.ones_like(t)[None], (t - 0.5 * rows.duration)[None], walk])


def slow_terms(rows: InBand, t: Float[Array, " n"], x: Unknowns) -> Float[Array, "3 n"]:
    """Return the gyro's bias, drift and slow noise [rad/s], in its own axes."""
    return jnp.concatenate([x.gyro_bias[None], x.gyro_drift[None], x.wander.reshape(WANDER, 3)]).T @ slow_basis(rows, t)


def _vertical(model: Model, x: Unknowns, t: Float[Array, " n"]) -> Float[Array, "3 n"]:
    """Direction opposite to gravity in the IMU's axes at some instants."""
    rows = model.rows
    start = exponential(_tilt_axes(model.up) @ x.tilt) @ model.up
    cell = cell_of(rows.motion, rows.step, t)
    at_node = jnp.einsum("nij,i->nj", attitude_at_nodes(rows, x)[cell], start)
    turns = _turn(rows, x, cell, t - rows.step * cell.astype(t.dtype))
    return jax.vmap(lambda turn, vector: exponential(-turn) @ vector, out_axes=1)(turns, at_node)


def _tilt_axes(up: Float[Array | np.ndarray, "3"]) -> Float[Array, "3 2"]:
    """Two axes at right angles to a direction: x and y where it is vertical."""
    first = jnp.cross(jnp.where(jnp.abs(up[1]) < 0.9, jnp.array([0.0, 1.0, 0.0]), jnp.array([0.0, 0.0, 1.0])), up)
    first = first / jnp.linalg.norm(first)
    return jnp.stack([first, jnp.cross(up, first)], axis=1)


def attitude_at_nodes(rows: InBand, x: Unknowns) -> Float[Array, "nodes 3 3"]:
    """Return the rotations from the IMU's axes at each node to those at the first."""
    cells = rows.motion.shape[1]
    turns = jax.vmap(exponential)(_turn(rows, x, jnp.arange(cells), jnp.full(cells, rows.step)))
    return jnp.concatenate([jnp.eye(3, dtype=turns.dtype)[None], jax.lax.associative_scan(jnp.matmul, turns)])


def _turn(rows: InBand, x: Unknowns, cell: Array, since: Float[Array, " n"]) -> Float[Array, "n 3"]:
    """Rotation vector from a cell's node on: fourth-order Magnus step on two Gauss points."""

    def omega(fraction: float) -> Array:
        value = jnp.asarray(rows.motion)[0, cell, :3]
        for piece in rows.motion[1:, :, :3]:
            value = value * (fraction * since)[:, None] + piece[cell]
        slow = slow_terms(rows, rows.step * cell.astype(since.dtype) + fraction * since, x).T
        return (value - slow) / (1 + x.gyro_scale)[None]

    first, second = omega(0.5 - np.sqrt(3) / 6), omega(0.5 + np.sqrt(3) / 6)
    return magnus_turn(first, second, since)
