"""The joint estimate: exact without noise, honest with it, and aware of what a motion cannot tell."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimation.joint import single_run
from identify.estimation.joint.cramer_rao_bound import bound
from identify.estimation.joint.joint_model import SLICES
from identify.estimation.joint.joint_pooling import ALIGNED, CALIBRATED, pool
from identify.estimation.joint.priors import Alignment, indices
from identify.estimation.static_poses.centre_result import Centre
from identify.identification import identify
from identify.rigid_body.regressor import omega_r
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import in_band, low_pass
from identify.signals.resample import UniformSpline
from identify.signals.run import RunError
from tests.helpers import joint_studies
from tests.helpers.experiment_bound import bound as uq_bound
from tests.helpers.joint_lab import BAND, shortened
from tests.helpers.recordings import Signals, declare, silenced, write
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.experiment.recording_table import RecordingTable
from uq.files.mistakes import ExperimentError
from uq.files.schema import declared_table
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.time_window import TimeWindow
from uq.sources.source import Source

DELAY, ROTATION = 7e-3, np.array([0.02, -0.03, 0.015])


@pytest.fixture(scope="module")
def brief():
    """The preset with T1 of 20 s."""
    return shortened(Experiment.load("barreto2016"), 20.0)


def imperfect(experiment, *sources):
    """The experiment with only these sources, an IMU that is late and turned, and a gyro's zero."""
    misaligned = (
        Source("late", "omega", "delay", "imu", np.array(0.0), mean=np.array(DELAY)),
        Source("turned", "omega", "misalignment", "imu", np.zeros(3), mean=ROTATION),
        Source("zero", "omega", "bias", "imu", np.zeros(3), mean=np.array([4e-3, -5e-3, 3e-3])),
    )
    return dataclasses.replace(experiment, sources=(*misaligned, *sources))


def calibrated(experiment, sigma=(0.05, *(1.5e-4,) * 3, 0.7, 0.4, 1.4, 0.014, 0.016, 0.019)):
    """A static calibration that is right."""
    values = np.concatenate([[experiment.mass], experiment.r_cg_from_q, np.zeros(6)])
    return Centre(
        values[0], values[1:4], values[4:7], values[7:], np.diag(np.square(sigma)), np.zeros((4, 6)), 18.0, 9.81
    )


def estimate(experiment, run, **options):
    settings = {"centre": calibrated(experiment), "gravity": 9.81, "cg_motion": "still"} | options
    return identify(run, estimator=experiment.estimator("smoothed"), method="joint", **settings)


@pytest.fixture(scope="module")
def silent(brief):
    return simulate(imperfect(brief), "T1")


@pytest.fixture(scope="module")
def silent_run(silent):
    return silent.run


@pytest.fixture(scope="module")
def of_silent_run(brief, silent_run):
    return estimate(brief, dataclasses.replace(silent_run, mounting="A"))


def test_a_silent_run_tells_tensor_delay_and_rotation(brief, of_silent_run):
    """A simulated run with an IMU late by 7 ms and turned by 2.2°; the low-pass is flat within 1e-7."""
    result = of_silent_run
    np.testing.assert_allclose(result.inertia, brief.inertia, atol=5e-7 * brief.inertia.max())
    np.testing.assert_allclose(result.delay.value, [DELAY], atol=1e-8)
    np.testing.assert_allclose(result.rotation.value, ROTATION, atol=1e-6)
    np.testing.assert_allclose(result.r_cg, brief.r_cg_from_q, atol=1e-7)
    assert result.mass == pytest.approx(brief.mass, abs=1e-4)
    content = result.to_dict()
    assert content["method"] == "joint"
    assert content["runs"][0]["mounting"] == "A"
    assert content["delay"]["estimated"]
    assert content["delay"]["prior_share"] < 1e-2
    np.testing.assert_allclose(content["rotation"]["rotation_vector"], ROTATION, atol=1e-6)
    said = repr(result).split("delay of the IMU: ")[1].split(" ± ")[0]
    assert float(said) == pytest.approx(7.0, abs=1e-5)


@pytest.mark.study
def test_a_delay_of_many_samples_is_found(brief):
    """Beyond a quarter of the motion's period, where a start at zero would find another minimum."""
    late = Source("late", "omega", "delay", "imu", np.array(0.0), mean=np.array(0.25))
    run = simulate(dataclasses.replace(brief, sources=(late,)), "T1").run
    result = estimate(brief, run, alignment=Alignment(sigma_delay=0.15))
    np.testing.assert_allclose(result.delay.value, [0.25], atol=1e-6)
    np.testing.assert_allclose(result.inertia, brief.inertia, atol=1e-6 * brief.inertia.max())


@pytest.mark.study
def test_a_delay_beyond_what_is_declared_is_refused(brief):
    late = Source("late", "omega", "delay", "imu", np.array(0.0), mean=np.array(0.15))
    run = simulate(dataclasses.replace(brief, sources=(late,)), "T1").run
    with pytest.raises(RunError, match=r"beyond what is declared of it|does not converge"):
        estimate(brief, run)


@pytest.mark.slow  # and the delay of a silent run: above
def test_between_the_samples_stands_the_trajectorys_own_motion(brief):
    """At any delay: value and slope of the quintic spline against the closed form, at rest of the filter's lag."""
    run = simulate(silenced(brief), "T1").run
    rows = in_band(run, BAND, reach=0.02)
    lag = (len(low_pass(run.rate, BAND, rows.factor)) - 1) / 2 / run.rate
    trajectory = brief.trajectories["T1"].trajectory
    spline = UniformSpline(rows.motion, rows.step)
    omega, alpha = (spline(rows.t + 0.0131, order) for order in (0, 1))
    at = rows.t + 0.0131 + lag
    np.testing.assert_allclose(omega, jax.jit(jax.vmap(trajectory.omega))(at), atol=2e-7)
    np.testing.assert_allclose(alpha, jax.jit(jax.vmap(trajectory.alpha))(at), atol=4e-6)


def test_its_trace_is_silent_where_the_run_is(silent_run, of_silent_run):
    """What figures draw: residuals of nothing but rounding, the motion turned into B."""
    trace = of_silent_run.runs[0].trace
    size = trace.moment_density.max()
    assert trace.residual_density.max() < 1e-5 * size
    speed = np.linalg.norm(trace.omega, axis=1)
    assert speed.max() == pytest.approx(np.linalg.norm(silent_run.omega, axis=1).max(), rel=0.03)


@pytest.mark.parametrize("kind", ["accelerometer", pytest.param("none", marks=pytest.mark.study)])
def test_other_specific_forces_tell_the_tensor_too(brief, silent, kind):
    """An accelerometer at Q without errors; or nothing but the measured force."""
    recorded = silent
    seen = recorded.specific_force @ np.asarray(exponential(jnp.asarray(ROTATION)))
    rate = (len(recorded.run.t) - 1) / recorded.run.t[-1]
    late = np.stack([np.interp(recorded.run.t - DELAY, recorded.run.t, axis) for axis in seen.T], axis=1)
    run = dataclasses.replace(recorded.run, specific_force=late if kind == "accelerometer" else None)
    result = estimate(brief, run, cg_motion=None)
    assert rate > 0
    np.testing.assert_allclose(result.inertia, brief.inertia, atol=3e-5 * brief.inertia.max())
    np.testing.assert_allclose(result.delay.value, [DELAY], atol=5e-6)
    word = {"accelerometer": "is the accelerometer's", "none": "there is no accelerometer"}[kind]
    assert any(word in text for text in result.assumptions)


@pytest.mark.study
def test_noise_that_hides_the_alignment_is_said(brief, silent_run, generator):
    """Ten thousand times the paper's noise on force and moment: the delay is then, for the greater part, what was declared."""
    loud = dataclasses.replace(
        silent_run,
        force=silent_run.force + 5e4 * generator.standard_normal(silent_run.force.shape),
        moment=silent_run.moment + 4e3 * generator.standard_normal(silent_run.moment.shape),
    )
    result = estimate(brief, loud)
    assert result.delay.prior_share[0] > 0.5
    assert any("the motion does not determine the delay" in text for text in result.warnings)
    assert 0.01 < result.delay.standard_uncertainty[0] < 0.02


def test_rotations_about_one_axis_are_refused(short):
    """The first segment of T3, about b1."""
    run = simulate(silenced(short), "T3").run
    with pytest.raises(RunError, match=r"does not identify .*: rotate about more axes"):
        estimate(short, run.between(0.0, run.t[-1] / 3))


def test_pooled_runs_are_one_large_problem(brief):
    """Two runs: the Schur complements against the inverse of the whole arrow matrix, the prior counting once."""
    laboratory, rng = joint_studies.own_laboratory(brief), np.random.default_rng(4)
    calibration = laboratory.calibration(rng)
    runs = [laboratory.estimate(laboratory.run(rng), calibration, Alignment()) for _ in range(2)]
    pooled = pool([run.solved for run in runs], (*ALIGNED, *CALIBRATED))
    root = np.asarray(runs[0].prior.root)
    common = np.abs(root[indices((*ALIGNED, *CALIBRATED))]).max(axis=0) > 0
    shared, separate = int(common.sum()), int((~common).sum())
    whole, right = np.zeros((shared + 2 * separate,) * 2), np.zeros(shared + 2 * separate)
    counted = np.asarray(runs[0].prior.counted)
    for k, run in enumerate(runs):
        where = np.concatenate([np.arange(shared), shared + k * separate + np.arange(separate)])
        order = np.concatenate([np.flatnonzero(common), np.flatnonzero(~common)])
        data = np.asarray(run.fit.information)
        priors = np.diag(np.where(common, 0.0, counted))
        whole[np.ix_(where, where)] += (data + priors)[np.ix_(order, order)]
        right[where] += ((data + np.diag(counted)) @ np.asarray(run.fit.z))[order]
    whole[:shared, :shared] += np.diag(counted[common])
    inverse = np.linalg.inv(whole)
    tensor = SLICES["inertia"]
    expected = root[tensor][:, common] @ inverse[:shared, :shared] @ root[tensor][:, common].T
    value = root[tensor][:, common] @ (inverse @ right)[:shared]
    np.testing.assert_allclose(pooled.theta[0][tensor], value, atol=1e-9)
    np.testing.assert_allclose(pooled.covariance[tensor, tensor] / pooled.scatter**2, expected, rtol=0.5, atol=1e-8)
    assert pooled.scatter < 1.6  # 72 squares: the mean square exceeds 2.5 once in a million


def test_runs_of_a_mounting_share_what_it_draws(brief):
    """Three runs of two mountings, each with a turn and a delay of the IMU: against the solution of the whole matrix."""
    laboratory, rng = joint_studies.own_laboratory(brief), np.random.default_rng(5)
    calibration, drawn, runs = laboratory.calibration(rng), ("rotation", "delay"), []
    for name in "ABA":
        estimated = laboratory.estimate(laboratory.run(rng), calibration, Alignment())
        runs.append(dataclasses.replace(estimated, run=dataclasses.replace(estimated.run, mounting=name)))
    shared = tuple(name for name in (*ALIGNED, *CALIBRATED) if name not in drawn)
    pooled = pool([run.solved for run in runs], shared, drawn)
    root, counted = runs[0].prior.root, runs[0].prior.counted
    common, mounted = (np.abs(root[indices(names)]).max(axis=0) > 0 for names in (shared, drawn))
    level = np.where(common, 0, np.where(mounted & ~common, 1, 2))
    keys = [(at, [0, run.run.mounting, k][level[at]]) for k, run in enumerate(runs) for at in range(len(level))]
    places = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    whole, right = np.zeros((len(places),) * 2), np.zeros(len(places))
    for (at, _), place in places.items():
        whole[place, place] = counted[at]
    for k, run in enumerate(runs):
        where = [places[key] for key in keys[k * len(level) : (k + 1) * len(level)]]
        whole[np.ix_(where, where)] += run.fit.information
        right[where] += (run.fit.information + np.diag(counted)) @ run.fit.z
    solution = np.linalg.solve(whole, right)
    for k, theta in enumerate(pooled.theta):
        z = solution[[places[key] for key in keys[k * len(level) : (k + 1) * len(level)]]]
        scale = np.maximum(np.linalg.norm(root, axis=1), 1e-300)
        np.testing.assert_allclose((theta - runs[k].prior.theta(z)) / scale, 0, atol=1e-7)


@pytest.mark.parametrize("sigma_still", [pytest.param(0.0, marks=pytest.mark.study), 3e-3])
def test_the_bound_of_few_unknowns_is_gauss_markovs(brief, sigma_still):
    """Tensor and the point at rest, all else known: the inverse of the sum over the samples of ``Aᵀ C⁻¹ A``, in NumPy."""
    run = simulate(silenced(brief), "T1").run
    alignment = Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=0.0, sigma_tilt=0.0)
    sigma = np.array([5.0, 5.0, 10.0, 0.38, 0.46, 0.46])
    least = bound(
        run, brief.body, band=BAND, noise=sigma, gyro_noise=np.full(3, 1e-12), static_covariance=np.zeros((10, 10)),
        alignment=alignment, gravity=brief.gravity, sigma_still=sigma_still,
    )  # fmt: skip
    trajectory = brief.trajectories["T1"].trajectory
    t = jnp.asarray(run.t)
    omega, alpha = (np.asarray(jax.jit(jax.vmap(signal))(t)) for signal in (trajectory.omega, trajectory.alpha))
    rows = np.zeros((len(t), 6, 9))
    rows[:, 3:, :6] = np.asarray(jax.jit(jax.vmap(omega_r))(jnp.asarray(omega), jnp.asarray(alpha)))
    for axis, e in enumerate(np.eye(3)):
        force = float(brief.mass) * (np.cross(alpha, e) + np.cross(omega, np.cross(omega, e)))
        rows[:, :, 6 + axis] = np.hstack([force, np.cross(np.asarray(brief.r_cg_from_q), force)])
    prior = np.diag([0.0] * 6 + [1 / max(sigma_still, 1e-9) ** 2] * 3)
    expected = np.linalg.inv(np.einsum("nji,j,njk->ik", rows, 1 / sigma**2, rows) + prior)[:6, :6]
    tensor = SLICES["inertia"]
    np.testing.assert_allclose(least.covariance[tensor, tensor], expected, atol=5e-3 * expected.max())


@pytest.mark.study
def test_the_bound_of_the_sources_experiment_is_the_derived_one(preset):
    """Alignment known, and 3° and 10 ms: derived by other means as 2.6 (moments), 1.67 and 2.04 (products) g·m²."""
    least = uq_bound(preset, "T1", band=BAND)
    late = Source("late", "omega", "delay", "imu", np.array(0.01))
    turned = Source("turned", "omega", "misalignment", "imu", np.full(3, np.radians(3)))
    free = uq_bound(dataclasses.replace(preset, sources=(*preset.sources, late, turned)), "T1", band=BAND)
    np.testing.assert_allclose(1e3 * np.array(least.three_sigma), [2.6, 1.67], rtol=0.01)
    np.testing.assert_allclose(1e3 * np.array(free.three_sigma), [2.6, 2.04], rtol=0.01)
    assert "delay" not in least.free
    assert "rotation" in free.free
    assert free.to_dict()["prior_share"]["delay"][0] < 1e-3
    assert "3σ at least" in repr(free)


@pytest.mark.study
def test_the_price_of_the_point_at_rest(preset):
    """At most 4 % of any component's least uncertainty, however little is known of it."""
    of = {}
    for sigma in (0.0, 3e-4, 1e-3, 3e-3, 1e-2):
        missed = Source("missed", "r_cg_from_omb", "bias", "rig", np.full(3, sigma))
        least = uq_bound(dataclasses.replace(preset, sources=(*preset.sources, missed)), "T1")
        of[sigma] = 3e3 * least.standard_uncertainty("inertia")
        print(f"{1e3 * sigma:g} mm", of[sigma].round(3))
    assert (np.diff(list(of.values()), axis=0) > -1e-3).all()
    assert (of[1e-2] < 1.045 * of[0.0]).all()


@pytest.mark.slow  # of one run and of several: the bound and pooled runs above
def test_intervals_of_a_few_laboratories_cover(brief):
    """6 runs x 13 intervals: were the 13 of a run wholly correlated, 95 % has a standard error of 8.9 %."""
    errors, sigma, shares = joint_studies.laboratories(brief, [3], 6)
    covered = np.abs(errors) < 1.96 * sigma
    assert covered.mean() > 0.95 - 2 * 0.089
    assert np.abs(errors.mean(axis=1) / sigma.mean(axis=1) * np.sqrt(6)).max() < 4  # 13 means: 1 in 1,200
    assert ((shares >= 0) & (shares <= 1)).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"offsets": "still"}, "finds offsets itself"),
        ({"alignment": {"sigma_delay": -1.0}}, "sigma_delay of the alignment is -1.0"),
        ({"alignment": {"delay": float("nan")}}, "delay of the alignment is nan"),
    ],
)
def test_what_cannot_be_is_refused(brief, silent_run, options, words):
    with pytest.raises(RunError, match=words):
        estimate(brief, silent_run, **{k: Alignment(**v) if isinstance(v, dict) else v for k, v in options.items()})


def test_a_run_that_is_too_short_is_refused(brief, silent_run):
    with pytest.raises(RunError, match=r"too short for the joint estimate of a motion of 1.55 Hz"):
        estimate(brief, silent_run.between(5.0, 6.5))


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("method", "best", "choose one of gls, joint, source"),
        ("cg_motion", "moving", "choose one of still"),
        ("sigma_delay", 0.02, "recording.sigma_delay"),
        ("sigma_delay", "-20 ms", "write zero or more"),
        ("sigma_delay", "1 min", "repair the clocks first"),
        ("sigma_rotation", "5 Hz", "recording.sigma_rotation"),
        ("sigma_rotation", "90 deg", "declare imu_rotation_to_body"),
        ("sigma_gyro_bias", ["1 rad/s"], "write three values"),
    ],
)
def test_a_recordings_wrong_keys_are_named(key, value, words):
    with pytest.raises(ExperimentError, match=words):
        declared_table("recording", {key: value}, RecordingTable)


@pytest.mark.study
def test_an_experiment_asks_for_the_joint_estimate(silent, tmp_path):
    """From files: a simulated run, its stated centre, delay and rotation as result.json has them."""
    silent.write(tmp_path / "run.mcap")
    (tmp_path / "e.toml").write_text(
        EXPERIMENT.format(extra='method = "joint"\ncg_motion = "still"\nsigma_tilt = "2 deg"')
    )
    experiment = Experiment.load(tmp_path / "e.toml")
    content = identify_files([tmp_path / "run.mcap"], experiment, windows=[TimeWindow(0.0, 19.99)]).to_dict()
    assert content["method"] == "joint"
    assert content["delay"]["value"] == pytest.approx(DELAY, abs=1e-5)
    np.testing.assert_allclose(content["rotation"]["rotation_vector"], ROTATION, atol=2e-4)


def test_the_command_refuses_offsets_at_rest_in_one_line(silent, tmp_path, capsys):
    silent.write(tmp_path / "run.mcap")
    (tmp_path / "e.toml").write_text(EXPERIMENT.format(extra='method = "joint"\noffsets = "still"'))
    assert main(["identify", str(tmp_path / "run.mcap"), "--experiment", str(tmp_path / "e.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


EXPERIMENT = """
[body]
mass = "19.7 kg"
r_cg_from_q = ["0 mm", "0 mm", "53 mm"]
[platform]
gravity = "9.81 m/s^2"
[[estimator]]
name = "smoothed"
method = "ols"
differentiator = "savitzky-golay"
band = "1.55 Hz"
[[source]]
name = "r_cg"
target = "r_cg"
kind = "bias"
sigma = ["0.15 mm", "0.13 mm", "0.16 mm"]
distribution = "normal"
group = "cg"
reference = "static poses"
[recording]
wrench = "on_body"
{extra}
"""


@pytest.mark.usefixtures("undrawn", "unjudged")
def test_the_estimate_does_not_depend_on_where_the_search_starts(brief, tmp_path, monkeypatch):
    """The weights are from a first solution: were it good to 1e-3 u alone, the estimate would keep 3e-5 u of its start."""
    path, declared = write(tmp_path / "run.mcap", Signals.of(simulate(brief, "T1"))), declare(brief)
    start = single_run.search_start
    plain = identify_files([path], declared, method="joint")
    for step in (0.01, -0.3):
        monkeypatch.setattr(single_run, "search_start", lambda *given, by=step: start(*given) + by)
        other = identify_files([path], declared, method="joint")
        assert np.abs((other.inertia - plain.inertia) / plain.standard_uncertainty).max() < 1e-6
