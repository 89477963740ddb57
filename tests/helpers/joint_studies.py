"""The two studies of the joint estimate, in chunks of trials: what each trial says, for tables and verdicts."""

import dataclasses

import numpy as np

from identify.estimation.joint.joint_model import SLICES
from identify.estimation.joint.joint_pooling import pool
from identify.estimation.joint.priors import Alignment
from identify.rigid_body.inertia import COMPONENTS, MOMENTS, PRODUCTS
from tests.helpers.joint_lab import Laboratory, random_body
from uq.sources.source import Source

NAMES = (*COMPONENTS, "delay", "rotation 1", "rotation 2", "rotation 3", "r_cg 1", "r_cg 2", "r_cg 3")
"""What the laboratories' intervals are of."""
SHOWN = np.r_[
    tuple(np.arange(SLICES[name].start, SLICES[name].stop) for name in ("inertia", "delay", "rotation", "r_cg"))
]


def own_laboratory(experiment):
    """The laboratory of the experiment's own body."""
    return Laboratory(experiment, experiment.body)


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
        pooled = pool([joint.solved], ())
        total, from_prior = (np.diag(part)[SHOWN] for part in (pooled.covariance, pooled.from_prior))
        rows.append((joint.theta[SHOWN] - truth, np.sqrt(total), from_prior / total))
    return tuple(np.array(part) for part in zip(*rows, strict=True))


def _correlated(sigma, rng):
    """A covariance of a static calibration, whose errors go together as those of few poses do."""
    mixing = np.eye(10) + 0.3 * rng.standard_normal((10, 10))
    correlation = mixing @ mixing.T
    scale = sigma / np.sqrt(np.diag(correlation))
    return correlation * np.outer(scale, scale)


def efficiency(experiment, trials, *, aligned, seed=1):
    """Errors of the joint estimate on T1's rows, drawn decimated, noise declared, priors re-drawn; (trials, count)."""
    laboratory, alignment = own_laboratory(experiment), known_alignment() if aligned else unknown_alignment()
    found = []
    for trial in trials:
        rng = np.random.default_rng([seed, int(aligned), trial])
        delay, rotation = _misalignment(rng, aligned)
        rows, calibration = laboratory.rows(rng, delay, rotation), laboratory.calibration(rng)
        theta, _ = laboratory.estimate_rows(rows, calibration, alignment)
        truth = np.concatenate([laboratory.body.inertia, [delay], rotation, laboratory.body.r_cg_from_q])
        found.append(theta[SHOWN] - truth)
    return np.array(found)


def _misalignment(rng, aligned):
    return (0.0, np.zeros(3)) if aligned else (rng.normal(0, 0.01), rng.normal(0, np.radians(3), 3))


def against_the_source(experiment, trials, *, aligned, seed=2):
    """Errors of the joint and of the paper's estimator on the same runs, sample by sample [kg·m²]; (trials, 2, 6)."""
    laboratory, alignment = own_laboratory(experiment), known_alignment() if aligned else unknown_alignment()
    found = []
    for trial in trials:
        rng = np.random.default_rng([seed, int(aligned), trial])
        run = laboratory.run(rng, *_misalignment(rng, aligned))
        calibration = laboratory.calibration(rng)
        joint = laboratory.estimate(run, calibration, alignment).theta[SLICES["inertia"]]
        source = laboratory.source_estimate(run, calibration.mean[1:4])
        found.append(np.array([joint, source]) - np.asarray(laboratory.body.inertia))
    return np.array(found)


def known_alignment():
    """Nothing unknown of time and frame; the paper's bias of the gyro."""
    return Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=(5.8e-3, 6.0e-3, 5.9e-3))


def unknown_alignment():
    """10 ms and 3°, as drawn."""
    return Alignment(sigma_delay=0.01, sigma_rotation=float(np.radians(3)), sigma_gyro_bias=(5.8e-3, 6.0e-3, 5.9e-3))


def declared(experiment, aligned):
    """The experiment with 10 ms and 3° declared, or with neither."""
    if aligned:
        return experiment
    late = Source("late", "omega", "delay", "imu", np.array(0.01))
    turned = Source("turned", "omega", "misalignment", "imu", np.full(3, np.radians(3)))
    return dataclasses.replace(experiment, sources=(*experiment.sources, late, turned))


def laboratory_table(errors, sigma, shares):
    """Coverage of every interval, of the worst body's, mean error over its standard error, the prior's share."""
    covered = np.abs(errors) < 1.96 * sigma
    flat = errors.reshape(-1, errors.shape[2])
    drift = flat.mean(axis=0) / (flat.std(axis=0) / np.sqrt(len(flat)))
    lines = [
        "| interval | covers | worst body | mean error / its standard error | prior's share |",
        "|---|---|---|---|---|",
    ]
    for k, name in enumerate(NAMES):
        pooled, worst = covered[..., k].mean(), covered[..., k].mean(axis=1).min()
        lines.append(
            f"| {name} | {100 * pooled:.1f} % | {100 * worst:.0f} % | {drift[k]:+.1f} | {100 * shares[..., k].mean():.1f} % |"
        )
    return "\n".join(lines)


def efficiency_table(errors, least):
    """Variance over the bound's, mean error over 3σ, 3σ [g·m²], by component."""
    three = 3e3 * errors.std(axis=0, ddof=1)
    ratio = errors.var(axis=0, ddof=1) / np.diag(least.covariance)[SLICES["inertia"]]
    lines = [f"| {len(errors):,} trials | " + " | ".join(COMPONENTS) + " |", "|---" * 7 + "|"]
    for name, values in (
        ("3σ, g·m²", three), ("3σ at least (bound)", 3e3 * least.standard_uncertainty("inertia")),
        ("variance / bound", ratio), ("mean error / 3σ", 1e3 * errors.mean(axis=0) / three),
    ):  # fmt: skip
        lines.append(f"| {name} | " + " | ".join(f"{value:.3f}" for value in values) + " |")
    return "\n".join([*lines, "averages, moments and products: " + _averages(three)])


def paired_table(joint, source):
    """Root-mean-square errors and 3σ of both estimators [g·m²]."""
    lines = [f"| {len(joint):,} runs, g·m² | " + " | ".join(COMPONENTS) + " |", "|---" * 7 + "|"]
    for name, one in (("joint", joint), ("source, smoothed", source)):
        for what, values in (("rms error", np.sqrt((one**2).mean(axis=0))), ("3σ", 3 * one.std(axis=0, ddof=1))):
            lines.append(f"| {name}: {what} | " + " | ".join(f"{1e3 * value:.2f}" for value in values) + " |")
    return "\n".join(lines)


def _averages(three):
    return f"{three[list(MOMENTS)].mean():.3f}, {three[list(PRODUCTS)].mean():.3f} g·m²"
