"""Derivatives of the joint model's residuals by the unknowns, in closed form: thirty columns for the price of a few.

Autodiff would push every column through the whole chain, the integration of the attitude included; here that one's
derivatives by the gyro's slow errors are sums of the attitude, ``d(start) = ∫ P d(bias) dt × start``.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from identify.joint.joint_model import (
    SLICES,
    WANDER,
    Kinematics,
    Model,
    Unknowns,
    kinematics,
    progress,
    residuals,
    seen_later,
    slow_basis,
    unknowns,
    vertical_at_start,
)
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import cross_matrix, omega_r
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import InBand

Columns = Mapping[str, Float[Array, "n 3 columns"]]
"""Derivatives of a vector at each row, by the name of the unknown."""


def linearised(
    model: Model, theta: Float[Array, " count"]
) -> tuple[Float[Array, "rows n"], Float[Array, "n rows count"]]:
    """Return the residuals and their derivatives by the unknowns."""
    x = unknowns(theta)
    motion = kinematics(model, x)
    omega, alpha, force = _of_motion(model, x, motion)
    tensor, arm = unpack(x.inertia), cross_matrix(x.r_cg)
    gyroscopic = _hat(motion.omega) @ tensor - _hat(tensor @ motion.omega)
    moments: dict[str, Array] = {name: gyroscopic @ omega[name] + tensor @ alpha[name] for name in omega}
    moments["inertia"] = jax.vmap(omega_r, in_axes=1)(motion.omega, motion.alpha)
    along = progress(model.rows)[:, None, None]
    one = jnp.broadcast_to(jnp.eye(3), (len(along), 3, 3))
    moments |= {"moment_offset": one, "moment_drift": along * one}
    if motion.specific_force is None:
        lever = {"force_offset": -arm @ one, "force_drift": -along * (arm @ one)}
        rest = model.rows.force - x.force_offset[:, None] - jnp.outer(x.force_drift, along[:, 0, 0])
        moments |= lever | {"r_cg": -_hat(rest)}
        jacobian = -_assembled(moments, len(theta))
    else:
        forces: dict[str, Array] = {name: x.mass[0] * columns for name, columns in force.items()}
        forces["mass"] = motion.specific_force.T[:, :, None]
        moments = _added(moments, {name: arm @ columns for name, columns in forces.items()})
        moments = _added(moments, {"r_cg": -_hat(x.mass[0] * motion.specific_force)})
        forces |= {"force_offset": one, "force_drift": along * one}
        jacobian = -jnp.concatenate([_assembled(forces, len(theta)), _assembled(moments, len(theta))], axis=1)
    return residuals(model, x, motion), model.rows.used[:, None, None] * jacobian


def _of_motion(model: Model, x: Unknowns, motion: Kinematics) -> tuple[Columns, Columns, Columns]:
    """Derivatives of angular velocity, angular acceleration and specific force."""
    rows, turn = model.rows, exponential(x.rotation)
    of_turn = jax.jacfwd(exponential)(x.rotation)
    parts = [slice(0, 3), slice(3, 6), slice(6, 9)]
    turned = [jnp.einsum("ijp,jn->nip", of_turn, motion.own[part]) for part in parts]
    later = [(turn @ motion.rates[part]).T[:, :, None] for part in parts]
    omega, alpha, force = ({"rotation": a, "delay": b} for a, b in zip(turned, later, strict=True))
    basis = slow_basis(rows, rows.t)
    by_slow = -jnp.einsum("ij,kn->nikj", turn, basis)
    omega |= _named(by_slow)
    alpha |= {name: jnp.zeros_like(columns) for name, columns in _named(by_slow).items()}
    if model.specific_force == "still":
        force |= {name: model.gravity * (turn @ columns) for name, columns in _of_vertical(model, x, motion).items()}
    elif model.specific_force == "accelerometer":
        force = _added(force, _of_lever(x.r_cg - model.imu_position, motion, omega, alpha))
        force["accelerometer_bias"] = jnp.broadcast_to(-turn, (len(rows.t), 3, 3))
    return omega, alpha, force


def _of_lever(arm: Array, motion: Kinematics, omega: Columns, alpha: Columns) -> Columns:
    """Derivatives of ``alpha × ρ + omega × (omega × ρ)``."""
    spin = _hat(motion.omega)
    centrifugal = -(_hat(jnp.cross(motion.omega, arm[:, None], axis=0)) + spin @ cross_matrix(arm))
    found = {name: centrifugal @ omega[name] - cross_matrix(arm) @ alpha[name] for name in omega}
    return found | {"r_cg": _hat(motion.alpha) + spin @ spin}


def _of_vertical(model: Model, x: Unknowns, motion: Kinematics) -> Columns:
    """Derivatives of the direction opposite to gravity, in the IMU's axes, by tilt, bias and slow noise."""
    rows, attitude = model.rows, motion.attitude
    assert attitude is not None  # noqa: S101 - it is integrated where the vertical is asked for
    start = vertical_at_start(model, x.tilt)
    by_tilt = jax.jacfwd(lambda tilt: vertical_at_start(model, tilt))(x.tilt)
    basis = slow_basis(rows, rows.t)
    at_rows = attitude[rows.at_rows]
    turning = at_rows @ _hat(motion.own[:3])  # the attitude's derivative by time
    rate, slope = (jnp.einsum("nij,kn->nikj", one, basis).reshape(len(rows.t), 3, -1) for one in (at_rows, turning))
    by_slow = -cross_matrix(start) @ (_summed(rate, slope, rows) + x.delay[0] * rate)
    both = jnp.concatenate([jnp.broadcast_to(by_tilt, (len(rows.t), 3, 2)), by_slow], axis=2)
    later = jax.vmap(lambda columns: seen_later(rows, x, attitude, rows.t + x.delay[0], columns), in_axes=2, out_axes=2)
    seen = later(both)
    return {"tilt": seen[:, :, :2]} | _named(seen[:, :, 2:].reshape(len(rows.t), 3, 1 + WANDER, 3))


def _named(slow: Float[Array, "n 3 terms 3"]) -> dict[str, Array]:
    return {"gyro_bias": slow[:, :, 0], "wander": slow[:, :, 1:].reshape(len(slow), 3, -1)}


def _summed(
    rate: Float[Array, "n 3 columns"], slope: Float[Array, "n 3 columns"], rows: InBand
) -> Float[Array, "n 3 columns"]:
    """Its integral from the first node to each row, by trapezes with their end correction ``h²/12 (f'₀ - f'₁)``."""
    h = rows.interval
    steps = (rate[1:] + rate[:-1]) * (h / 2) - (slope[1:] - slope[:-1]) * (h**2 / 12)
    before = rows.first * rows.step * rate[:1]
    return jnp.concatenate([before, before + jnp.cumsum(steps, axis=0)])


def _hat(vectors: Float[Array, "3 n"]) -> Float[Array, "n 3 3"]:
    return jax.vmap(cross_matrix, in_axes=1)(vectors)


def _added(one: Columns, other: Columns) -> dict[str, Array]:
    return {**one, **{name: one[name] + columns if name in one else columns for name, columns in other.items()}}


def _assembled(columns: Columns, count: int) -> Float[Array, "n 3 count"]:
    """Columns in the unknowns' order, zero where nothing acts."""
    n = len(next(iter(columns.values())))
    parts = [columns.get(name, jnp.zeros((n, 3, part.stop - part.start))) for name, part in SLICES.items()]
    return jnp.concatenate(parts, axis=2)
