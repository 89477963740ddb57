"""What constant errors do to the signals: linear maps of functions of time, smooth in the errors.

The true wrench is linear in eighteen functions of the motion: the products of omega, alpha, and the components in B of
frame A's axes. Gravity, platform, body and air errors change its coefficients; the load cell's misalignment, cross-talk
and scale factors mix its channels; drift adds time itself. So an experiment's errors are one matrix for the wrench, and
for the gyro one matrix, a slope and an offset. :mod:`uq.trials.trial` applies them to sums, :mod:`uq.trials.samplewise`
to samples.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from identify.estimators.gram import shift_omega
from identify.motion.trajectory import Motion
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import wrench
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import (
    ALPHA,
    FIRST_MOMENT_OF_FEATURES,
    OMEGA_R_OF_FEATURES,
    PAIRS,
    Array,
    cross_matrix,
    features,
    library_of,
)
from identify.rigid_body.rotation import exponential
from uq.sources.constant_errors import Errors, no_errors, perturbed
from uq.sources.source import Source

OF_MOTION = slice(4, 13)
"""Where the first nine of the functions of time in which the true wrench is linear stand among the features."""
OF_THE_RIG = frozenset({"gravity", "r_cg_from_omb", "tilt", "displaced_air", "entrained_air"})
"""Errors that change the true wrench."""
OF_THE_GYRO = frozenset({"gyro_misalignment", "gyro_scale", "gyro_drift"})
"""Errors that map the angular velocity, beyond an offset."""


class Platform(Pytree):
    """What carries the body."""

    gravity: Float[Array | np.ndarray, ""]
    """Stated local gravity [m/s²]."""
    r_cg_from_still: Float[Array | np.ndarray, "3"]
    """Believed centre of gravity from the point that keeps still, in B [m]."""


class Columns(Pytree):
    """The functions of time, besides the true wrench, that make up the measured wrench: those that the sources need."""

    time: bool = static_field()
    motion: bool = static_field()

    @classmethod
    def of(cls, sources: Sequence[Source]) -> "Columns":
        """Return the functions that these sources need."""
        names = perturbed(sources)
        return cls("cell_drift" in names, bool(names & OF_THE_RIG))

    def sampled(self, body: Body, motion: Motion, begin: Array | float | None = None) -> Float[Array, "columns n"]:
        """Return the true wrench (force, moment) at each sample, then the other functions.

        Args:
            body: that is moved.
            motion: its samples.
            begin: when the run began [s], from which time counts; None: with the first of these samples.
        """
        true = wrench(body, motion.omega, motion.alpha, motion.specific_force_cg)
        time = [(motion.t - (motion.t[0] if begin is None else begin))[None]] if self.time else []
        xp = motion.omega.__array_namespace__()
        return xp.concat([*true, *time, *([functions_of(motion)] if self.motion else [])])

    def map(self, body: Body, platform: Platform, errors: Errors) -> Float[Array, "6 columns"]:
        """Return the matrix that gives the measured wrench, without offset and noise, from the columns."""
        sensed = cell_map(errors)
        maps = [sensed, *([errors.cell_drift[:, None]] if self.time else [])]
        if self.motion:
            change = true_wrench_map(body, platform, errors) - true_wrench_map(body, platform, no_errors())
            maps.append(sensed @ change)
        return library_of(*maps).concat(maps, axis=1)


def functions_of(motion: Motion) -> Float[Array, "18 n"]:
    """Return the products of omega (11, 22, 33, 12, 13, 23), alpha, and frame A's axes in B, at each sample."""
    products = features(motion.omega, motion.alpha)[4:]
    xp = products.__array_namespace__()
    return xp.concat([products, *(motion.rotation[:, k, :].T for k in range(3))])


def true_wrench_map(body: Body, platform: Platform, errors: Errors) -> Float[Array, "6 18"]:
    """Return the matrix that gives the true wrench from the functions of the motion.

    The wrench on the body at Q of (4) and (5) with errors of gravity, platform, centre of gravity and air. The load
    cell carries less by the weight of the displaced air, at that air's centre. Entrained air adds inertia but no
    weight: the air around it carries that.
    """
    xp = library_of(*errors, *body, platform.gravity, platform.r_cg_from_still)
    displaced, of_displaced = errors.displaced_air[0], errors.displaced_air[1:4]
    entrained, of_entrained = errors.entrained_air[0], errors.entrained_air[1:4]
    acceleration_cg = _acceleration(platform.r_cg_from_still + errors.r_cg_from_omb)
    level = exponential(errors.tilt)[2]
    axes = (level[None, :, None] * np.eye(3)[:, None]).reshape(3, 9)
    up = xp.concat([np.zeros((3, 9)), (platform.gravity + errors.gravity) * axes], axis=1)
    force = (body.mass + entrained) * acceleration_cg + _acceleration(of_entrained) + (body.mass - displaced) * up
    spun = xp.tensordot(OMEGA_R_OF_FEATURES[OF_MOTION], body.inertia + errors.entrained_air[4:], axes=1).T
    about_cg = xp.concat([spun, np.zeros((3, 9))], axis=1)
    about_cg = about_cg + cross_matrix(of_entrained) @ acceleration_cg - cross_matrix(of_displaced) @ up
    return xp.concat([force, about_cg + cross_matrix(body.r_cg_from_q) @ force])


def _acceleration(offset: Float[Array, "3"]) -> Float[Array, "3 18"]:
    """``alpha × ρ + omega × (omega × ρ)`` from the functions of the motion."""
    xp = library_of(offset)
    of_motion = xp.tensordot(FIRST_MOMENT_OF_FEATURES[OF_MOTION], offset, axes=1).T
    return xp.concat([of_motion, np.zeros((3, 9))], axis=1)


def cell_map(errors: Errors) -> Float[Array, "6 6"]:
    """Return the map from the true wrench to the measured one: sensor axes, cross-talk, then scale factors."""
    crossed = (np.eye(6) + errors.cell_cross_talk).reshape(6, 2, 3)
    return (1 + errors.cell_scale)[:, None] * (crossed @ exponential(errors.cell_misalignment).T).reshape(6, 6)


def gyro_map(errors: Errors) -> Float[Array, "3 3"]:
    """Return the map from the true angular velocity to the measured one: sensor axes, then scale factors."""
    return (1 + errors.gyro_scale)[:, None] * exponential(errors.gyro_misalignment).T


ROWS, COLUMNS = np.eye(3)[[0, 1, 2, 0, 0, 1]], np.eye(3)[[0, 1, 2, 1, 2, 2]]
"""Select the first and the second axis of the products of two: a product with these is traced faster than indices."""
TWICE = np.array([[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]])
"""One for those of two different axes, which stand there twice."""


def element_map(errors: Errors, *, gyro_mapped: bool) -> Float[Array, "13 elements"]:
    """Return the matrix that gives the features of the measured omega and alpha from the elements of the sums.

    The measured angular velocity is ``G omega + b + d t + noise``. Without ``gyro_mapped``, G is the unit
    matrix and d zero, and the elements are the thirteen features of ``omega + noise``; else those of
    :func:`map_of_true_elements`, then the noise, omega_i noise_j, t noise, the noise's products, and its derivative.
    """
    if not gyro_mapped:
        return shift_omega(errors.gyro_bias)
    g = gyro_map(errors)
    crossed = (ROWS @ g)[:, :, None] * COLUMNS[:, None] + (COLUMNS @ g)[:, :, None] * ROWS[:, None]
    offset, drift = (_both(each[:, None], np.eye(3)) for each in (errors.gyro_bias, errors.gyro_drift))
    products = jnp.concatenate([offset, crossed.reshape(6, 9), drift, jnp.eye(6), jnp.zeros((6, 3))], axis=1)
    of_noise = jnp.concatenate([np.eye(4, 24, -1), products, np.eye(3, 24, 21)])
    return jnp.concatenate([map_of_true_elements(errors), of_noise], axis=1)


def map_of_true_elements(errors: Errors) -> Float[Array, "13 18"]:
    """Return the matrix that gives the features of ``G omega + b + d t`` from the elements of the true motion.

    These are 1, omega, its products, t, t omega, t², alpha.
    """
    g, b, d = gyro_map(errors), errors.gyro_bias[:, None], errors.gyro_drift[:, None]
    upper, lower = ROWS @ g, COLUMNS @ g
    squares = (upper @ ROWS.T) * (lower @ COLUMNS.T) + TWICE * (upper @ COLUMNS.T) * (lower @ ROWS.T)
    products = [_both(b, b) / 2, _both(b, g), squares, _both(b, d), _both(d, g), _both(d, d) / 2, np.zeros((6, 3))]
    none, concat = np.zeros((3, 9)), library_of(g, b, d).concat
    return concat(
        [
            np.eye(1, 18),
            concat([b, g, none[:, :6], d, none[:, :7]], axis=1),
            concat(products, axis=1),
            concat([d, none, none[:, :5], g], axis=1),
        ]
    )


def _both(left: Float[Array, "3 1"], right: Float[Array, "3 k"]) -> Float[Array, "6 k"]:
    """Packed ``left rightᵀ + right leftᵀ`` for each column of the right one."""
    return (ROWS @ left) * (COLUMNS @ right) + (ROWS @ right) * (COLUMNS @ left)


def true_elements(
    omega: Float[Array, "3 n"], alpha: Float[Array, "3 n"], t: Float[Array, " n"]
) -> Float[Array, "15 n"]:
    """Return the true elements that all estimators share: all but alpha."""
    shared = features(omega, alpha)[: ALPHA.start]
    return shared.__array_namespace__().concat([shared, t[None], t[None] * omega, (t * t)[None]])


def noisy_elements(
    omega: Float[Array, "3 n"], t: Float[Array, " n"], noise: Float[Array, "3 n"]
) -> Float[Array, "21 n"]:
    """Return the noisy elements that all estimators share: all but the noise's derivative."""
    crossed = (omega[:, None] * noise[None]).reshape(9, -1)
    return jnp.concatenate([noise, crossed, t[None] * noise, features(noise, noise)[4 : ALPHA.start]])


def changes_of_elements(
    true: Float[Array, "k n"], noise: Float[Array, "3 n"], *, gyro_mapped: bool
) -> list[Float[Array, "j n"]]:
    """Return what noise in omega adds to the elements that all estimators share, group by group.

    Without ``gyro_mapped``, to omega and to its products; else the noisy elements.

    Args:
        true: elements without noise, first those that all estimators share.
        noise: of omega [rad/s].
        gyro_mapped: as for :func:`element_map`.
    """
    omega = true[1:4]
    if gyro_mapped:
        return [noisy_elements(omega, true[ALPHA.start], noise)]
    first, second = np.array(PAIRS).T[:, :, None]
    added = _axes(omega, first) * _axes(noise, second) + _axes(noise, first) * _axes(omega + noise, second)
    return [noise, added]


def _axes(x: Float[Array, "3 n"], axis: Int[np.ndarray, "6 1"]) -> Float[Array, "6 n"]:
    """Rows of x by a choice, which XLA joins with what it is used for; by an index it would not on a CPU."""
    return jnp.where(axis == 0, x[:1], jnp.where(axis == 1, x[1:2], x[2:]))
