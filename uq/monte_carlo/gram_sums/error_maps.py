"""Constant errors act on the signals as linear maps of functions of time, smooth in the errors.

The true wrench is linear in eighteen functions of the motion: the products of omega, alpha, and the components in B of
frame A's axes. Gravity, platform, body and air errors change its coefficients; the load cell's misalignment, cross-talk
and scale factors mix its channels; drift adds time itself. So an experiment's errors are one matrix for the wrench, and
for the gyro one matrix, a slope and an offset. :mod:`uq.monte_carlo.trials.sums_engine` applies them to sums,
:mod:`uq.monte_carlo.trials.samples_engine` to samples.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.motion.trajectory import Motion
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import wrench
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import (
    ALPHA,
    FIRST_MOMENT_OF_FEATURES,
    OMEGA_R_OF_FEATURES,
    Array,
    cross_matrix,
    features,
    library_of,
)
from identify.rigid_body.rotation import exponential
from uq.sources.constant_errors import Errors, no_errors, perturbed
from uq.sources.source import Source

OF_MOTION = slice(4, 13)
"""Places among the features of the first nine functions of time in which the true wrench is linear."""
OF_THE_RIG = frozenset({"gravity", "r_cg_from_omb", "tilt", "displaced_air", "entrained_air"})
"""Errors that change the true wrench."""


class Platform(Pytree):
    """The platform that carries the body."""

    gravity: Float[Array | np.ndarray, ""]
    """Stated local gravity [m/s²]."""
    r_cg_from_still: Float[Array | np.ndarray, "3"]
    """Believed centre of gravity from the point that keeps still, in B [m]."""


class WrenchBasis(Pytree):
    """The true wrench and other functions of time, of which constant errors make up the measured wrench linearly.

    Those that the sources need: time itself for a drift, and :func:`functions_of` the motion for errors of the rig.
    """

    time: bool = static_field()
    motion: bool = static_field()

    @classmethod
    def for_sources(cls, sources: Sequence[Source]) -> "WrenchBasis":
        """Return the functions that these sources need."""
        names = perturbed(sources)
        return cls("cell_drift" in names, bool(names & OF_THE_RIG))

    def sampled(self, body: Body, motion: Motion, begin: Array | float | None = None) -> Float[Array, "functions n"]:
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

    def map(self, body: Body, platform: Platform, errors: Errors) -> Float[Array, "6 functions"]:
        """Return the matrix that gives the measured wrench, without offset and noise, from the basis."""
        sensed = cell_map(errors)
        maps = [sensed, *([errors.cell_drift[:, None]] if self.time else [])]
        if self.motion:
            # the true wrench is the first function: of the motion's functions there is only what errors of the rig add
            # to it
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
    displaced, displaced_moment = errors.displaced_air[0], errors.displaced_air[1:4]
    entrained, entrained_moment = errors.entrained_air[0], errors.entrained_air[1:4]
    acceleration_cg = _acceleration(platform.r_cg_from_still + errors.r_cg_from_omb)
    # R(tilt)ᵀ e₃: the upward direction in axes that start level
    level = exponential(errors.tilt)[2]
    axes = (level[None, :, None] * np.eye(3)[:, None]).reshape(3, 9)
    up = xp.concat([np.zeros((3, 9)), (platform.gravity + errors.gravity) * axes], axis=1)
    force = (body.mass + entrained) * acceleration_cg + _acceleration(entrained_moment) + (body.mass - displaced) * up
    spun = xp.tensordot(OMEGA_R_OF_FEATURES[OF_MOTION], body.inertia + errors.entrained_air[4:], axes=1).T
    about_cg = xp.concat([spun, np.zeros((3, 9))], axis=1)
    about_cg = about_cg + cross_matrix(entrained_moment) @ acceleration_cg - cross_matrix(displaced_moment) @ up
    return xp.concat([force, about_cg + cross_matrix(body.r_cg_from_q) @ force])


def _acceleration(offset: Float[Array, "3"]) -> Float[Array, "3 18"]:
    """``alpha × ρ + omega × (omega × ρ)`` from the functions of the motion."""
    xp = library_of(offset)
    coefficients = xp.tensordot(FIRST_MOMENT_OF_FEATURES[OF_MOTION], offset, axes=1).T
    return xp.concat([coefficients, np.zeros((3, 9))], axis=1)


def cell_map(errors: Errors) -> Float[Array, "6 6"]:
    """Return the map from the true wrench to the measured one: sensor axes, cross-talk, then scale factors."""
    crossed = (np.eye(6) + errors.cell_cross_talk).reshape(6, 2, 3)
    return (1 + errors.cell_scale)[:, None] * (crossed @ exponential(errors.cell_misalignment).T).reshape(6, 6)


def gyro_map(errors: Errors) -> Float[Array, "3 3"]:
    """Return the map from the true angular velocity to the measured one: sensor axes, then scale factors."""
    return (1 + errors.gyro_scale)[:, None] * exponential(errors.gyro_misalignment).T


def true_elements(
    omega: Float[Array, "3 n"], alpha: Float[Array, "3 n"], t: Float[Array, " n"]
) -> Float[Array, "15 n"]:
    """Return the true elements that all estimators share: all but alpha."""
    shared = features(omega, alpha)[: ALPHA.start]
    return shared.__array_namespace__().concat([shared, t[None], t[None] * omega, (t * t)[None]])
