"""What load cell and IMU would say of a body, as a function of everything that is not known: the joint model.

Rows are (4) and (5) at the load cell's instants, with the motion of the IMU taken ``delay`` later and turned into the
load cell's frame. The specific force f at the centre of gravity comes from one of three:

- ``still``: the centre of gravity is at rest, f is opposite to gravity, whose direction follows from the gyro;
- ``accelerometer``: f is what the accelerometer reads, carried to the centre of gravity;
- ``none``: f is not known; (5) alone counts, with the measured force in it.
"""

from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.dynamics import acceleration_at
from identify.in_band import InBand, evaluate
from identify.regressor import omega_r
from identify.trajectory import exponential

SpecificForce = Literal["still", "accelerometer", "none"]
"""Where the specific force at the centre of gravity comes from."""
WANDER = 4
"""Terms of the slow wander of the attitude that the gyro's white noise causes."""
SIZES = {
    "inertia": 6, "mass": 1, "r_cg": 3, "force_offset": 3, "moment_offset": 3, "gyro_bias": 3, "tilt": 2, "delay": 1,
    "rotation": 3, "accelerometer_bias": 3, "force_drift": 3, "moment_drift": 3, "wander": 3 * WANDER,
}  # fmt: skip
"""The unknowns in their order, and how many numbers each is."""
_ENDS = np.cumsum(list(SIZES.values()))
SLICES = {name: slice(int(end) - size, int(end)) for (name, size), end in zip(SIZES.items(), _ENDS, strict=True)}
"""Where each stands among all of them."""
COUNT = int(_ENDS[-1])


class Unknowns(NamedTuple):
    """Everything that a run may leave unknown, SI units."""

    inertia: Float[Array, "6"]
    """Packed tensor about the centre of gravity, in B [kg·m²]."""
    mass: Float[Array, "1"]
    """Mass [kg]."""
    r_cg: Float[Array, "3"]
    """Centre of gravity from Q, in B [m]."""
    force_offset: Float[Array, "3"]
    """Constant that the load cell adds to the force [N]."""
    moment_offset: Float[Array, "3"]
    """The same of the moment about Q [N·m]."""
    gyro_bias: Float[Array, "3"]
    """Constant that the gyro adds, in its own axes [rad/s]."""
    tilt: Float[Array, "2"]
    """Rotation of the vertical at the first node, about two axes at right angles to it [rad]."""
    delay: Float[Array, "1"]
    """The IMU's sample is that of so long before its stamp [s]."""
    rotation: Float[Array, "3"]
    """Rotation vector of the rotation from the IMU's axes to B [rad]."""
    accelerometer_bias: Float[Array, "3"]
    """Constant that the accelerometer adds, in its own axes [m/s²]."""
    force_drift: Float[Array, "3"]
    """Change of the force's offset from the run's start to its end [N]."""
    moment_drift: Float[Array, "3"]
    """The same of the moment's [N·m]."""
    wander: Float[Array, "12"]
    """Amplitudes of the gyro's slow noise, three axes of each term [rad/s^0.5]; as its white noise's density."""


class Model(eqx.Module):
    """A run's rows and what is needed to predict them."""

    rows: InBand
    up: Float[Array, "3"]
    """Direction opposite to gravity at the first node, in the IMU's axes, about which ``tilt`` is."""
    gravity: Float[Array, ""]
    """Local gravity [m/s²]."""
    imu_position: Float[Array, "3"]
    """The accelerometer, from Q, in B [m]."""
    specific_force: SpecificForce = eqx.field(static=True)


def unknowns(theta: Float[Array, " count"]) -> Unknowns:
    """Return the unknowns of a flat vector."""
    return Unknowns(*(theta[part] for part in SLICES.values()))


def residuals(model: Model, theta: Float[Array, " count"]) -> Float[Array, "rows n"]:
    """Return measured less predicted: force and moment (6 rows), or the moment about the centre of gravity (3).

    [N], [N·m]; zero where a row must not be used.
    """
    x, rows = unknowns(theta), model.rows
    turn = exponential(x.rotation)
    raw, raw_slope = evaluate(rows.motion, rows.step, rows.t + x.delay[0])
    slow = _slow(rows, x, rows.t)
    omega, alpha = turn @ (raw[:3] - slow), turn @ raw_slope[:3]
    progress = rows.t / rows.duration - 0.5
    force = rows.force - x.force_offset[:, None] - jnp.outer(x.force_drift, progress)
    moment = rows.moment - x.moment_offset[:, None] - jnp.outer(x.moment_drift, progress)
    spin = jax.vmap(lambda w, a: omega_r(w, a) @ x.inertia, in_axes=1, out_axes=1)(omega, alpha)
    if model.specific_force == "none":
        return rows.used * (moment - _levered(x.r_cg, force) - spin)
    if model.specific_force == "still":
        at_cg = model.gravity * (turn @ _vertical(model, x))
    else:
        lever = jax.vmap(acceleration_at, in_axes=(None, 1, 1), out_axes=1)(x.r_cg - model.imu_position, omega, alpha)
        at_cg = turn @ (raw[3:] - x.accelerometer_bias[:, None]) + lever
    predicted = x.mass * at_cg
    return rows.used * jnp.concatenate([force - predicted, moment - spin - _levered(x.r_cg, predicted)])


def _levered(arm: Float[Array, "3"], force: Float[Array, "3 n"]) -> Float[Array, "3 n"]:
    return jnp.cross(arm, force, axisb=0, axisc=0)


def _slow(rows: InBand, x: Unknowns, t: Float[Array, " n"]) -> Float[Array, "3 n"]:
    """The gyro's bias and slow noise: the rate of the Karhunen–Loève terms of a random walk over the run."""
    half_waves = (jnp.arange(WANDER) + 0.5) * jnp.pi / rows.duration
    terms = np.sqrt(2 / rows.duration) * jnp.cos(jnp.outer(half_waves, t))
    return x.gyro_bias[:, None] + x.wander.reshape(WANDER, 3).T @ terms


def _vertical(model: Model, x: Unknowns) -> Float[Array, "3 n"]:
    """Direction opposite to gravity in the IMU's axes, at the rows' instants plus the delay.

    The attitude is integrated without derivatives; those by the gyro's bias and slow noise are ``-∫ P db dt``, put in
    by a turn whose value is zero. So the value is exact, and a derivative costs one sum.
    """
    rows = model.rows
    start = exponential(tilt_axes(model.up) @ x.tilt) @ model.up
    still = jax.lax.stop_gradient(x)
    at_nodes = jax.lax.stop_gradient(attitude_at_nodes(rows, still))
    t = rows.t + x.delay[0]
    cell = jnp.clip(jnp.floor(t / rows.step).astype(int), 0, len(at_nodes) - 1)
    change = _slow(rows, x, rows.t) - _slow(rows, still, rows.t)
    at_rows = jax.lax.slice_in_dim(at_nodes, rows.first, rows.first + (len(rows.t) - 1) * rows.stride + 1, rows.stride)
    turned = _summed(jnp.einsum("nij,jn->ni", at_rows, change), rows)
    seen = jnp.einsum("nij,ni->nj", at_nodes[cell], start[None] + jnp.cross(turned, start[None]))
    since = _turn(rows, still, cell, t - rows.step * cell)
    return jax.vmap(lambda turn, vector: exponential(-turn) @ vector)(since, seen).T


def _summed(rate: Float[Array, "n 3"], rows: InBand) -> Float[Array, "n 3"]:
    """Its integral from the first node to each row, by trapezes."""
    steps = (rate[1:] + rate[:-1]) * (rows.interval / 2)
    before = rows.first * rows.step * rate[:1]
    return jnp.concatenate([before, before + jnp.cumsum(steps, axis=0)])


def tilt_axes(up: Float[Array, "3"]) -> Float[Array, "3 2"]:
    """Return two axes at right angles to a direction: nearest to x and y where it is vertical."""
    first = jnp.cross(jnp.where(jnp.abs(up[1]) < 0.9, jnp.array([0.0, 1.0, 0.0]), jnp.array([0.0, 0.0, 1.0])), up)
    first = first / jnp.linalg.norm(first)
    return jnp.stack([first, jnp.cross(up, first)], axis=1)


def attitude_at_nodes(rows: InBand, x: Unknowns) -> Float[Array, "nodes 3 3"]:
    """Return the rotations from the IMU's axes at each node to those at the first."""
    cells = rows.motion.shape[1]
    turns = jax.vmap(exponential)(_turn(rows, x, jnp.arange(cells), jnp.full(cells, rows.step)))
    return jnp.concatenate([jnp.eye(3, dtype=turns.dtype)[None], jax.lax.associative_scan(jnp.matmul, turns)])


def _turn(rows: InBand, x: Unknowns, cell: Array, since: Float[Array, " n"]) -> Float[Array, "n 3"]:
    """Rotation vector from a cell's node on: fourth-order Magnus step on two Gauss points (10.1017/S0962492900002154)."""

    def omega(fraction: float) -> Array:
        value = rows.motion[0, cell, :3]
        for piece in rows.motion[1:, :, :3]:
            value = value * (fraction * since)[:, None] + piece[cell]
        return value - _slow(rows, x, rows.step * cell + fraction * since).T

    first, second = omega(0.5 - np.sqrt(3) / 6), omega(0.5 + np.sqrt(3) / 6)
    return since[:, None] / 2 * (first + second) + (np.sqrt(3) / 12 * since**2)[:, None] * jnp.cross(first, second)
