"""Plain least squares and ``mujoco.sysid`` beside ``identify``: what their intervals cover, on the same samples.

``python -m benchmarks.studies.plain_regression [EXPERIMENT] [--duration S] [--runs N] [--sysid-runs K] [--designed]``
runs the best of 20 random Fourier series, or the designed motion, in MuJoCo once. N times it draws what is measured:
joint angles in steps of their encoders, force and moment with noise and an offset. Plain is what a user writes: angles
differentiated numerically, the regressor of the sensor's frame, ``numpy.linalg.lstsq`` and the covariance
``s² (AᵀA)⁻¹``. The first K draws go to ``mujoco.sysid`` too: with the joints as ``identify`` has them, and as plain has
them.
"""

import argparse
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import signal

from benchmarks.studies.mujoco_sysid import AVAILABLE, INSTALL, payload_by_sysid
from identify import Run, identify
from identify.estimation.joint.priors import Alignment
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from identify.motion.serial_arm.payload_information import about_cg, about_q
from identify.motion.serial_arm.serial_chain import SerialChain, driven
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import wrench_regressor
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.arm_design import PERIOD, RAMP, RANDOM, design_arm, random_series
from uq.plan.motion_design.arm.arm_limits import ArmLimits
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.arm.joint_search import JointSearch
from uq.plan.motion_design.arm.mujoco_run import ASSUMED, MujocoRun, simulated
from uq.plan.motion_design.arm.predicted_payload import WrenchNoise, declared_noise

STEP, OFFSET = 2 * np.pi / 2**19, np.repeat([2.0, 0.1], 3)
"""Of an encoder of 19 bits [rad]; standard deviation of the cell's offset, drawn for each run [N, N·m]."""
WINDOW, ORDER = 0.075, 4
"""Of the Savitzky–Golay filter that differentiates the angles for ``identify`` [s]."""
LOWPASS = 5
"""Cut-off of the Butterworth filter of fourth order, forth and back, over the command's bandwidth."""
PARTS = {"mass": slice(0, 1), "r_CG": slice(1, 4), "tensor": slice(4, 10)}


class Measured(NamedTuple):
    """What a robot logs of a run."""

    t: np.ndarray
    angles: np.ndarray
    wrench: np.ndarray


class Stated(NamedTuple):
    """Mass, r_CG and tensor about the centre of gravity, and half of the stated 95 % intervals."""

    values: np.ndarray
    half: np.ndarray


def measured(run: MujocoRun, noise: WrenchNoise, generator: np.random.Generator) -> Measured:
    """Return a run as encoders and load cell read it."""
    zero = generator.uniform(size=run.joints.position.shape[1])
    angles = STEP * (np.round(run.joints.position / STEP + zero) - zero)
    errors = generator.normal(size=run.wrench.shape) @ np.linalg.cholesky(noise.covariance).T
    return Measured(run.t, angles, run.wrench + OFFSET * generator.normal(size=6) + errors)


def plain(arm: Arm, gravity: float, log: Measured, *, offsets: bool, lowpass: float | None = None) -> Stated:
    """Return what least squares on the regressor of the sensor's frame states, as users write it.

    Args:
        arm: with its chain of joints.
        gravity: local gravity [m/s²].
        log: the samples.
        offsets: whether six columns for the sensor's offsets are added.
        lowpass: cut-off of a filter of angles and wrench [Hz]; None: none.
    """
    step, (t, angles, wrench) = log.t[1] - log.t[0], log
    if lowpass is not None:
        filter_ = signal.butter(4, lowpass, fs=1 / step, output="sos")
        angles, wrench = (signal.sosfiltfilt(filter_, each, axis=0) for each in (angles, wrench))
    joints = differentiated(angles, step)
    rows = np.zeros((len(t), 6, 16 if offsets else 10))
    rows[:, :, :10] = _regressors(arm.chain, joints, gravity)
    rows[:, :, 10:] = np.eye(6)[:, : rows.shape[2] - 10]
    columns, values = rows.reshape(-1, rows.shape[2]), wrench.ravel()
    estimate = np.linalg.lstsq(columns, values)[0]
    variance = ((values - columns @ estimate) ** 2).sum() / (len(values) - len(estimate))
    covariance = variance * np.linalg.inv(columns.T @ columns)
    return stated_about_cg(estimate[:10], covariance[:10, :10])


@jax.jit
def _regressors(chain: SerialChain, joints: JointStates, gravity: float) -> Float[Array, "t 6 10"]:
    """The regressor of the wrench at the tool at each instant."""
    nothing: Any = Body(jnp.zeros(()), jnp.zeros(3), jnp.zeros(6))

    def of_instant(q: Array, speed: Array, acceleration: Array) -> Array:
        return wrench_regressor(*driven(chain, q, speed, acceleration, nothing, gravity).tool)

    return jax.vmap(of_instant)(*map(jnp.asarray, joints))


def stated_about_cg(parameters: np.ndarray, covariance: np.ndarray) -> Stated:
    """Return what mass, first moment and tensor about Q, and their covariance, say about the centre of gravity."""
    slope = np.asarray(jax.jacfwd(about_cg)(jnp.asarray(parameters)))
    values = np.asarray(about_cg(jnp.asarray(parameters)))
    return Stated(values, 1.96 * np.sqrt(np.einsum("ij,jk,ik->i", slope, covariance, slope)))


def differentiated(angles: np.ndarray, step: float) -> JointStates:
    """Return angles with their central differences."""
    speed = np.gradient(angles, step, axis=0)
    return JointStates(angles, speed, np.gradient(speed, step, axis=0))


def smoothed(log: Measured) -> JointStates:
    """Return angles, speeds and accelerations of a Savitzky–Golay filter."""
    step = log.t[1] - log.t[0]
    length = 2 * round(WINDOW / step / 2) + 1
    orders = (signal.savgol_filter(log.angles, length, ORDER, deriv=order, delta=step, axis=0) for order in range(3))
    return JointStates(*orders)


def identified(limits: ArmLimits, gravity: float, log: Measured) -> Stated:
    """Return what ``identify`` states of the same samples; its motion is that of the smoothed joints."""
    tool = limits.tool(smoothed(log))
    run = Run.from_channels(
        log.t, log.wrench[:, :3], log.wrench[:, 3:], log.t, tool.omega, specific_force=tool.specific_force
    )
    exact = Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=0.0, sigma_accelerometer_bias=0.0)
    result = identify(run, r_cg=(0, 0, 0), sigma_r_cg=(1, 1, 1), method="joint", gravity=gravity, alignment=exact)
    values = np.concatenate([[result.mass], result.r_cg, result.inertia])
    return Stated(values, result.coverage_factors * result.parameters.standard_uncertainty)


def by_sysid(limits: ArmLimits, log: Measured, joints: JointStates) -> Stated:
    """Return what ``mujoco.sysid`` states; its model has the payload that the arm's controller reckons with."""
    mass, centre, inertia = limits.body
    nominal = Body(np.asarray(ASSUMED * mass), centre, np.asarray(ASSUMED * inertia))
    return stated_about_cg(*payload_by_sysid(limits.arm, nominal, limits.gravity, log.t, joints, log.wrench))


def beside_plain(
    limits: ArmLimits, noise: WrenchNoise, series: JointSeries, runs: int, seed: int, sysid_runs: int = 0
) -> dict[str, Stated]:
    """Return what each way states of so many draws of one run in MuJoCo, (runs, 10) or (sysid_runs, 10)."""
    gravity, lowpass = limits.gravity, LOWPASS * limits.bandwidth
    run = simulated(limits.arm, limits.body, gravity, series)
    ways: dict[str, Any] = {
        "identify": lambda log: identified(limits, gravity, log),
        "plain": lambda log: plain(limits.arm, gravity, log, offsets=False),
        "plain, offsets": lambda log: plain(limits.arm, gravity, log, offsets=True),
        "plain, offsets, low-pass": lambda log: plain(limits.arm, gravity, log, offsets=True, lowpass=lowpass),
    }
    slow: dict[str, Any] = {
        "mujoco.sysid": lambda log: by_sysid(limits, log, smoothed(log)),
        "mujoco.sysid, differences": lambda log: by_sysid(limits, log, differentiated(log.angles, log.t[1] - log.t[0])),
    }
    generator, stated = np.random.default_rng([32, seed]), dict[str, list[Stated]]()
    for run_number in range(runs):
        log = measured(run, noise, generator)
        for name, way in (ways | slow if run_number < sysid_runs else ways).items():
            stated.setdefault(name, []).append(way(log))
    return {name: Stated(*(np.array(part) for part in zip(*results, strict=True))) for name, results in stated.items()}


def coverage_lines(limits: ArmLimits, stated: dict[str, Stated]) -> list[str]:
    """Return a line a way: how many intervals hold the truth, and half their width over 1.96 times the scatter seen."""
    truth = np.asarray(about_cg(about_q(limits.body)))
    lines = []
    for name, (values, half) in stated.items():
        covered = 100 * (np.abs(values - truth) <= half).mean(axis=0)
        width = half.mean(axis=0) / (1.96 * values.std(axis=0, ddof=1))
        cells = [f"{part} {covered[of].mean():.1f} % (×{width[of].mean():.2g})" for part, of in PARTS.items()]
        lines.append(f"{name:25}  {len(values):4} runs  covers {covered.mean():5.1f} %:  {'  '.join(cells)}")
    return lines


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("experiment", nargs="?", default="uq/examples/arm.toml")
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--sysid-runs", type=int, default=20)
    parser.add_argument("--designed", action="store_true")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    experiment = Experiment.load(arguments.experiment)
    arm = Arm.of(experiment)
    limits, noise = ArmLimits(experiment, arm, Clearance.of(arm)), declared_noise(experiment, arm.declared.rate)
    if arguments.designed:
        series = design_arm(experiment, duration=arguments.duration, starts=1).designed.series
    else:
        search = JointSearch(limits, noise, duration=arguments.duration, period=PERIOD, ramp=RAMP)
        series = random_series(search, RANDOM, 0).series
    if not AVAILABLE:
        print(INSTALL)
    sysid_runs = arguments.sysid_runs if AVAILABLE else 0
    print(*coverage_lines(limits, beside_plain(limits, noise, series, arguments.runs, 0, sysid_runs)), sep="\n")


if __name__ == "__main__":
    main()
