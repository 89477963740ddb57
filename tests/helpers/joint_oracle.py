"""The joint model in JAX, written for its derivatives by ``jax.jacfwd``: the oracle of the closed-form columns.

It shares the rows, their spline's pieces and the order of the unknowns with the packages; its mechanics are its own.
"""

import jax
import jax.numpy as jnp
import numpy as np

from identify.estimation.joint.joint_model import SLICES, WANDER

GAUSS = np.sqrt(3) / 6


def residuals(model, theta):
    """Measured less predicted force and moment about Q of all rows, (n, 6); ``none``: about the centre of gravity, (n, 3)."""
    x = {name: theta[where] for name, where in SLICES.items()}
    rows = model.rows
    t = jnp.asarray(rows.t)
    late = t + x["delay"][0]
    turn, scale = rotation(x["rotation"]), 1 + x["gyro_scale"]
    value, slope = spline(rows, late), jax.vmap(jax.jacfwd(lambda at: spline(rows, at[None])[0]))(late)
    omega = (value[:, :3] - slow(rows, x, t)) / scale @ turn.T
    alpha = (slope[:, :3] - x["gyro_drift"]) / scale @ turn.T
    along = t / rows.duration - 0.5
    force = rows.force.T - x["force_offset"] - along[:, None] * x["force_drift"]
    moment = rows.moment.T - x["moment_offset"] - along[:, None] * x["moment_drift"]
    if model.specific_force == "still":
        specific = (model.gravity + x["gravity"]) * vertical(model, x, late) @ turn.T
        specific = specific + lever(omega, alpha, x["cg_from_still"])
    elif model.specific_force == "accelerometer":
        specific = (value[:, 3:] - x["accelerometer_bias"]) @ turn.T
        specific = specific + lever(omega, alpha, x["r_cg"] - model.imu_position)
    else:
        specific = force / x["mass"]
    tensor = x["inertia"][jnp.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])]
    true = x["mass"] * specific
    spin = alpha @ tensor + jnp.cross(omega, omega @ tensor)
    wrench = jnp.concatenate([true, spin + jnp.cross(x["r_cg"], true)], axis=1)
    misfit = jnp.concatenate([force, moment], axis=1) - wrench @ (jnp.eye(6) + x["cell_matrix"].reshape(6, 6)).T
    return misfit[:, 3:] - jnp.cross(x["r_cg"], misfit[:, :3]) if model.specific_force == "none" else misfit


def lever(omega, alpha, arm):
    return jnp.cross(alpha, arm) + jnp.cross(omega, jnp.cross(omega, arm))


def rotation(vector):
    """Rodrigues' formula; the angle is kept from zero, where its root has no derivative."""
    angle = jnp.sqrt(vector @ vector + 1e-30)
    hat = jnp.cross(vector[None], jnp.eye(3)).T
    return jnp.eye(3) + jnp.sinc(angle / jnp.pi) * hat + jnp.sinc(angle / (2 * jnp.pi)) ** 2 / 2 * hat @ hat


def spline(rows, t):
    """The pieces' polynomials, (n, channels)."""
    cell = jnp.clip(jnp.floor(t / rows.step).astype(int), 0, rows.motion.shape[1] - 1)
    since = (t - rows.step * cell.astype(float))[:, None]
    powers = len(rows.motion) - 1
    return sum(jnp.asarray(piece)[cell] * since ** (powers - k) for k, piece in enumerate(rows.motion))


def slow(rows, x, t):
    """Bias, drift and wander of the gyro [rad/s]."""
    half_waves = (jnp.arange(float(WANDER)) + 0.5) * jnp.pi / rows.duration
    walk = jnp.sqrt(2 / rows.duration) * jnp.cos(t[:, None] * half_waves)
    return x["gyro_bias"] + (t - rows.duration / 2)[:, None] * x["gyro_drift"] + walk @ x["wander"].reshape(WANDER, 3)


def vertical(model, x, late):
    """Upward in the IMU's axes: many small steps of the gyro from the first node, then from each row's node."""
    rows = model.rows
    first = np.cross([0.0, 1.0, 0.0], model.up)
    first = first / np.linalg.norm(first)
    axes = np.stack([first, np.cross(model.up, first)], axis=1)
    start = rotation(axes @ x["tilt"]) @ model.up

    def turn(begin, step):
        rate = [(spline(rows, t[None])[0, :3] - slow(rows, x, t[None])[0]) / (1 + x["gyro_scale"])
                for t in (begin + (0.5 - GAUSS) * step, begin + (0.5 + GAUSS) * step)]  # fmt: skip
        return rotation(step / 2 * (rate[0] + rate[1]) + np.sqrt(3) / 12 * step**2 * jnp.cross(*rate))

    nodes = rows.step * jnp.arange(float(rows.motion.shape[1]))
    advance = lambda attitude, begin: (attitude @ turn(begin, rows.step), attitude)  # noqa: E731
    _, at_nodes = jax.lax.scan(advance, jnp.eye(3), nodes)
    cell = jnp.clip(jnp.floor(late / rows.step).astype(int), 0, len(nodes) - 1)
    attitude = at_nodes[cell] @ jax.vmap(turn)(nodes[cell], late - nodes[cell])
    return jnp.einsum("nij,i->nj", attitude, start)
