"""Columns of errors of the rig in the sensors' samples, a unit of each number of an error, by letting it act.

An error without a field of :class:`uq.sources.constant_errors.Errors` is declared and drawn by its file of
:mod:`identify.errors` alone: its first derivative on the noise-free run, times what is drawn, is added to the samples.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.errors.error_model import ErrorModel
from identify.errors.rig_state import Beliefs, RigState, TrueMotion
from identify.motion.trajectory import Motion
from identify.rigid_body.dynamics import specific_force_at, wrench
from identify.rigid_body.inertia import Body
from identify.rigid_body.rotation import closest_rotation, rotation_vectors
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.gram_sums.error_maps import Platform
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Source

READ = {"wrench": 6, "gyro": 3, "accelerometer": 3}
"""Parts of a rig's state that sensors read, with their channels."""
BY_THE_RUN = ("gyro_slope", "vertical")
"""Parts that follow from what is read: an estimator differentiates the gyro, and integrates it from the start."""


def columns_of(
    sources: Sequence[Source], body: Body, platform: Platform, motion: Motion
) -> dict[str, Float[np.ndarray, "12 n p"]]:
    """Return the derivatives of all readings by the numbers of each source that acts by its file, by name.

    Args:
        sources: any.
        body: that is moved.
        platform: that moves it.
        motion: true samples.

    Raises:
        ExperimentError: an error changes what an estimator believes, which trials draw by its own field alone.
    """
    acting = [(source, source.error_kind.error) for source in sources if isinstance(source.error_kind, ErrorByAct)]
    if not acting:
        return {}
    state = state_of(body, platform, motion)
    return {source.name: _columns(source, error, state) for source, error in acting}


def _columns(source: Source, error: ErrorModel, state: RigState) -> Float[np.ndarray, "12 n p"]:
    parts, n = error.derivatives(state), len(state.true.t)
    if believed := set(parts) - set(READ) - set(BY_THE_RUN):
        raise ExperimentError(
            f"source '{source.name}' ({source.kind} of {source.target}) acts on what is believed "
            f"({', '.join(sorted(believed))}), which no trial draws: leave it out with --without {source.name}"
        )
    nothing = {name: np.zeros((n, channels, error.count)) for name, channels in READ.items()}
    return np.concatenate([np.swapaxes(parts.get(name, nothing[name]), 0, 1) for name in READ])


def state_of(body: Body, platform: Platform, motion: Motion) -> RigState:
    """Return the rig of a noise-free run, its IMU at Q and along B; in NumPy."""
    t, omega, alpha, rotation, specific = (np.asarray(x) for x in motion)
    r_cg, up, n = np.asarray(body.r_cg_from_q), rotation[:, 2, :], len(t)
    read = np.concatenate(wrench(body, omega, alpha, specific)).T
    true = TrueMotion(
        t=t - t[0], duration=float(t[-1] - t[0]), omega=omega.T, alpha=alpha.T, specific_force=specific.T, up=up,
        turning=rotation_vectors(closest_rotation(rotation.mean(axis=0)).T @ rotation), mass=float(body.mass),
        r_cg=r_cg, inertia=np.asarray(body.inertia),
    )  # fmt: skip
    figures = {"mass": body.mass, "r_cg": r_cg, "inertia": body.inertia, "gravity": platform.gravity}
    figures |= {"cg_from_still": platform.r_cg_from_still, "imu_position": np.zeros(3)}
    beliefs = Beliefs(**{name: np.tile(np.atleast_1d(value), (n, 1)) for name, value in figures.items()})
    # f at a point ρ from the centre of gravity is f + α × ρ + ω × (ω × ρ); the IMU is at Q
    at_imu = specific_force_at(true.specific_force, true.omega, true.alpha, -r_cg)
    return RigState(
        true=true, beliefs=beliefs, wrench=read, gyro=true.omega, gyro_slope=true.alpha, accelerometer=at_imu,
        vertical=up[0], imu_turn=np.eye(3),
    )  # fmt: skip
