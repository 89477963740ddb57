"""Platform motions of T1 to T4 and of multisines: what moves, what keeps still, what the limits say."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from identify.motion.leg_limits import Limits, effort, needs, peaks, platform_motion, shares
from identify.motion.stewart_platform import Pose, lengths
from identify.motion.trajectory import sample
from identify.rigid_body.dynamics import specific_force_at
from tests.helpers.multisines import unstaged_multisine
from uq.experiment.experiment import Experiment
from uq.experiment.multisine_table import COLUMNS, multisine_csv
from uq.experiment.platform_table import GEOMETRIES, LimitsTable, PlatformTable
from uq.files.mistakes import ExperimentError
from uq.files.schema import declared_table
from uq.monte_carlo.campaign.simulation import simulate


@pytest.fixture(scope="module")
def multisine():
    return unstaged_multisine()


GRAVITY = jnp.array(9.81)


def named(name):
    return declared_table("platform", {"geometry": name}, PlatformTable).legs


def motion_of(preset, name, platform, rate=400.0, part=None):
    spec = preset.trajectories[name]
    t = jnp.arange(*(part or (0.0, spec.duration)), 1 / rate)
    still = jnp.asarray(preset.r_cg_from_omb) if spec.still == "cg" else jnp.zeros(3)
    return platform_motion(platform, spec.trajectory, t, still)


def test_the_cg_of_t1_stays_within_a_micrometre(preset):
    """Position from the accelerations of (12), integrated twice with nothing to hold it."""
    motion = motion_of(preset, "T1", named("assumed-source-size"))
    velocity = cumulative_simpson(motion.twist.acceleration, x=np.asarray(motion.t), axis=0, initial=0)
    position = cumulative_simpson(velocity, x=np.asarray(motion.t), axis=0, initial=0) + np.array([0, 0, 0.55])
    cg = position + np.einsum("nij,j->ni", motion.pose.rotation, preset.r_cg_from_omb)
    assert np.abs(cg - cg[0]).max() < 1e-6
    assert np.abs(position - motion.pose.position).max() < 1e-6


def test_a_wrong_cg_moves_by_its_own_error_turned(preset):
    """The paper's CG error, one standard deviation on each axis: some tens of micrometres."""
    error = np.array([0.15e-3, 0.13e-3, 0.16e-3])
    motion = motion_of(preset, "T1", named("assumed-source-size"))
    at_cg = np.asarray(motion.pose.position) + np.einsum(
        "nij,j->ni", motion.pose.rotation, preset.r_cg_from_omb + error
    )
    moved = np.linalg.norm(at_cg - at_cg[0], axis=1).max()
    furthest = Rotation.from_matrix(np.asarray(motion.pose.rotation)).magnitude().max()
    assert 1e-6 < moved <= np.linalg.norm(error) * furthest * 1.001


@pytest.mark.parametrize("name", ["T1", *(pytest.param(name, marks=pytest.mark.slow) for name in ("T2", "T3", "T4"))])
def test_speeds_and_accelerations_are_those_of_the_lengths(preset, name):
    platform = named("assumed-source-size")
    motion = motion_of(preset, name, platform, rate=8000.0, part=(20.0, 29.0))
    asked = effort(platform, preset.body, jnp.asarray(preset.r_cg_from_omb), motion, GRAVITY)
    length, h = np.asarray(asked.legs.length), 1 / 8000
    np.testing.assert_allclose((length[2:] - length[:-2]) / (2 * h), asked.legs.speed[1:-1], atol=1e-5)
    second = (length[2:] - 2 * length[1:-1] + length[:-2]) / h**2
    np.testing.assert_allclose(second, asked.legs.acceleration[1:-1], atol=1e-4)


def test_the_cell_carries_what_the_campaigns_cell_reads(preset):
    platform, spec = named("assumed-source-size"), preset.trajectories["T2"]
    motion = motion_of(preset, "T2", platform)
    asked = effort(platform, preset.body, jnp.asarray(preset.r_cg_from_omb), motion, GRAVITY)
    same = sample(spec.trajectory, motion.t, r_cg_from_still=np.array([0, 0, 0.11]), gravity=np.array(9.81))
    np.testing.assert_allclose(asked.cell_force.T, 19.7 * same.specific_force_cg, atol=1e-12)


def test_a_motion_needs_just_what_it_uses(preset):
    platform = named("assumed-source-size")
    motion = motion_of(preset, "T1", platform)
    asked = effort(platform, preset.body, jnp.asarray(preset.r_cg_from_omb), motion, GRAVITY)
    needed = needs(asked)._replace(bandwidth=5.0)
    listed = peaks(asked, needed, motion.t)
    assert {peak.quantity for peak in listed} == {"length", "speed", "acceleration", "force"}
    np.testing.assert_allclose([peak.share for peak in listed], 1.0, rtol=1e-12)
    half = needed._replace(speed=needed.speed / 2)
    worst = peaks(asked, half, motion.t)[0]
    leg = np.abs(np.asarray(asked.legs.speed))
    assert str(worst) == f"speed of leg {worst.channel + 1} at {worst.t:.3f} s: 200.0 % of its limit"
    assert leg[int(np.argmin(np.abs(motion.t - worst.t))), worst.channel] == leg[:, worst.channel].max()


def test_every_limit_is_looked_at(preset):
    platform = named("assumed-source-size")
    motion = motion_of(preset, "T2", platform)
    asked = effort(platform, preset.body, jnp.asarray(preset.r_cg_from_omb), motion, GRAVITY)
    limits = declared_table("limits", {
        "length": ["0.5 m", "0.7 m"], "speed": "1 m/s", "acceleration": "2 m/s^2", "force": "500 N",
        "joint_angle": "30 deg", "cell_force": ["200 N", "200 N", "400 N"], "cell_moment": ["20 N*m"] * 3,
        "gyro_range": "100 deg/s", "body_acceleration": "1 g_n", "bandwidth": "5 Hz",
    }, LimitsTable).limits.figures  # fmt: skip
    used = shares(asked, limits)
    assert len(peaks(asked, limits, motion.t)) == len(used) == 9
    np.testing.assert_allclose(
        used["body_acceleration"][:, 0] * 9.80665,
        jnp.linalg.norm(asked.cell_force / 19.7 - 9.81 * motion.pose.rotation[:, 2], axis=1),
        atol=1e-12,
    )
    assert not peaks(asked, Limits.none(), motion.t)


def test_installed_platforms_are_at_home_where_they_are_drawn():
    """Leg lengths at home by the law of cosines: the ring's own closed form."""
    for name, radii, angle, height in (
        ("assumed-source-size", (0.45, 0.30), 38.0, 0.52),
        ("simscape-demonstration", (3, 1), 47.5, 2),
    ):
        platform = named(name)
        square = radii[0] ** 2 + radii[1] ** 2 - 2 * radii[0] * radii[1] * np.cos(np.radians(angle)) + height**2
        np.testing.assert_allclose(lengths(platform, platform.home_pose), np.sqrt(square), rtol=1e-12)
    platform = named("linuxcnc-genhexkins")
    first = 0.0254 * np.linalg.norm([22.95 - 1.0, 11.5 - 13.25, 20.0])
    np.testing.assert_allclose(lengths(platform, platform.home_pose)[0], first, rtol=1e-12)
    assert set(GEOMETRIES) == {"assumed-source-size", "linuxcnc-genhexkins", "simscape-demonstration"}


def document(preset, tmp_path, multisine, **changes):
    (tmp_path / "amplitudes.csv").write_text(multisine_csv(multisine))
    trajectory = {
        "kind": "multisine",
        "amplitudes": "amplitudes.csv",
        "duration": "20 s",
        "rate": "400 Hz",
        "ramp": "3 s",
    }
    return {**preset.document, "trajectory": {"D": trajectory | changes}}


def test_amplitudes_come_back(preset, tmp_path, multisine):
    spec = Experiment.from_dict(document(preset, tmp_path, multisine), tmp_path).trajectories["D"]
    assert spec.still == "omb"
    for name in ("frequency", "cosine", "sine", "duration", "ramp"):
        np.testing.assert_array_equal(getattr(spec.trajectory, name), getattr(multisine, name))


@pytest.mark.slow
def test_a_moving_cg_passes_through_the_campaign(preset, tmp_path, multisine):
    """Without errors the estimate is the truth, though the centre of gravity moves."""
    from uq import montecarlo

    experiment = Experiment.from_dict(document(preset, tmp_path, multisine), tmp_path)
    one = dataclasses.replace(experiment.sources[0], sigma=np.full(3, 1e-12))
    quiet = dataclasses.replace(experiment, sources=(one,))
    errors = montecarlo(quiet, trials=2, estimators="smoothed").total_errors("D", "smoothed")
    np.testing.assert_allclose(errors, 0, atol=4e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"amplitudes": "other.csv"}, "no file .*other.csv at trajectory.D.amplitudes"),
        ({"still": "cg"}, "trajectory.D.still is 'cg': choose one of omb"),
        ({"ramp": "11 s"}, "at most half"),
        ({"amplitudes": 3}, "trajectory.D.amplitudes"),
    ],
)
def test_bad_multisines(preset, tmp_path, multisine, change, message):
    with pytest.raises(ExperimentError, match=message):
        Experiment.from_dict(document(preset, tmp_path, multisine, **change), tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "names other columns"),
        (",".join(COLUMNS) + "\n1,2\n", "not 13 finite numbers"),
        (",".join(COLUMNS) + "\n" + ",".join(["1"] * 12 + ["nan"]) + "\n", "not 13 finite numbers"),
        (",".join(COLUMNS) + "\n", "holds no frequency|not 13"),
        (",".join(COLUMNS) + "\n" + ",".join(["0"] * 13) + "\n", "not above zero"),
    ],
)
def test_bad_amplitudes(preset, tmp_path, multisine, text, message):
    content = document(preset, tmp_path, multisine)
    (tmp_path / "amplitudes.csv").write_text(text)
    with pytest.raises(ExperimentError, match=message):
        Experiment.from_dict(content, tmp_path)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"geometry": "mine"}, "choose one of assumed-source-size"),
        ({"geometry": {"base": 1, "joints": 2, "home": ["0 m"] * 3}}, "platform.geometry.base is 1: write six points"),
        ({"geometry": {"base": {"radius": "1 kg", "half_angle": "3 deg"}}}, "platform.geometry.base.radius"),
        ({"limits": {"speed": "0 m/s"}}, "platform.limits.speed"),
        ({"limits": {"length": ["2 m", "1 m"]}}, "write the lower limit first"),
        ({"limits": {"cell_force": ["1 N", "1 N", "-1 N"]}}, "platform.limits.cell_force"),
        ({"limits": {"sped": "1 m/s"}}, "platform.limits.sped"),
        (
            {
                "geometry": {
                    "base": {"radius": "1 m", "half_angle": "3 deg"},
                    "joints": {"radius": "1 m", "half_angle": "3 deg"},
                    "home": ["0 m"] * 3,
                    "rod": {"mass": "-1 kg"},
                }
            },
            "platform.geometry.rod.mass is '-1 kg': write zero or more",
        ),
    ],
)
def test_bad_platforms(preset, table, message):
    with pytest.raises(ExperimentError, match=message):
        Experiment.from_dict({**preset.document, "platform": table})


def test_pose_is_differentiable_through_the_lengths():
    platform = named("assumed-source-size")
    slope = jax.jacobian(lambda p: lengths(platform, Pose(p, jnp.eye(3))))(platform.home_pose.position)
    assert np.isfinite(slope).all()


def test_a_simulated_multisines_accelerometer_agrees_with_its_load_cell(preset, tmp_path, multisine):
    """Without errors, the force is the mass times the specific force at Q carried to the centre of gravity."""
    written = document(preset, tmp_path, multisine)
    experiment = dataclasses.replace(Experiment.from_dict(written, folder=tmp_path), sources=())
    simulated = simulate(experiment, "D")
    alpha = np.gradient(simulated.run.omega, 1 / 400, axis=0)
    at_cg = specific_force_at(simulated.specific_force, simulated.run.omega, alpha, preset.r_cg_from_q)
    np.testing.assert_allclose(at_cg[1:-1], simulated.run.force[1:-1] / preset.mass, atol=2e-4)
