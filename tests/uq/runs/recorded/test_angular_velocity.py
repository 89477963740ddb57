"""The angular velocity from twists, odometry and poses gives the tensor that an IMU's gives, with the right bias."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.identification import identify
from identify.signals.angular_velocity_from_attitude import (
    angular_velocity,
    band_by_turning,
    continuous,
    differentiator,
)
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run, RunError
from identify.signals.shaped_noise import ShapedNoise
from rig.exceptions import RigError
from tests.helpers.bags import STORE, header, wrench, write_rosbag2
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load_run

START = 10**9


@pytest.fixture(scope="module")
def experiment(preset):
    """T1 in ten seconds, without errors; a smoother of the motion's band."""
    spec = preset.trajectories["T1"]
    trajectory = dataclasses.replace(spec.trajectory, duration=np.array(10.0), ramp=np.array(1.5))
    short = dataclasses.replace(spec, duration=10.0, rate=200.0, trajectory=trajectory)
    estimator = EstimatorSpec("smoothed", "savitzky-golay", 2.5)
    return dataclasses.replace(preset, trajectories={"T1": short}, sources=(), estimators=(estimator,))


@pytest.fixture(scope="module")
def simulated(experiment):
    return simulate(experiment)


def kinds():
    return STORE.types


def message(kind, stamp, omega, quaternion):
    """A message of one motion type at one instant."""
    types, head = kinds(), header(STORE, stamp, "body")
    vector, zero = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/Twist"](zero, vector(*map(float, omega)))
    point = types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
    pose = types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](*map(float, quaternion)))
    if kind == "geometry_msgs/msg/TwistStamped":
        return types[kind](head, twist)
    if kind == "geometry_msgs/msg/PoseStamped":
        return types[kind](head, pose)
    with_pose = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
    with_twist = types["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
    return types[kind](head, "body", with_pose, with_twist)


def write(path, simulated, kind, *, omega=None, quaternion=None, stamped=True, little_endian=True, frame=None):
    """A run by rosbags: WrenchStamped (or a bare Wrench) and one topic of ``kind``."""
    run = simulated.run
    omega = run.omega if omega is None else omega
    quaternion = Rotation.from_matrix(simulated.rotation).as_quat() if quaternion is None else quaternion
    items = []
    for k, t in enumerate(run.t):
        time = START + round(t * 1e9)
        bare = wrench(STORE, run.force[k], run.moment[k])
        name = "geometry_msgs/msg/WrenchStamped"
        stamped_wrench = kinds()[name](header(STORE, time, "body"), bare)
        item = (name, stamped_wrench) if stamped else ("geometry_msgs/msg/Wrench", bare)
        items.append((time, "/wrench", *item))
        told = message(kind, time, omega[k], quaternion[k])
        if frame is not None:
            told.header.frame_id = frame
        items.append((time, "/motion", kind, told))
    write_rosbag2(path, items, little_endian=little_endian)
    return path


MOTIONS = ["geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"]


@pytest.mark.parametrize(
    ("kind", "little_endian"),
    [
        *((kind, True) for kind in MOTIONS), (MOTIONS[0], False),
        *(pytest.param(kind, False, marks=pytest.mark.slow) for kind in MOTIONS[1:]),
    ],
)  # fmt: skip
def test_every_motion_gives_the_tensor(tmp_path, experiment, simulated, kind, little_endian):
    """Noise-free: within 2e-4, the two differentiators' gains over the band."""
    path = write(tmp_path / "bag", simulated, kind, little_endian=little_endian)
    result = identify_files([path], experiment)
    np.testing.assert_allclose(result.inertia, experiment.inertia, rtol=2e-4, atol=2e-5)
    assert "/motion" in " ".join(result.assumptions)


def test_odometry_without_a_twist_is_differentiated_and_says_so(tmp_path, experiment, simulated):
    nothing = np.zeros_like(simulated.run.omega)
    path = write(tmp_path / "bag", simulated, "nav_msgs/msg/Odometry", omega=nothing)
    result = identify_files([path], experiment)
    np.testing.assert_allclose(result.inertia, experiment.inertia, rtol=2e-4, atol=2e-5)
    assert "twist of /motion in bag is zero throughout" in " ".join(result.warnings)


def test_a_wrench_without_a_header_is_taken_by_the_logs_time(tmp_path, experiment, simulated):
    path = write(tmp_path / "bag", simulated, "geometry_msgs/msg/PoseStamped", stamped=False)
    result = identify_files([path], experiment)
    np.testing.assert_allclose(result.inertia, experiment.inertia, rtol=2e-4, atol=2e-5)
    assert "no stamps in the headers of /wrench" in " ".join(result.warnings)


def test_poses_may_jump_in_sign_and_come_unevenly(tmp_path, experiment, simulated, generator):
    """q and -q are one attitude; stamps that jitter by 5 % are resampled; the wrench keeps its own instants."""
    quaternion = Rotation.from_matrix(simulated.rotation).as_quat()
    flips = generator.choice([-1.0, 1.0], len(quaternion))[:, None]
    path = write(tmp_path / "bag", simulated, "geometry_msgs/msg/PoseStamped", quaternion=flips * quaternion)
    result = identify_files([path], experiment)
    np.testing.assert_allclose(result.inertia, experiment.inertia, rtol=2e-4, atol=2e-5)


def test_the_bias_from_noisy_poses_is_the_stated_one(experiment, simulated, generator, unjudged):
    """White attitude noise of 0.1 mrad makes the tensor too small: over 20 draws the mean error is the stated bias.

    Tolerance: four standard errors of the mean and a tenth of the bias, which neglects what it does to its own
    square; the chance of a false alarm is below 1e-3. A white model would state half of it or less.
    """
    clean = simulated.run
    attitude = Rotation.from_matrix(simulated.rotation)
    errors, stated = [], []
    for _ in range(20):
        noisy = attitude * Rotation.from_rotvec(1e-4 * generator.normal(size=(len(clean.t), 3)))
        quaternion = continuous(noisy.as_quat(), "test")
        turning = band_by_turning(quaternion, clean.rate)
        taps = differentiator(quaternion, clean.rate, "test", band=experiment.estimators[0].band, by_turning=turning)
        omega, sigma = angular_velocity(quaternion, taps)
        inner = slice(len(taps), len(clean.t) - len(taps))
        run = Run(clean.t[inner], clean.force[inner], clean.moment[inner], omega)
        run = dataclasses.replace(run, noise=ShapedNoise(sigma, taps, clean.rate))
        result = identify(run, r_cg=experiment.r_cg_from_q, estimator=experiment.estimators[0])
        errors.append(result.inertia - experiment.inertia)
        stated.append(result.bias)
    mean, spread = np.mean(errors, axis=0), np.std(errors, axis=0) / np.sqrt(20)
    bias = np.mean(stated, axis=0)
    assert (np.abs(mean - bias) < 4 * spread + 0.1 * np.abs(bias)).all(), (mean, bias, spread)
    assert (np.abs(bias[[0, 3, 5]]) > 10 * spread[[0, 3, 5]]).any()


def test_the_shape_of_the_noise_is_that_of_filtered_white_noise(generator):
    """The predicted standard deviation of alpha against a long draw: 2 %, six standard errors of the draw."""
    taps, rate = differentiator(np.sin(np.arange(4000)[:, None] / 40), 200.0, "test"), 200.0
    estimator = EstimatorSpec("e", "savitzky-golay", 2.5, None, 5.0)
    noise = ShapedNoise(np.array([1e-3, 2e-3, 0.0]), taps, rate)
    signal = 1e-3 * generator.normal(size=200_000)
    for half in (taps, estimator.taps(rate)):
        signal = np.convolve(signal, np.concatenate([half[::-1], [0.0], -half]), "valid")
    signal = np.convolve(signal, estimator.filter_taps(rate), "valid")
    np.testing.assert_allclose(noise.alpha(estimator, rate), signal.std() * np.array([1, 2, 0]), rtol=0.02)


def refused(path, words, **declared):
    experiment = Experiment.from_dict({"body": {"r_cg_from_q": ["0 m"] * 3}, "recording": declared})
    with pytest.raises((RunError, RigError, ValueError), match=words) as error:
        load_run(path, experiment.recording)
    assert "\n" not in str(error.value)


def test_motions_that_cannot_be_used(tmp_path, simulated):
    twist, pose = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/PoseStamped"
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(simulated.run.t), 1))
    path = write(tmp_path / "world", simulated, twist, frame="map")
    refused(path, "twist of /motion in world is in the frame 'map', which does not turn")
    path = write(tmp_path / "still", simulated, twist, omega=np.zeros_like(simulated.run.omega))
    refused(path, "angular velocity of /motion in still is zero throughout")
    path = write(tmp_path / "pose", simulated, pose, quaternion=np.where(np.arange(4) == 3, 0.9, level))
    refused(path, "quaternion of /motion in pose at sample 0 has the norm 0.9")
    path = write(tmp_path / "unit", simulated, pose)
    refused(path, "holds poses: remove recording.angular_velocity_unit", angular_velocity_unit="deg/s")
    refused(path, "no topic /imu in .*choose one of /motion", motion_topic="/imu")
    refused(path, "topic /wrench in .* is geometry_msgs/msg/WrenchStamped, not", motion_topic="/wrench")
    crawling = dataclasses.replace(simulated.run, **{n: getattr(simulated.run, n)[:2000:40] for n in ("t", "force", "moment", "omega")})  # fmt: skip
    slow = dataclasses.replace(simulated, run=crawling, rotation=simulated.rotation[:2000:40])
    refused(write(tmp_path / "slow", slow, pose), "samples of /motion in slow: give 64 or more")
