"""The hybrid Cramér–Rao bound of an experiment file: its trajectory, noise, and biases as what is known beforehand."""

from dataclasses import replace

import numpy as np

from identify.joint.cramer_rao_bound import Bound
from identify.joint.cramer_rao_bound import bound as bound_of_run
from identify.joint.joint_model import SpecificForce
from identify.joint.priors import Alignment
from identify.signals.filters import motion_band
from uq.campaign.simulation import simulate
from uq.experiment.experiment import Experiment
from uq.sources.source import Kind, Target

UNKNOWN_MASS = 1e3
"""Standard uncertainty of a mass that nothing is known of [kg]."""


def bound(
    experiment: Experiment,
    trajectory: str | None = None,
    *,
    sigma_mass: float | None = None,
    band: float | None = None,
    specific_force: SpecificForce | None = None,
) -> Bound:
    """Return the least uncertainty that any estimate from this experiment's runs can have.

    Free are the tensor, the mass, the initial tilt, and what has a source of bias: r_CG, the zeros of force, moment and
    gyro; a delay and a rotation of the IMU where sources of these are declared. Their standard deviations are the
    priors'. Sources of other kinds (scale factors, air …) count as absent.

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
        + [_sigma(experiment, *key) for key in (("r_cg", "bias"), ("F", "bias"), ("M", "bias"))]
    )
    alignment = Alignment(
        sigma_delay=float(_sigma(experiment, "omega", "delay")[0]),
        sigma_rotation=_each(_sigma(experiment, "omega", "misalignment")),
        sigma_gyro_bias=_each(_sigma(experiment, "omega", "bias")),
    )
    return bound_of_run(
        run, experiment.body, band=motion_band(run.omega, run.rate) if band is None else band,
        noise=np.concatenate([_sigma(experiment, "F", "precision"), _sigma(experiment, "M", "precision")]),
        gyro_noise=_sigma(experiment, "omega", "precision"), static_covariance=np.diag(static**2), alignment=alignment,
        specific_force=specific_force or ("still" if spec.still == "cg" else "none"), gravity=experiment.gravity,
    )  # fmt: skip


def _sigma(experiment: Experiment, target: Target, kind: Kind) -> np.ndarray:
    """Standard deviation of all sources of a kind on a quantity together, on each axis."""
    found = [s.standard_deviation for s in experiment.sources if (s.target, s.kind) == (target, kind)]
    return np.sqrt(sum((np.broadcast_to(one, 3) ** 2 for one in found), np.zeros(3)))


def _each(sigma: np.ndarray) -> tuple[float, float, float]:
    one, two, three = map(float, sigma)
    return one, two, three
