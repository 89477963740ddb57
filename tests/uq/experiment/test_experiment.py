"""Experiment files: the preset says what the paper says; every mistake is one line that names its key."""

import copy
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from uq import identify_files, law, montecarlo, sensor_worth, simulate
from uq.experiment.experiment import Experiment, ExperimentError, samples

TEXT = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")


@pytest.fixture
def document():
    return copy.deepcopy(tomllib.loads(TEXT))


def test_the_preset_is_table_1(preset):
    sigma = {source.name: source.sigma.tolist() for source in preset.sources}
    assert sigma == {
        "F_precision": pytest.approx([5, 5, 10]),
        "F_bias": pytest.approx([0.69, 0.42, 1.4]),
        "M_precision": pytest.approx([0.38, 0.46, 0.46]),
        "M_bias": pytest.approx([0.014, 0.016, 0.019]),
        "r_cg": pytest.approx([0.15e-3, 0.13e-3, 0.16e-3]),
        "omega_precision": pytest.approx([4.3e-4, 3.7e-4, 19e-4]),
        "omega_bias": pytest.approx([5.8e-3, 6.0e-3, 5.9e-3]),
    }
    assert all(source.reference for source in preset.sources)
    np.testing.assert_allclose(preset.inertia, [0.3813, 0, 0, 0.0185, 0, 0.3791])
    np.testing.assert_allclose(preset.r_cg_from_q, [0, 0, 0.053])
    assert [len(samples(spec)) for spec in preset.trajectories.values()] == [72_000] * 4
    assert [spec.still for spec in preset.trajectories.values()] == ["cg", "omb", "cg", "omb"]


def test_every_inferred_value_is_marked():
    inferred = ("r_cg_from_omb", "duration", "rate", "ramp", "precessions", "pole")
    for line in TEXT.splitlines():
        if line.split("=")[0].strip() in inferred:
            assert "INFERRED" in line, line


def put(document, path, value):
    *parents, last = path
    for key in parents:
        document = document[key]
    if value is None:
        del document[last]
    else:
        document[last] = value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("bodyy",), {}, "unknown key bodyy"),
        (("body", "mas"), "1 kg", "unknown key body.mas"),
        (("body", "mass"), "19.7 N", "body.mass is '19.7 N': write a unit of the same dimension as kg"),
        (("body", "mass"), 19.7, "body.mass is 19.7: write a value with its unit"),
        (("body", "mass"), "0 kg", "body.mass is '0 kg': write a value above zero"),
        (("body", "r_cg_from_q"), ["0 mm", "0 mm"], r"body.r_cg_from_q is \['0 mm', '0 mm'\]: write three values"),
        (("body", "r_cg_from_q"), ["0 mm", 0, "0 mm"], r"body.r_cg_from_q\[1\] is 0: write a value with its unit"),
        (("body",), [], r"body is \[\]: write a table"),
        (("body", "inertia", "I11"), "1 kg*m^2", "body.inertia is no body's tensor"),
        (("body", "inertia", "I21"), "1 kg*m^2", "unknown key body.inertia.I21"),
        (("platform", "gravity"), "9.81 m/s", "platform.gravity is '9.81 m/s'"),
        (("trajectory", "T1", "kind"), "circle", "trajectory.T1.kind is 'circle': choose one of sphere, harmonic"),
        (("trajectory", "T1", "rate"), "400 rad/s", "trajectory.T1.rate is '400 rad/s'"),
        (("trajectory", "T1", "duration"), "2 ms", "trajectory.T1.ramp is 27 s: at most half of the 0.002 s"),
        (("trajectory", "T1", "rate"), "1 mHz", "trajectory.T1 has fewer than two samples"),
        (("trajectory", "T1", "ramp"), "91 s", "trajectory.T1.ramp is 91 s: at most half"),
        (("trajectory", "T1", "precessions"), "10", "trajectory.T1.precessions is '10': write a whole number"),
        (("trajectory", "T1", "precessions"), True, "trajectory.T1.precessions is True: write a whole number"),
        (("trajectory", "T3", "precessions"), 10, "unknown key trajectory.T3.precessions"),
        (("trajectory",), [], r"trajectory is \[\]: write a table"),
        (("estimator", 0, "differentiator"), "spline", r"estimator\[central\].differentiator is 'spline': choose one of"),
        (("estimator", 1, "band"), None, r"missing key estimator\[smoothed\].band"),
        (("estimator", 1, "window"), 40, r"estimator\[smoothed\].window is 40: write an odd number"),
        (("estimator", 1, "name"), "central", r"two entries named 'central' in \[\[estimator\]\]"),
        (("estimator",), {}, r"estimator is a table: write \[\[estimator\]\]"),
        (("source", 0, "sigma"), ["5 N", "-5 N", "10 N"], r"source\[F_precision\].sigma\[1\] is '-5 N': write zero or more"),
        (("source", 0, "sigma"), ["5 N", "5 N"], r"source\[F_precision\].sigma is \['5 N', '5 N'\]: write three values"),
        (("source", 2, "sigma"), ["1 N", "1 N", "1 N"], r"source\[M_precision\].sigma\[0\] is '1 N': write a unit"),
        (("source", 5, "sigma"), ["1 Hz", "1 Hz", "1 Hz"], r"source\[omega_precision\].sigma\[0\] is '1 Hz'"),
        (("source", 4, "kind"), "precision", "r_cg is one draw an experiment"),
        (("source", 0, "distribution"), "cauchy", r"source\[F_precision\].distribution is 'cauchy': choose one of normal"),
        (("source", 0, "group"), "total", r"source\[F_precision\].group is 'total', which means all sources"),
        (("source", 0, "group"), "r_cg", "'r_cg' names a source and a group: rename one"),
        (("trajectory", "T1", "duration"), "1e12 s", "trajectory.T1 has more than 100,000,000 samples"),
        (("trajectory", "T1", "precessions"), 10**400, "trajectory.T1.precessions is out of range"),
        (("source", 0, "name"), None, r"missing key source\[0\].name"),
        (("recording", "wrench"), "up", "recording.wrench is 'up': choose one of on_body, on_sensor"),
        (("recording", "imu_topic"), "/imu", "unknown key recording.imu_topic: did you mean motion_topic. the keys here are acceleration_unit"),
        (("recording", "motion_topic"), 3, "recording.motion_topic is 3: write a string"),
        (("recording", "offsets"), True, "recording.offsets is True: choose one of estimate, still, none"),
        (("recording", "zero"), "full", "recording.zero is 'full': choose one of empty, loaded"),
        (("recording", "compensated"), "yes", "recording.compensated is 'yes': choose one of none, gravity"),
        (("recording", "time"), "stamp", "recording.time is 'stamp': choose one of header, log"),
        (("recording", "force_unit"), "kg", "recording.force_unit is 'kg': write the name of a unit of the same dimension as N"),
        (("recording", "force_unit"), "5 N", "recording.force_unit is '5 N': write the name of a unit, such as N"),
        (("recording", "moment_unit"), "blub", "recording.moment_unit is 'blub': write the name of a unit, such as N"),
        (("recording", "moment_unit"), 1, "recording.moment_unit is 1: write a string"),
        (("recording", "angular_velocity_unit"), "Hz", "recording.angular_velocity_unit is 'Hz': write the name of a unit of the same"),
        (("recording", "acceleration_unit"), "kg", "recording.acceleration_unit is 'kg': write the name of a unit of the same"),
        (("recording", "wrench_point"), [0, 0, 1], r"recording.wrench_point\[0\] is 0: write a value with its unit"),
        (("recording", "wrench_point"), ["1 mm"], r"recording.wrench_point is \['1 mm'\]: write three values"),
        (("recording", "imu_position"), ["1 N", "0 m", "0 m"], r"recording.imu_position\[0\] is '1 N': write a unit"),
        (("recording", "imu_position"), ["inf m", "0 m", "0 m"], r"recording.imu_position\[0\] is 'inf m': write a number"),
        (("recording", "imu_rotation_to_body"), "x, y, -z", "recording.imu_rotation_to_body is left-handed: change the sign"),
        (("recording", "imu_rotation_to_body"), "y, z, y", "recording.imu_rotation_to_body is not three signed axes: write each"),
        (("recording", "imu_rotation_to_body"), "--x, y, z", "recording.imu_rotation_to_body is not three signed axes"),
        (("recording", "imu_rotation_to_body"), [[1, 0, 0], [0, 1, 0], [0, 0, -1]], "recording.imu_rotation_to_body is left-handed"),
        (("recording", "imu_rotation_to_body"), [[1, 0, 0], [0, 1, 0], [0, 0.1, 1]], "recording.imu_rotation_to_body is no rotation"),
        (("recording", "imu_rotation_to_body"), [[1, 0, 0], [0, 1, 0]], "recording.imu_rotation_to_body is .*: write 3 rows of 3 finite"),
        (("recording", "imu_rotation_to_body"), [[1, 0, 0], [0, 1], [0, 0, 1]], "write 3 rows of 3 finite numbers"),
        (("recording", "imu_rotation_to_body"), 7, "recording.imu_rotation_to_body is 7: write 3 rows of 3 finite numbers"),
        (("recording", "imu_rotation_to_body"), {"w": 1, "x": 0, "y": 0}, "missing key recording.imu_rotation_to_body.z"),
        (("recording", "imu_rotation_to_body"), {"w": 1, "x": 0, "y": 0, "z": 0, "s": 1}, "unknown key recording.imu_rotation_to_body.s"),
        (("recording", "imu_rotation_to_body"), {"w": 1, "x": 1, "y": 0, "z": 0}, "recording.imu_rotation_to_body has the norm 1.41421"),
        (("recording", "imu_rotation_to_body"), {"w": "1", "x": 0, "y": 0, "z": 0}, "recording.imu_rotation_to_body.w is '1': write a finite"),
        (("recording", "wrench_rotation_to_body"), [[True, 0, 0], [0, 1, 0], [0, 0, 1]], "write 3 rows of 3 finite numbers"),
        (("recording", "wrench_rotation_to_body"), [[float("nan"), 0, 0], [0, 1, 0], [0, 0, 1]], "write 3 rows of 3 finite"),
        (("recording", "calibration"), [[1, 0], [0, 1]], "recording.calibration is .*: write 6 rows of 6 finite numbers"),
        (("recording", "calibration"), [[1.0] * 6] * 6, "recording.calibration is singular: give six independent rows"),
        (("platform", "gravity"), {"height": "0 m"}, "missing key platform.gravity.latitude"),
        (("platform", "gravity"), {"latitude": "95 deg"}, "platform.gravity.latitude is '95 deg': write -90 deg to 90 deg"),
        (("platform", "gravity"), {"latitude": 4.6}, "platform.gravity.latitude is 4.6: write a value with its unit"),
        (("platform", "gravity"), {"latitude": "4 deg", "height": "1e6 m"}, "platform.gravity.height is '1e6 m': write a height"),
        (("platform", "gravity"), {"latitude": "4 deg", "depth": "1 m"}, "unknown key platform.gravity.depth"),
        (("recording", "estimator"), "best", "unknown estimator 'best' at recording.estimator"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_its_key(document, path, value, message):
    put(document, path, value)
    with pytest.raises(ExperimentError, match=message) as caught:
        Experiment.from_dict(document)
    assert "\n" not in str(caught.value)


def test_two_names_of_one_random_stream_are_refused(document):
    document["source"][0]["name"], document["source"][1]["name"] = "plumless", "buckeroo"  # one CRC-32
    with pytest.raises(ExperimentError, match="have one random stream: rename one"):
        Experiment.from_dict(document)


def test_a_file_that_is_no_toml(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text("[body\n")
    with pytest.raises(ExperimentError, match="not TOML"):
        Experiment.load(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ExperimentError, match="not a text file"):
        Experiment.load(path)


@pytest.mark.parametrize("value", ["[" * 2000, "9" * 5000, f"0x{'f' * 5000}"], ids=["deep", "decimal", "hexadecimal"])
def test_a_file_whose_values_python_cannot_hold(tmp_path, value):
    path = tmp_path / "e.toml"
    path.write_text(f"[body]\nmass = {value}\n")
    with pytest.raises(ExperimentError, match=r"^not TOML .*e\.toml: .*: give an experiment file in TOML$"):
        Experiment.load(path)


def test_a_simulation_needs_a_body_and_a_recording_does_not(document):
    del document["body"]["inertia"]
    experiment = Experiment.from_dict(document)
    assert experiment.inertia is None
    with pytest.raises(ExperimentError, match=r"missing key body.inertia: a simulation needs it"):
        _ = experiment.body
    del document["body"]
    without = Experiment.from_dict(document)
    with pytest.raises(ExperimentError, match=r"missing key body.mass"):
        _ = without.body
    with pytest.raises(ExperimentError, match=r"missing key body.r_cg_from_q: add it; `inertia centre` finds it"):
        _ = without.stated_r_cg


@pytest.mark.parametrize("function", [montecarlo, law, simulate, sensor_worth, identify_files])
def test_the_name_of_an_experiment_in_its_place_is_answered_with_the_call(function):
    given = {"experiment": "barreto2016"} if function is not identify_files else {"paths": [], "experiment": "e.toml"}
    with pytest.raises(
        TypeError, match=r"takes an Experiment, not its name: write Experiment.load\('(barreto2016|e.toml)'\)"
    ):
        function(**given)
    with pytest.raises(TypeError, match=r"write Experiment.load\('e.toml'\)"):
        function(*([[]] if function is identify_files else []), Path("e.toml"))


def test_a_misspelt_key_is_told_before_it_is_missed(document):
    document["trajectory"]["T1"]["rampp"] = document["trajectory"]["T1"].pop("ramp")
    with pytest.raises(ExperimentError, match=r"unknown key trajectory.T1.rampp: did you mean ramp\?"):
        Experiment.from_dict(document)


def test_choices_by_name(preset):
    assert preset.estimator().name == "smoothed"
    assert preset.estimator("central").name == "central"
    assert preset.select()[0] == "T1"
    with pytest.raises(ExperimentError, match="unknown estimator 'best': choose one of central, smoothed"):
        preset.estimator("best")
    with pytest.raises(ExperimentError, match="unknown trajectory 'T9': choose one of T1, T2, T3, T4"):
        preset.select("T9")
    np.testing.assert_allclose(preset.sigma_r_cg, [0.15e-3, 0.13e-3, 0.16e-3])
