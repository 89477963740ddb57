"""A payload on an arm: the design against common practice and a D-optimal design, confirmed by simulated runs.

``python -m benchmarks.studies.arm_designs [EXPERIMENT] [--starts N] [--runs N] [--plain-runs N]`` prints predicted
average 3σ of moments and of products of each motion in the same time, then, from one simulation of each motion in
MuJoCo, whose joints track with error, and so many draws of the sensor's noise: the scatter seen, and how often
intervals of 95 % hold the truth. Last, on the designed motion: ``identify`` beside plain least squares.
"""

import argparse

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.plain_regression import beside_plain, coverage_lines
from identify.motion.serial_arm.payload_information import about_cg, about_q
from identify.rigid_body.inertia import GRAM_METRE, MOMENTS, PRODUCTS
from identify.rigid_body.regressor import wrench_regressor
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm_design import (
    DETERMINANT,
    PERIOD,
    RAMP,
    ROUNDS,
    STEPS,
    ArmDesign,
    design_arm,
    goal_function,
    searched,
)
from uq.plan.motion_design.arm.joint_search import Candidate, JointSearch
from uq.plan.motion_design.arm.mujoco_run import simulated


def estimates(design: ArmDesign, candidate: Candidate, runs: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the ten parameters from runs with drawn noise, (runs, 10), and the standard uncertainty stated for them.

    By least squares weighted with the declared noise, the six offsets estimated along, on the simulated joints' motion.
    """
    experiment, limits = design.experiment, design.limits
    run = simulated(limits.arm, experiment.body, experiment.gravity, candidate.series)
    motion = limits.tool(run.joints)
    rows = np.asarray(jax.jit(jax.vmap(wrench_regressor))(*map(jnp.asarray, motion)))
    whiten = np.linalg.inv(np.linalg.cholesky(design.noise.covariance))
    columns = np.concatenate([whiten @ rows, np.tile(whiten, (len(rows), 1, 1))], axis=2).reshape(-1, 16)
    inverse = np.linalg.inv(columns.T @ columns)
    exact = inverse @ columns.T @ (run.wrench @ whiten.T).ravel()
    generator = np.random.default_rng([31, seed])
    drawn = np.array([inverse @ (columns.T @ generator.normal(size=len(columns))) for _ in range(runs)])
    values = jax.vmap(about_cg)(jnp.asarray((exact + drawn)[:, :10]))
    slopes = jax.vmap(jax.jacfwd(about_cg))(jnp.asarray((exact + drawn)[:, :10]))
    covariance = np.einsum("rij,jk,rik->ri", np.asarray(slopes), inverse[:10, :10], np.asarray(slopes))
    return np.asarray(values), np.sqrt(covariance)


def _silent(*_: object) -> None:
    """Tell nobody."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", nargs="?", default="uq/examples/arm.toml")
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--plain-runs", type=int, default=100)
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    experiment = Experiment.load(arguments.experiment)
    design = design_arm(experiment, starts=arguments.starts)
    search = JointSearch(design.limits, design.noise, duration=design.duration, period=PERIOD, ramp=RAMP)
    measure = goal_function(DETERMINANT, experiment, design.motions["random"].covariance)
    rival, _ = searched(search, measure, starts=arguments.starts, seed=0, rounds=ROUNDS, steps=STEPS, tell=_silent)
    motions = design.motions | {"D-optimal": rival}
    promised = {name: candidate.averages for name, candidate in motions.items()}
    for name, averages in promised.items():
        change = {what: 100 * (promised["designed"][what] / value - 1) for what, value in averages.items()}
        cells = [f"{what} {GRAM_METRE * value:.5f} g·m² ({change[what]:+.1f} %)" for what, value in averages.items()]
        print(f"{name:12}", *cells, sep="  ", flush=True)
    truth = np.asarray(about_cg(about_q(experiment.body)))
    for seed, (name, candidate) in enumerate(motions.items()):
        values, stated = estimates(design, candidate, arguments.runs, seed)
        seen = GRAM_METRE * 3 * values[:, 4:].std(axis=0, ddof=1)
        averages = seen[list(MOMENTS)].mean(), seen[list(PRODUCTS)].mean()
        covered = 100 * (np.abs(values - truth) <= 1.96 * stated).mean(axis=0)
        print(f"{name:12}  seen {averages[0]:.5f} / {averages[1]:.5f} g·m²", end="")
        print(f"  coverage {covered.min():.1f} to {covered.max():.1f} %, mean {covered.mean():.1f} %", flush=True)
    beside = beside_plain(design.limits, design.noise, design.designed.series, arguments.plain_runs, 0)
    print(*coverage_lines(design.limits, beside), sep="\n")


if __name__ == "__main__":
    main()
