"""Anybody's recording: declared signs, frames, units and points; zeros; rates and clocks; the part that counts."""

import dataclasses
from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.signals.differentiate import matched
from identify.signals.run import RunError
from tests.helpers.recordings import Signals, about, declare, silenced, write
from tests.helpers.scene import record
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load_run
from uq.runs.recorded.time_window import TimeWindow

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")
study = partial(pytest.param, marks=pytest.mark.study)

MOMENTS = [0, 3, 5]
POINT = np.array([0.010, -0.020, 0.030])


@pytest.fixture(scope="module")
def signals(short):
    return Signals.of(simulate(short, "T1"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def plain(folder, signals, short):
    return identify_files([write(folder / "plain.mcap", signals)], declare(short))


def test_a_run_rewritten_in_another_rigs_conventions_gives_the_same_tensor(folder, short, signals, plain):
    """Raw channels behind a 6×6 calibration, on the sensor, permuted axes, N·mm and lbf, another point; IMU turned."""
    rng = np.random.default_rng(4)
    turned = Rotation.random(rng=rng).as_matrix()
    axes = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0]])  # "-y, z, -x"
    calibration = rng.normal(0, 0.3, (6, 6)) + np.diag([2.0, 3, 4, 5, 6, 7])
    moment = signals.moment - np.cross(POINT, signals.force)
    wrench = np.hstack([-signals.force @ axes / 4.4482216152605, -moment @ axes * 1e3]) @ np.linalg.inv(calibration).T
    omega, specific_force = np.rad2deg(signals.omega @ turned), signals.specific_force @ turned / 9.80665
    other = Signals(signals.t, wrench[:, :3], wrench[:, 3:], omega, specific_force)
    declared = declare(
        short, wrench="on_sensor", force_unit="lbf", moment_unit="N*mm", angular_velocity_unit="deg/s",
        acceleration_unit="g", wrench_rotation_to_body="-y, z, -x", imu_rotation_to_body=turned.tolist(),
        wrench_point=["10 mm", "-20 mm", "30 mm"], calibration=calibration.tolist(), compensated="none",
        imu_position=["0 m", "0 m", "0 m"],
    )  # fmt: skip
    result = identify_files([write(folder / "other.mcap", other)], declared)
    np.testing.assert_allclose(result.inertia, plain.inertia, rtol=1e-9)
    np.testing.assert_allclose(result.standard_uncertainty, plain.standard_uncertainty, rtol=1e-9)
    np.testing.assert_allclose(result.runs[0].force_offset, plain.runs[0].force_offset, rtol=1e-6)
    for said in (
        "values are in",
        "the wrench is that on the body",
        "axes are the body's",
        "about Q",
        "at Q",
        "no driver",
    ):
        assert said in " ".join(plain.assumptions)
        assert said not in " ".join(result.assumptions)


@pytest.mark.parametrize(
    ("value", "axes"),
    [
        (np.nan, 0), (np.inf, slice(None)),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((np.nan, slice(None)), (np.inf, 0))),
    ],
)  # fmt: skip
def test_a_signal_that_is_never_a_number_is_not_used_or_refused(folder, short, signals, axes, value):
    """Without the accelerometer the tensor is that of a run without; nothing stands for gyro or load cell."""

    def spoilt(name):
        values = getattr(signals, name).copy()
        values[:, axes] = value
        return write(folder / "never.mcap", dataclasses.replace(signals, **{name: values}))

    declared = declare(short)
    without = dataclasses.replace(signals, specific_force=np.zeros_like(signals.specific_force))
    expected = identify_files([write(folder / "without.mcap", without)], declared)
    result = identify_files([spoilt("specific_force")], declared)
    np.testing.assert_array_equal(result.inertia, expected.inertia)
    with pytest.raises(
        RunError, match=r"^the angular velocity in never\.mcap is zero, or no number, in most samples: "
    ):
        identify_files([spoilt("omega")], declared)
    with pytest.raises(RunError, match=r"^no sample of /wrench holds numbers alone: check sensor and driver$"):
        identify_files([spoilt("force")], declared)


@pytest.mark.parametrize(
    ("what", "keys", "spoil"),
    [
        study("sign", {}, lambda s: dataclasses.replace(s, force=-s.force, moment=-s.moment)),
        study("point", {}, lambda s: dataclasses.replace(s, moment=s.moment - np.cross(POINT, s.force))),
        ("imu", {}, lambda s: dataclasses.replace(s, omega=s.omega @ Rotation.from_euler("z", 3, degrees=True).as_matrix())),
        study("unit", {}, lambda s: dataclasses.replace(s, moment=1e3 * s.moment)),
    ],
)  # fmt: skip
def test_what_is_not_declared_does_matter(folder, short, signals, plain, what, keys, spoil):
    """The oracle of the test above: each convention alone, left undeclared, moves the tensor."""
    result = identify_files([write(folder / f"{what}.mcap", spoil(signals))], declare(short, **keys))
    assert np.abs(result.inertia - plain.inertia).max() > 3e-3


def test_what_the_runs_own_metadata_says_is_used(folder, short, signals, plain):
    metadata = about(
        wrench="on_sensor",
        units={"force": "kgf", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"},
        frames={"/wrench": "in B, at Q", "/imu": "in B, at Q"},
    )
    other = dataclasses.replace(signals, force=-signals.force / 9.80665, moment=-signals.moment)
    result = identify_files([write(folder / "says.mcap", other, metadata=metadata)], declare(short))
    np.testing.assert_allclose(result.inertia, plain.inertia, rtol=1e-9)
    assert [text for text in result.assumptions if "body" in text] == [
        "no driver removed the body's weight from the wrench"
    ]


SAID = about(
    wrench="on_body",
    units={"force": "N", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"},
    frames={"/wrench": "in B, at Q", "/imu": "in B, at Q"},
)
RECORDER = about(
    wrench="on_body",
    wrench_meaning="force [N] and moment [N*m] on the body at the load cell's centre Q, body frame",
    imu="angular velocity [rad/s] and specific force [m/s^2], body frame",
)


@pytest.fixture(scope="module", params=[SAID, RECORDER], ids=["simulated", "recorded"])
def declared_run(request, folder, signals):
    """A run whose metadata says how it was recorded."""
    return write(folder / "contradiction.mcap", signals, metadata=request.param)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ({"wrench": "on_sensor"}, "its wrench is on_body, recording.wrench in the experiment says on_sensor"),
        ({"force_unit": "lbf"}, "its force is in N, recording.force_unit in the experiment says lbf"),
        ({"moment_unit": "N*mm"}, r"its moment is in N\*m, recording.moment_unit in the experiment says N\*mm"),
        ({"angular_velocity_unit": "deg/s"}, "its angular velocity is in rad/s, recording.angular_velocity_unit"),
        ({"wrench_rotation_to_body": "y, z, x"}, "its wrench is in the body frame, recording.wrench_rotation_to_body"),
        ({"imu_rotation_to_body": "-x, -y, z"}, "its imu is in the body frame, recording.imu_rotation_to_body"),
        ({"wrench_point": ["0 m", "0 m", "1 mm"]}, "its moment is taken about Q, recording.wrench_point in the exp"),
    ],
)
def test_a_contradiction_names_both(declared_run, short, declared, words):
    with pytest.raises(RunError, match=words) as caught:
        load_run(declared_run, declare(short, **declared).recording)
    assert "\n" not in str(caught.value)


def test_a_declaration_that_agrees_with_the_run_is_no_contradiction(folder, short, signals):
    path = write(folder / "agrees.mcap", signals, metadata=SAID)
    declared = {"force_unit": "kg*m/s^2", "moment_unit": "J", "wrench": "on_body", "imu_rotation_to_body": "x, y, z"}
    load_run(path, declare(short, **declared).recording)


def test_a_unit_that_there_is_not_and_metadata_that_is_no_json(folder, short, signals):
    path = write(folder / "blub.mcap", signals, metadata=about(units={"force": "blub"}))
    with pytest.raises(RunError, match="its force is in 'blub', which is no unit of it"):
        load_run(path)
    write(path, signals, metadata={"units": "N", "frames": "[1]", "wrench": "?"})
    assert load_run(path).warnings == ()


# Unequal rates and clocks. Silent runs have no noise to hide behind; noisy ones are compared with themselves at 1 kHz.


@pytest.fixture(scope="module")
def fine(brief):
    """T1 at 1 kHz: noisy, and without any error."""
    spec = dataclasses.replace(brief.trajectories["T1"], rate=1000.0)
    noisy = dataclasses.replace(brief, trajectories={"T1": spec})
    silent = silenced(noisy)
    return Signals.of(simulate(noisy, "T1")), Signals.of(simulate(silent, "T1"))


def error(result, reference):
    return np.abs(result[MOMENTS] / reference[MOMENTS] - 1).max()


@pytest.fixture(scope="module")
def whole_and_slow(folder, short, fine):
    """Both sensors at 1 kHz; the IMU at 100 Hz."""
    runs = [write(folder / f"every_{every}.mcap", fine[0], every=every) for every in (1, 10)]
    return [identify_files([run], declare(short)) for run in runs]


def test_a_slow_imu_with_a_fast_load_cell(folder, short, fine, whole_and_slow):
    _, silent = fine
    whole, slow = whole_and_slow
    assert slow.runs[0].rate == pytest.approx(100)
    assert error(slow.inertia, whole.inertia) < 0.005
    exact = identify_files([write(folder / "exact.mcap", silent, every=10)], declare(short))
    assert error(exact.inertia, short.inertia) < 0.005
    assert slow.warnings == ()


def test_the_load_cells_noise_does_not_fold_into_the_slow_imus_band(whole_and_slow):
    """Of white noise at 1 kHz a tenth of the power lies below 50 Hz: the residuals shrink by more than √10/1.2."""
    residuals = [result.runs[0].residual for result in whole_and_slow]
    assert (residuals[1] < residuals[0] / np.sqrt(10) * 1.2).all()


@pytest.mark.parametrize(
    ("late", "counted"),
    [
        ("even", True),
        study("even", False),
        pytest.param("long", False, marks=pytest.mark.slow),
        study("symmetric", False),
    ],
)
def test_bare_headers_and_late_arrivals(folder, short, fine, whole_and_slow, generator, late, counted):
    noisy, silent = fine
    n = len(noisy.t)
    delays = {
        "even": generator.uniform(0, 2e-3, n),
        "long": generator.exponential(2e-3, n),
        "symmetric": generator.normal(0, 2e-3, n),
    }[late]
    options = {"every": 10, "stamped": False, "late": delays}
    options["sequence"] = None if counted else np.zeros(n, np.uint32)
    bare = identify_files([write(folder / "bare.mcap", noisy, **options)], declare(short))
    assert error(bare.inertia, whole_and_slow[1].inertia) < 0.02
    assert "no stamps in the headers of /wrench: the log's times are used for both sensors" in bare.warnings[0]
    assert "the log's times of /wrench jitter by" in bare.warnings[1]
    exact = identify_files([write(folder / "bare.mcap", silent, **options)], declare(short))
    assert error(exact.inertia, short.inertia) < 0.02


def test_a_motion_that_the_slower_sensor_cannot_follow_is_refused(folder, short, fine):
    _, silent = fine
    path = write(folder / "crawl.mcap", silent, every=500)
    with pytest.raises(
        RunError, match=r"reaches 1\.\d* Hz, beyond the Nyquist frequency 1 Hz of /imu \(2 Hz\)|1 Hz of /imu"
    ):
        identify_files([path], declare(short))
    path = write(folder / "slow.mcap", silent, every=10)
    fast = dataclasses.replace(declare(short), estimators=(dataclasses.replace(short.estimators[1], band=60.0),))
    with pytest.raises(RunError, match="reaches 60 Hz, beyond the Nyquist frequency 50 Hz of /imu"):
        identify_files([path], fast)


@pytest.mark.parametrize("method", ["source", "joint"])
def test_a_band_too_high_for_the_rate_names_the_highest(folder, short, signals, method):
    path = write(folder / f"{method}.mcap", signals)
    high = dataclasses.replace(declare(short), estimators=(dataclasses.replace(short.estimators[1], band=25.0),))
    with pytest.raises(RunError, match=r"400 Hz, too few .* of 25 Hz .* a band, here at most 1\d\.\d Hz") as refused:
        identify_files([path], high, method=method)
    highest = float(str(refused.value).split("at most ")[1].split(" Hz")[0])
    assert matched(400.0, 0.99 * highest).size == 3 - 1
    with pytest.raises(ValueError, match="high enough"):
        matched(400.0, 1.01 * highest)


# The part that counts.


@pytest.fixture(scope="module")
def scene(short, folder):
    recorded = record(short, np.random.default_rng(7))
    signals = Signals(recorded.t, recorded.force, recorded.moment, recorded.omega, recorded.specific_force)
    return recorded, write(folder / "scene.mcap", signals)


@pytest.mark.slow  # in scenes of several motions: recorded/test_segments.py
def test_without_options_the_right_segment_is_found(short, scene):
    recorded, path = scene
    found = identify_files([path], declare(short))
    cut = identify_files([path], declare(short), windows=[TimeWindow(recorded.start, recorded.stop)])
    assert error(found.inertia, cut.inertia) < 0.005
    (run,) = found.runs
    assert run.detected
    assert not cut.runs[0].detected
    assert len(run.segments) == 1
    assert f"used from {run.segments[0][0]:.2f} to {run.segments[0][1]:.2f} s, found where it moves" in repr(found)
    assert (
        run.left_out["outside the part"] == len(recorded.t) - round((run.segments[0][1] - run.segments[0][0]) * 400) - 1
    )
    content = found.to_dict()["runs"][0]
    assert content["parts"] == [list(run.segments[0])]
    assert content["left_out"] == {"outside the part": run.left_out["outside the part"]}


@pytest.mark.study
def test_everything_would_be_wrong(short, scene):
    """The oracle of the test above: hands and knock do matter."""
    _, path = scene
    whole = identify_files([path], declare(short), windows=[TimeWindow(0.0, None)])
    assert np.abs(whole.inertia - short.inertia).max() > 0.05


@pytest.mark.slow  # of one part between marks: recorded/test_time_window.py
def test_several_parts_are_those_parts_and_nothing_between(short, scene):
    """Filters do not reach over the seams: the sums of two halves with a second between are those of the two halves."""
    recorded, path = scene
    middle = (recorded.start + recorded.stop) / 2
    parts = [TimeWindow(recorded.start, middle - 0.5), TimeWindow(middle + 0.5, recorded.stop)]
    both = identify_files([path], declare(short), windows=parts, offsets="none")
    halves = [identify_files([path], declare(short), windows=[part], offsets="none") for part in parts]
    lost = sum(half.runs[0].samples for half in halves) - both.runs[0].samples
    assert 0 <= lost <= 6  # a spline's reach on either side of the seam
    run = load_run(path)
    spoilt = dataclasses.replace(run, moment=np.where((np.abs(run.t - middle) < 0.49)[:, None], 1e3, run.moment))
    clean = run.within((p.start, p.stop) for p in parts)
    np.testing.assert_array_equal(clean.used()[0].stop, spoilt.within((p.start, p.stop) for p in parts).used()[0].stop)


# Zeros: of one run, with a rest before and after.


@pytest.fixture(scope="module")
def rested(short):
    """T1 with noise and gyro bias between two rests, what the cell must bear of the weight, and its truth."""
    noisy, silent = (record(short, np.random.default_rng(3), noise=noise) for noise in (1.0, 0.0))
    part = slice(*np.searchsorted(noisy.t, [noisy.start - 4, noisy.stop + 2.5]))
    names = ("force", "moment", "omega", "specific_force")
    signals = Signals(noisy.t[part] - noisy.t[part][0], *(getattr(noisy, name)[part] for name in names))
    return signals, silent.force[part]  # the centre of gravity stays: the force is the weight


OFFSETS = np.array([9.0, -1.0, 10.0]), np.array([0.7, -0.4, 0.5])


def zeroed(rested, short, kind):
    """The same signals as another driver gives them, and how that is declared."""
    signals, weight = rested
    r_cg, level = short.r_cg_from_q, np.array([0, 0, short.mass * short.gravity])
    force, moment = signals.force + OFFSETS[0], signals.moment + OFFSETS[1]
    if kind == "loaded":
        force, moment = signals.force - level, signals.moment - np.cross(r_cg, level)
    elif kind == "gravity":
        force, moment = force - weight, moment - np.cross(r_cg, weight)
    elif kind == "gravity_from_force":
        force = force - weight
    declared = {"zero": kind} if kind in ("empty", "loaded") else {"compensated": kind}
    return dataclasses.replace(signals, force=force, moment=moment), declared


@pytest.fixture(scope="module")
def reference(folder, short, rested):
    return identify_files([write(folder / "as_is.mcap", rested[0])], declare(short))


@pytest.mark.parametrize(
    ("kind", "offsets"),
    [("empty", "estimate"), ("gravity", "still"), ("gravity_from_force", "still"), ("loaded", "none")]
    + [study(kind, "estimate") for kind in ("loaded", "gravity", "gravity_from_force")]
    + [study("empty", "still"), study("gravity_from_force", "none")],
)
def test_however_zeroed_the_same_tensor(folder, short, rested, reference, kind, offsets):
    signals, declared = zeroed(rested, short, kind)
    if offsets == "none" and kind != "loaded":
        signals = dataclasses.replace(signals, force=signals.force - OFFSETS[0], moment=signals.moment - OFFSETS[1])
    result = identify_files([write(folder / "zeroed.mcap", signals)], declare(short, offsets=offsets, **declared))
    assert (np.abs(result.inertia - reference.inertia) < 0.1 * reference.standard_uncertainty).all()
    np.testing.assert_allclose(result.standard_uncertainty, reference.standard_uncertainty, rtol=0.02)
    if offsets != "none" and kind != "loaded":
        content = result.to_dict()["offsets"]
        assert content["method"] == offsets
        expected = OFFSETS[1] - np.cross(short.r_cg_from_q, OFFSETS[0])
        sigma = np.array(content["moment_standard_uncertainty"][0])
        assert (np.abs(np.array(content["moment"][0]) - expected) < 4 * sigma).all()
        np.testing.assert_allclose(content["force"][0], OFFSETS[0], atol=0.6)
        np.testing.assert_allclose(content["moment_about_q"][0], OFFSETS[1], atol=0.15)


@pytest.mark.study
def test_gravity_removed_from_the_force_alone_and_not_declared_is_far_off(folder, short, rested):
    """The oracle of the test above: 116 g·m² on I11 and I22, m·r² g-fold."""
    signals, _ = zeroed(rested, short, "gravity_from_force")
    wrong = identify_files([write(folder / "wrong.mcap", signals)], declare(short))
    assert wrong.inertia[0] - short.inertia[0] > 0.08


@pytest.mark.parametrize(
    ("kind", "keys", "words"),
    [
        (
            "gravity",
            {},
            "recording.compensated is gravity, and the weight that .* lacks needs the mass: give body.mass",
        ),
        ("gravity_from_force", {}, "recording.compensated is gravity_from_force, .* give body.mass"),
        ("loaded", {"offsets": "none"}, "recording.zero is loaded, with offsets none, .* give body.mass"),
    ],
)
def test_without_the_mass_no_weight_can_be_put_back(folder, short, rested, kind, keys, words):
    signals, declared = zeroed(rested, short, kind)
    experiment = dataclasses.replace(declare(short, **keys, **declared), mass=None)
    with pytest.raises(RunError, match=words) as caught:
        identify_files([write(folder / "no_mass.mcap", signals)], experiment)
    assert "\n" not in str(caught.value)


def test_without_an_accelerometer_a_level_rest_will_do_and_a_tilted_one_will_not(folder, short, rested):
    """The poses before have left the body tilted, which the moment at rest shows."""
    signals, declared = zeroed(rested, short, "gravity_from_force")
    bare = dataclasses.replace(signals, specific_force=0 * signals.force, moment=signals.moment - OFFSETS[1])
    with pytest.raises(RunError, match=r"is that of a body tilted by [\d.]+ deg, or an offset: .* an accelerometer"):
        identify_files([write(folder / "bare.mcap", bare)], declare(short, **declared))
    run = simulate(silenced(short), "T1")
    rest = np.repeat([0], 1600)
    index = np.r_[rest, : len(run.run.t)]
    weight = np.array(short.mass * short.gravity) * run.rotation[index][:, 2, :]
    level = Signals(
        np.arange(len(index)) / 400.0, run.run.force[index] - weight, run.run.moment[index], run.run.omega[index],
        np.zeros((len(index), 3)),
    )  # fmt: skip
    noise = np.random.default_rng(8)
    for signal, sigma in ((level.force, 5.0), (level.moment, 0.4), (level.omega, 5e-4)):
        signal += noise.normal(0, sigma, signal.shape)
    result = identify_files([write(folder / "level.mcap", level)], declare(short, **declared))
    np.testing.assert_allclose(result.inertia, short.inertia, atol=4 * result.standard_uncertainty.max())
    assert "level at first" in " ".join(result.assumptions)


def test_offsets_from_rest_need_rest(folder, short, signals):
    cut = Signals(*(getattr(signals, f.name)[2400:5600] for f in dataclasses.fields(signals)))
    with pytest.raises(RunError, match="has no rest to take the offsets from: record a second of it"):
        identify_files([write(folder / "restless.mcap", cut)], declare(short, offsets="still"))
