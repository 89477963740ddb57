"""A laboratory that measures a body on a fixture, and the fixture alone: poses and a run of each."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.pose_fit import Attitudes
from identify.identification import identify
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.signals.estimator_spec import EstimatorSpec
from tests.helpers.point_masses import subtract
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.tare import tared

SMOOTHED = EstimatorSpec("smoothed", "savitzky-golay", band=1.55)
GRAVITY = 9.80665
POSES, TILT = 12, np.radians(25.0)


ALIGNMENT = 2e-3
"""Standard uncertainty of the attitudes' axes against the load cell's, the same for body and fixture [rad]."""
NOISE = 0.1, 0.004
"""Of a pose's mean force [N] and moment [N·m]."""
FORCE_OFFSET, MOMENT_OFFSET = np.array([4.0, -7.0, 2.5]), np.array([0.3, -0.1, 0.7])

WHOLE = InertialParameters(
    19.7, np.array([0.002, -0.003, 0.053]), np.array([0.3813, 0.002, -0.001, 0.0485, 0.001, 0.3791]), np.zeros((10, 10))
)
FIXTURE = InertialParameters(
    4.2, np.array([0.001, 0.002, 0.018]), np.array([0.031, 0.0, 0.001, 0.012, 0.0, 0.036]), np.zeros((10, 10))
)
BODY = subtract(WHOLE, FIXTURE)


def experiment_of(short, parameters):
    """The preset with another body; precision errors and constant offsets of the load cell only."""
    kept = tuple(s for s in short.sources if s.kind == "precision" or s.target in ("F", "M"))
    return dataclasses.replace(
        short, mass=parameters.mass, r_cg_from_q=parameters.r_cg, inertia=parameters.inertia, sources=kept
    )


def poses_of(parameters, rng, misaligned):
    """Static poses of a body: a centre with its covariance; the sensor of the attitudes is off by a rotation vector."""
    tilts = rng.uniform(-TILT, TILT, (POSES, 2))
    true = GRAVITY * Rotation.from_euler("xy", tilts).as_matrix()[:, 2]
    seen = true + np.cross(misaligned, true)
    turns = np.broadcast_to(ALIGNMENT * np.eye(3), (POSES, 3, 3))
    attitudes = Attitudes(common=np.cross(turns, seen[:, None], axis=2).transpose(0, 2, 1), lasting=3)
    force = parameters.mass * true + FORCE_OFFSET + NOISE[0] * rng.normal(size=true.shape)
    moment = np.cross(parameters.r_cg, parameters.mass * true) + MOMENT_OFFSET + NOISE[1] * rng.normal(size=true.shape)
    return centre(force, moment, seen, attitudes=attitudes)


def measured(experiment, parameters, rng, misaligned, trial, method="source"):
    """The result of one body from its own poses and run, and the centre."""
    known = poses_of(parameters, rng, misaligned)
    run = simulate(experiment, "T1", trial=trial).run
    if method == "joint":  # the simulated run has offsets of its own
        other_offsets = np.diag(np.repeat([0.0, 10.0, 1.0], [4, 3, 3])) ** 2
        known = dataclasses.replace(known, covariance=known.covariance + other_offsets)
    still = {"method": "joint", "cg_motion": "still", "gravity": GRAVITY} if method == "joint" else {}
    return identify(run, centre=known, estimator=SMOOTHED, **still), known


def laboratory(short, trial):
    """One repeat: the body's result by subtraction."""
    rng = np.random.default_rng([7, trial])
    misaligned = ALIGNMENT * rng.normal(size=3)
    whole, _ = measured(experiment_of(short, WHOLE), WHOLE, rng, misaligned, 2 * trial)
    empty, _ = measured(experiment_of(short, FIXTURE), FIXTURE, rng, misaligned, 2 * trial + 1)
    return tared(whole, empty)
