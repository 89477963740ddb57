"""The hybrid Cramér–Rao bound of an experiment file: its trajectory, noise, and biases as what is known beforehand."""

from dataclasses import replace

import numpy as np

from identify.estimation.joint import cramer_rao_bound
from identify.estimation.joint.joint_model import SpecificForce
from identify.estimation.joint.priors import Alignment
from identify.signals.power_spectrum import motion_band
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.sources.constant_errors import declared_sigma
from uq.sources.source import SIGNALS, signal_variance

UNKNOWN_MASS = 1e3
"""Standard uncertainty of a mass that nothing is known of [kg]."""


def bound(
    experiment: Experiment,
    trajectory: str | None = None,
    *,
    sigma_mass: float | None = None,
    band: float | None = None,
    specific_force: SpecificForce | None = None,
) -> cramer_rao_bound.Bound:
    """Return the least uncertainty that any estimate from this experiment's runs can have.

    Free are the tensor, the mass, the initial tilt, and what has a source of bias: r_CG, the zeros of force, moment and
    gyro, the centre of gravity's place from the point at rest (r_cg_from_omb); a delay and a rotation of the IMU where
    sources of these are declared. Their standard deviations are the priors'. Sources of other kinds (scale factors,
    air …) count as absent.

    Args:
        experiment: body, platform, trajectories, sources.
        trajectory: name of the trajectory; None for the first.
        sigma_mass: standard uncertainty of the mass beforehand [kg]; None: nothing is known of it.
        band: highest frequency of the motion [Hz]; None: as its own spectrum shows.
        specific_force: where it comes from; None: ``still`` where the trajectory keeps the centre of gravity still,
            else ``none``.

    Raises:
        ExperimentError: there is no such trajectory, or the body is not stated.
        RunError: the trajectory is too short.
    """
    name, spec = experiment.select(trajectory)
    run = simulate(replace(experiment, sources=(), mixing=()), name).run
    static = np.concatenate(
        [[UNKNOWN_MASS if sigma_mass is None else sigma_mass]]
        + [declared_sigma(experiment.sources, field) for field in ("r_cg", "cell_bias")]
    )
    alignment = Alignment(
        sigma_delay=float(declared_sigma(experiment.sources, "gyro_delay")),
        sigma_rotation=_by_axis(declared_sigma(experiment.sources, "gyro_misalignment")),
        sigma_gyro_bias=_by_axis(declared_sigma(experiment.sources, "gyro_bias")),
    )
    white = [source for source in experiment.sources if source.white]
    force, moment, omega = (np.sqrt(signal_variance(white, signal)) for signal in range(len(SIGNALS)))
    return cramer_rao_bound.bound(
        run, experiment.body, band=motion_band(run.omega, run.rate) if band is None else band,
        noise=np.concatenate([force, moment]), gyro_noise=omega,
        static_covariance=np.diag(static**2), alignment=alignment, gravity=experiment.gravity,
        specific_force=specific_force or ("still" if spec.still == "cg" else "none"),
        sigma_still=declared_sigma(experiment.sources, "r_cg_from_omb"),
    )  # fmt: skip


def _by_axis(sigma: np.ndarray) -> tuple[float, float, float]:
    x, y, z = map(float, sigma)
    return x, y, z
