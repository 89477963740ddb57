"""The two studies of the joint estimate, in chunks of trials: what each trial says, for tables and verdicts."""

import numpy as np
from joint_lab import Laboratory, random_body

from identify.inertia import COMPONENTS, Body
from identify.joint_model import SLICES
from identify.priors import Alignment

NAMES = (*COMPONENTS, "delay", "rotation 1", "rotation 2", "rotation 3", "r_cg 1", "r_cg 2", "r_cg 3")
"""What the laboratories' intervals are of."""
SHOWN = np.r_[
    tuple(np.arange(SLICES[name].start, SLICES[name].stop) for name in ("inertia", "delay", "rotation", "r_cg"))
]


def own_laboratory(experiment):
    """The laboratory of the experiment's own body."""
    return Laboratory(experiment, Body(*(np.asarray(x) for x in experiment.body)))


def laboratories(experiment, bodies, runs, seed=0):
    """Errors, standard uncertainties and the prior's shares, each (bodies, runs, 13): ``NAMES``."""
    found = [_one_laboratory(experiment, body, runs, seed) for body in bodies]
    return tuple(np.array(part) for part in zip(*found, strict=True))


def _one_laboratory(experiment, number, runs, seed):
    rng = np.random.default_rng([seed, number])
    laboratory = Laboratory(experiment, random_body(rng))
    covariance = _correlated(laboratory.sigma_static, rng)
    rows = []
    for _ in range(runs):
        delay, axis = rng.uniform(-0.01, 0.01), rng.standard_normal(3)
        rotation = axis / np.linalg.norm(axis) * rng.uniform(0, np.radians(3))
        joint = laboratory.estimate(
            laboratory.run(rng, delay, rotation), laboratory.calibration(rng, covariance), Alignment()
        )
        truth = np.concatenate([laboratory.body.inertia, [delay], rotation, laboratory.body.r_cg_from_q])
        total, of_prior = (np.diag(part)[SHOWN] for part in joint.posterior())
        rows.append((joint.theta[SHOWN] - truth, np.sqrt(total), of_prior / total))
    return tuple(np.array(part) for part in zip(*rows, strict=True))


def _correlated(sigma, rng):
    """A covariance of a static calibration, whose errors go together as those of few poses do."""
    mixing = np.eye(10) + 0.3 * rng.standard_normal((10, 10))
    correlation = mixing @ mixing.T
    scale = sigma / np.sqrt(np.diag(correlation))
    return correlation * np.outer(scale, scale)


def efficiency(experiment, trials, *, aligned, seed=1):
    """Errors of the joint and of the source's estimator on the same runs [kg·m²], (trials, 2, 6), priors re-drawn."""
    laboratory = own_laboratory(experiment)
    alignment = known_alignment() if aligned else unknown_alignment()
    found = []
    for trial in trials:
        rng = np.random.default_rng([seed, int(aligned), trial])
        delay, rotation = (0.0, np.zeros(3)) if aligned else (rng.normal(0, 0.01), rng.normal(0, np.radians(3), 3))
        run, calibration = laboratory.run(rng, delay, rotation), laboratory.calibration(rng)
        joint = laboratory.estimate(run, calibration, alignment).theta[SLICES["inertia"]]
        source = laboratory.source_estimate(run, calibration.mean[1:4])
        found.append(np.array([joint, source]) - np.asarray(laboratory.body.inertia))
    return np.array(found)


def known_alignment():
    """Nothing unknown of time and frame; the source's bias of the gyro."""
    return Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=(5.8e-3, 6.0e-3, 5.9e-3))


def unknown_alignment():
    """10 ms and 3°, as drawn."""
    return Alignment(sigma_delay=0.01, sigma_rotation=float(np.radians(3)), sigma_gyro_bias=(5.8e-3, 6.0e-3, 5.9e-3))
