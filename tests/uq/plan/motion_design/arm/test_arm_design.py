"""A short design for the arm of uq/examples: its limits, its files, its simulation, the command."""

import contextlib
import copy
import io
import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import uq.plan.motion_design.arm.arm_design as arm_design
import uq.plan.motion_design.arm.arm_report
from identify.motion.limit_peaks import Peak
from identify.motion.optimiser import Optimum
from identify.motion.serial_arm.joint_series import JointSeries
from identify.motion.serial_arm.payload_information import about_cg, about_q
from identify.rigid_body.regressor import wrench_regressor
from rig.exceptions import RigError
from tests.helpers.bags import STORE, header, wrench, write_rosbag2
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm_design import design_arm, goal_function, random_series
from uq.plan.motion_design.arm.arm_report import arm_report, joint_files
from uq.plan.motion_design.arm.joint_search import SPARE, JointSearch
from uq.plan.motion_design.arm.largest_motion import largest_size
from uq.plan.motion_design.arm.mujoco_model import loaded_model
from uq.plan.motion_design.arm.mujoco_run import simulated
from uq.runs.identification.identify_files import identify_files

pytestmark = pytest.mark.usefixtures("results_follow_their_schema")

mujoco = pytest.importorskip("mujoco")

JOINTS, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
EXPERIMENTS = Path(__file__).parents[5] / "uq" / "examples"


@pytest.fixture(scope="module")
def experiment():
    document = copy.deepcopy(dict(Experiment.load(EXPERIMENTS / "arm.toml").document))
    document["platform"] |= {"rate": "200 Hz", "limits": {**document["platform"]["limits"], "bandwidth": "1.5 Hz"}}
    return Experiment.from_dict(document, EXPERIMENTS)


@pytest.fixture(scope="module")
def design(experiment):
    """Another random series in the place of the search, whose gradient takes twenty seconds to compile."""
    other = lambda search, *_, seed, **__: (random_series(search, 1, seed + 1), [(1.0, 0.0)])  # noqa: E731
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arm_design, "searched", other)
        return design_arm(experiment, duration=8.0, period=2.0, ramp=1.0, random=1)


@pytest.fixture(scope="module")
def searched(experiment):
    """Searched on one grid alone: to compile another takes longer than all the rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arm_design, "CYCLES", 0)
        return design_arm(experiment, duration=8.0, period=2.0, ramp=1.0, starts=1, rounds=6, steps=25, random=1)


@pytest.fixture(scope="module")
def report(design):
    return arm_report(design, rehearsal=0.5)


def test_a_motion_is_written_before_it_is_simulated(design, tmp_path, capsys, monkeypatch):
    def fails(*_):
        assert {path.suffix for path in (tmp_path / "out").iterdir()} >= {".csv", ".yaml"}
        raise ExperimentError("the simulation fails")

    monkeypatch.setattr(arm_design, "design_arm", lambda *_, **__: design)
    monkeypatch.setattr(uq.plan.motion_design.arm.arm_report, "simulated", fails)
    arguments = [str(EXPERIMENTS / "arm.toml"), "--rehearsal", "0.5", "--out", str(tmp_path / "out")]
    assert main(["design", *arguments]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "error: the simulation fails"
    assert (tmp_path / "out" / "motion.csv").read_bytes() == joint_files(design.limits.arm, design.designed.series)[
        "motion.csv"
    ]
    assert (tmp_path / "out" / "rehearsal.joint_trajectory.yaml").exists()


@pytest.mark.parametrize("found", ["design", pytest.param("searched", marks=pytest.mark.slow)])
def test_no_limit_is_exceeded_on_a_finer_grid(found, request):
    """Ten times finer than the search's grid of ten instants a period, over the whole run; torques by MuJoCo."""
    design = request.getfixturevalue(found)
    arm, body = design.limits.arm, design.experiment.body
    t = np.linspace(0, 8, 8 * 15 * 10 + 1)
    q, speed, acceleration = map(np.asarray, design.designed.series.states(t))
    np.testing.assert_allclose(q[[0, -1]], np.tile(arm.home, (2, 1)), atol=1e-12)
    np.testing.assert_allclose(speed[[0, -1]], 0, atol=1e-12)
    met = 1 + 2e-3  # the largest use lies between the instants of two grids
    assert (q >= arm.position[:, 0]).all()
    assert (q <= arm.position[:, 1]).all()
    assert (np.abs(speed) <= met * arm.speed).all()
    assert (np.abs(acceleration) <= met * arm.acceleration).all()
    model = loaded_model(arm, body, 9.81)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data, largest, torque = mujoco.MjData(model), np.array([150, 150, 150, 28, 28, 28]), []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(q, speed, acceleration, strict=True):
        mujoco.mj_inverse(model, data)
        torque.append(data.qfrc_inverse / largest)
    assert (np.abs(torque) <= met).all()
    effort = max(peak.share for peak in design.designed.peaks if peak.quantity == "effort")
    np.testing.assert_allclose(np.abs(torque).max(), effort, rtol=2e-3)
    assert not list(design.limits.clearance.touches(q[::5]))
    assert design.designed.peaks[0].share > 0.97, design.designed.peaks[0]  # the limits are used


@pytest.mark.slow
def test_the_design_beats_common_practice(searched):
    averages = {name: candidate.averages for name, candidate in searched.motions.items()}
    for what in ("moments", "products"):
        assert averages["designed"][what] < 0.8 * averages["random"][what]
        assert averages["designed"][what] < 0.8 * averages["single"][what]
    goal = goal_function("all", searched.experiment, searched.motions["random"].covariance)
    np.testing.assert_allclose(goal(searched.designed.covariance), searched.starts[0][0])  # of no further search


def unknowns_of(search, series):
    return (np.stack([series.cosine, series.sine]) / search.unit).ravel()


def test_the_search_sees_what_a_motion_promises_and_uses(design):
    """Its goal and limits without their gradient, at a motion that was settled: the grid of the search is ten times coarser."""
    search = JointSearch(design.limits, design.noise, duration=8.0, period=2.0, ramp=1.0)
    candidate = design.designed
    lagrangian = search.lagrangian(arm_design.determinant)
    goal, limits = jax.jit(lagrangian.goal)(unknowns_of(search, candidate.series))
    np.testing.assert_allclose(np.exp(goal), np.linalg.det(candidate.covariance) ** (1 / 20), rtol=1e-6)
    largest = candidate.peaks[0].share
    assert 0.9 * largest < float(limits.max()) + 1 < largest + SPARE["clearance"]


@pytest.mark.slow
def test_the_best_end_of_the_searches_is_the_design(design, monkeypatch):
    """Of two starts that were not moved; the gradient is not compiled, and no further search follows."""
    search = JointSearch(design.limits, design.noise, duration=8.0, period=2.0, ramp=1.0)
    unmoved = lambda lagrangian, first, *_, **__: [Optimum(start, 0.0, -0.1, 0) for start in first.values()]  # noqa: E731
    monkeypatch.setattr(arm_design, "optima", unmoved)
    monkeypatch.setattr(arm_design, "CYCLES", 0)
    measure = goal_function("all", design.experiment, design.motions["random"].covariance)
    options = {"starts": 2, "seed": 0, "rounds": 1, "steps": 1, "tell": lambda *_: None}
    best, ends = arm_design.searched(search, measure, **options)
    worth = [value for value, _ in ends]
    assert np.ptp(worth) > 0.01 * min(worth)
    np.testing.assert_allclose(best.measured_by(measure), min(worth))


def test_the_promise_is_that_of_the_simulated_samples(design, report):
    """Least squares on all samples of MuJoCo's run: without noise the truth; its covariance is what was promised."""
    run, body = report.run, design.experiment.body
    motion = jax.tree.map(jnp.asarray, design.limits.tool(run.joints))
    rows = np.asarray(jax.jit(jax.vmap(wrench_regressor))(*motion))
    whiten = np.diag([10.0] * 3 + [200.0] * 3)  # 0.1 N and 5 mN·m
    columns = np.concatenate([np.concatenate([whiten @ row, whiten], axis=1) for row in rows])
    estimate = np.linalg.lstsq(columns, (run.wrench @ whiten).ravel())[0]
    np.testing.assert_allclose(about_cg(jnp.asarray(estimate[:10])), [2, 0.02, -0.03, 0.048, *body.inertia], rtol=1e-6)
    at_q = np.linalg.inv(columns.T @ columns)[:10, :10]
    np.testing.assert_allclose(np.diag(at_q)[0], design.designed.covariance[0, 0], rtol=0.05)  # tracking error


@pytest.mark.slow
def test_undeclared_errors_of_the_load_cell_move_the_least_squares_of_the_same_samples(design):
    """Each of the 36 elements of its matrix alone, at the typical figures of docs/how-to/identify.md."""
    motion = design.limits.tool(design.designed.series.sampled(np.linspace(0, 8, 801)))
    rows = np.asarray(jax.vmap(wrench_regressor)(*map(jnp.asarray, motion)))
    body, whiten = design.experiment.body, np.diag([10.0] * 3 + [200.0] * 3)  # 0.1 N and 5 mN·m
    fit = np.linalg.pinv(np.concatenate([np.concatenate([whiten @ row, whiten], axis=1) for row in rows]))[:10]
    truth = fit @ (rows @ about_q(body) @ whiten).ravel()
    wrench = rows @ truth
    largest = np.repeat([np.abs(wrench[:, :3]).max(), np.abs(wrench[:, 3:]).max()], 3)

    def moved(matrix):
        change = about_cg(jnp.asarray(truth + fit @ (wrench @ (1e-4 * matrix).T @ whiten).ravel()))
        return np.asarray(change - about_cg(jnp.asarray(truth))) / 1e-4

    def element(i, j):
        return np.outer(np.eye(6)[i], np.eye(6)[j])

    common = [0.0025 * moved(np.diag(np.repeat(which, 3))) for which in ([1.0, 0.0], [0.0, 1.0])]
    by_axis = [0.0025 * moved(element(i, i)) for i in range(6)]
    crossed = [0.0015 * largest[i] / largest[j] * moved(element(i, j)) for i in range(6) for j in range(6) if i != j]
    turned = [
        0.005 * moved(sum(element(3 * k + i, 3 * k + j) - element(3 * k + j, 3 * k + i) for k in range(2)))
        for i, j in [(1, 2), (2, 0), (0, 1)]
    ]
    variance = np.square([*common, *by_axis, *crossed, *turned]).sum(axis=0)
    added = np.diag(design.with_undeclared.covariance - design.designed.covariance)
    np.testing.assert_allclose(added, variance, rtol=0.01)


def test_mujoco_follows_and_touches_nothing(report):
    run = report.run
    assert not run.contacts
    assert (run.tracking_error > 1e-5).all(), run.tracking_error
    assert (run.tracking_error < 0.05).all(), run.tracking_error
    assert {peak.quantity for peak in run.peaks} == {"position", "speed", "acceleration", "effort"}
    assert max(peak.share for peak in run.peaks if peak.quantity == "speed") < 1.1


def test_simulated_speeds_and_accelerations_are_the_derivatives_of_the_positions(report):
    """By a cubic spline; half a step of the simulation, 1.25 ms, would shift speeds by 1e-3 of the acceleration."""
    run = report.run
    spline, largest = CubicSpline(run.t, run.joints.position), np.abs(run.joints.acceleration).max()
    np.testing.assert_allclose(spline(run.t, 1), run.joints.speed, atol=3e-4 * largest)
    np.testing.assert_allclose(spline(run.t, 2)[5:-5], run.joints.acceleration[5:-5], atol=3e-3 * largest)


def test_a_contact_is_seen(design):
    """A motion that leans the arm to the floor within its joints' limits."""
    arm, still = design.limits.arm, np.zeros((6, 1))
    lean = still + np.array([[0.0], [1.9], [0.0], [0.0], [0.0], [0.0]])
    series = JointSeries(arm.home, np.zeros(1), lean, still, np.zeros(1), np.array([4.0]), np.array(1.9))
    run = simulated(arm, design.experiment.body, 9.81, series)
    assert run.contacts
    assert "touch at" in run.contacts[0]


def test_the_experiment_that_comes_with_it_identifies_the_payload(design, report, tmp_path):
    """What MuJoCo simulated, as a robot would publish it: joints, and the reaction on the sensor with its noise."""
    for name, content in report.files().items():
        (tmp_path / name).write_bytes(content)
    run, items, random = report.run, [], np.random.default_rng(3)
    reaction = -run.wrench + random.normal(size=run.wrench.shape) * np.repeat([0.1, 0.005], 3)
    for k, time in enumerate((10**9 + np.round(1e9 * run.t).astype(int)).tolist()):
        states = [run.joints.position[k], run.joints.speed[k], np.zeros(0)]
        joints = STORE.types[JOINTS](header(STORE, time, ""), [*design.limits.arm.names], *states)
        read = STORE.types[WRENCH](header(STORE, time, "tool"), wrench(STORE, reaction[k, :3], reaction[k, 3:]))
        items += [(time, "/joint_states", JOINTS, joints), (time, "/wrench", WRENCH, read)]
    write_rosbag2(tmp_path / "bag", items)
    result = identify_files([tmp_path / "bag"], Experiment.load(tmp_path / "identify.toml"))
    body, u = design.experiment.body, result.parameters.standard_uncertainty
    error = np.array([result.mass, *result.r_cg, *result.inertia]) - [body.mass, *body.r_cg_from_q, *body.inertia]
    assert (np.abs(error) < 5 * u).all(), error / u
    assert u[0] < 0.01 * body.mass


def test_the_files_say_the_motion(design, report):
    arm, files = design.limits.arm, report.files()
    motions = [
        f"{name}.{end}" for name in ("motion", "rehearsal") for end in ("csv", "joint_trajectory.yaml", "script")
    ]
    assert sorted(files) == sorted([*motions, "identify.toml", "arm.urdf"])
    table = np.genfromtxt(io.BytesIO(files["motion.csv"]), delimiter=",", names=True, deletechars="")
    assert len(table) == 8 * 200 + 1
    q, speed, _ = map(np.asarray, design.designed.series.states(table["t_s"]))
    np.testing.assert_allclose(table["lift.q"], q[:, 1], atol=1e-9)
    np.testing.assert_allclose(table["wrist_3.qd"], speed[:, 5], atol=1e-9)
    message = json.loads(files["motion.joint_trajectory.yaml"])  # which is YAML, too
    assert message["joint_names"] == list(arm.names)
    point = message["points"][301]
    assert point["time_from_start"] == {"sec": 1, "nanosec": 505_000_000}
    np.testing.assert_allclose(point["positions"], q[301], atol=1e-9)
    rows = [line for line in files["motion.script"].decode().splitlines() if "servoj(" in line]
    assert len(rows) == len(table)
    assert rows[301].endswith("t=0.005, lookahead_time=0.03, gain=300)")
    slow = np.genfromtxt(io.BytesIO(files["rehearsal.csv"]), delimiter=",", names=True, deletechars="")
    assert slow["t_s"][-1] == 16.0
    np.testing.assert_allclose(slow["pan.q"][::2], table["pan.q"], atol=1e-9)
    np.testing.assert_allclose(slow["pan.qd"][::2], table["pan.qd"] / 2, atol=1e-9)


def test_a_d_optimal_goal_is_the_determinant(design):
    reference = design.motions["random"].covariance
    of = goal_function("determinant", design.experiment, reference)
    np.testing.assert_allclose(of(reference), 1.0)
    np.testing.assert_allclose(of(4 * reference), 2.0)
    of = goal_function("all", design.experiment, reference)
    np.testing.assert_allclose(of(4 * reference), 2.0)


BAD = [
    ({"goal": "fast"}, "unknown goal 'fast'"), ({"starts": 0}, "0 starts: ask for one at least"),
    ({"duration": -1.0}, "a duration of -1 s"),
    ({"duration": 6.0}, "no room for a period of 5 s .* state a period of 0.667 to 2 s, or measure for 9 s or longer"),
    ({"duration": 4.0}, "two ramps of 2 s, up to 1.5 Hz: measure for 9 s or longer"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "message"), BAD)
def test_a_design_that_cannot_be_is_one_line(experiment, options, message, monkeypatch):
    monkeypatch.setattr(arm_design, "Clearance", None)  # reading meshes takes long
    with pytest.raises(ExperimentError, match=message):
        design_arm(experiment, **options)


@pytest.fixture
def ready(design, monkeypatch):
    monkeypatch.setattr(arm_design, "design_arm", lambda *_, **__: design)


def test_the_command_writes_report_and_files(ready, tmp_path):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["design", str(EXPERIMENTS / "arm.toml"), "--out", str(tmp_path)]) == 0
    assert "against the best random series" in out.getvalue()
    assert "one joint at a time" in out.getvalue()
    content = json.loads((tmp_path / "result.json").read_text())
    assert content["kind"] == "inertia design arm"
    assert list(content["motions"]) == ["designed", "random", "single"]
    assert {"motion.csv", "motion.script", "report.html", "joints.svg"} <= {path.name for path in tmp_path.iterdir()}


@pytest.mark.parametrize("option", [["--poses", "5"], ["--reference", "T1"]])
def test_options_of_six_legs_are_refused(ready, option, capsys):
    assert main(["design", str(EXPERIMENTS / "arm.toml"), *option]) == 2
    assert "six legs, not" in capsys.readouterr().err


def test_without_mujoco_its_name_is_told(design, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(RigError, match=r"pip install inertia-uq\[arm\]"):
        arm_report(design)


@pytest.mark.slow
def test_the_largest_size_is_near_the_full_one_where_some_smaller_ones_bring_links_too_near(design, monkeypatch):
    sizes = []

    def of_size(size):
        sizes.append(size)
        return design.designed.series

    def peaks_of(series, t):
        met = 0.95 < sizes[-1] < 0.99 or sizes[-1] < 0.4
        return [Peak("clearance", 0.9 if met else 1.1, 0, "forearm", 1.0)]

    monkeypatch.setattr(design.limits, "peaks_of", peaks_of)
    assert 0.9895 < largest_size(design.limits, of_size, np.linspace(0, 8, 100))[0] < 0.99
