"""`inspect` names what was done to a run and its cure, `identify` warns of it; of clean runs neither says a word."""

import dataclasses
import json
import re
import tomllib
from functools import cache

import numpy as np
import pytest

from identify.judge.conventions.convention_fit import DeclaredRig, ImuSignal, WrenchSignal
from identify.judge.conventions.wrench_findings import wrench_findings
from tests.helpers import wrist_runs
from tests.helpers.spoiled_runs import SPOILED, T1, declared, elsewhere, other_body, sensors
from tests.helpers.thrown_bodies import throw
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.inspection.inspect_run import inspect_run
from uq.runs.recorded.load_run import load_run

pytestmark = pytest.mark.usefixtures("undrawn")


@cache
def good():
    """T1 in ten seconds with the noise of the preset, the accelerometer's own too."""
    return sensors(T1, seed=7, noise=0.02)


@cache
def clean(seed):
    return other_body(seed)


def judged(path, document):
    experiment = Experiment.from_dict(document)
    return experiment_findings(load_run(path, experiment.recording), experiment)


@pytest.mark.parametrize("name", SPOILED)
def test_what_was_done_is_named_with_a_cure_that_silences_and_restores(tmp_path, name):
    kind, spoil, cure = SPOILED[name]
    path = spoil(good()).write(tmp_path / "run.mcap")
    found = judged(path, T1)
    assert [finding.kind for finding in found] == [kind]
    if cure is None:
        assert "left-handed" in found[0].text
        return
    for key, value in cure.items():
        told = re.search(rf"{key} = (\[.*?\]|\".*?\")", found[0].text)[1]
        told = tomllib.loads(f"value = {told}")["value"]
        if key == "wrench_point":
            # three standard deviations of z in ten seconds
            told, value = ([float(x.split()[0]) for x in one] for one in (told, value))
            np.testing.assert_allclose(told, value, atol=15)
        else:
            assert told == value or name in BOTH_CURES
    assert judged(path, declared(T1, cure)) == []


BOTH_CURES = ("permuted load-cell axes",)  # either sensor may be the turned one: the line for the IMU stands first


@pytest.mark.parametrize("height", [-0.1, 0.045, pytest.param(0.06, marks=pytest.mark.slow)])
def test_a_point_is_named_before_units_of_two_systems_and_wherever_it_is_as_well(tmp_path, height):
    """The measured force, from which another point's moment is made, brings its noise along: it must not shift the point."""
    run = elsewhere(good(), np.array([0.0, 0.0, height]))
    (finding,) = judged(run.write(tmp_path / "run.mcap"), T1)
    assert finding.kind == "point"
    assert ('moment_unit = "kgf*m", which fits as well' in finding.text) == (height == 0.045)
    named = float(re.search(r'", "(\S+) mm"\]', finding.text)[1]) / 1e3
    assert named - height == pytest.approx(0.0042, abs=2e-4)  # an error of this run, whose standard deviation is 5 mm


def test_either_of_two_turned_sensors_may_be_declared(tmp_path):
    _, spoil, cure = SPOILED["permuted load-cell axes"]
    (found,) = judged(spoil(good()).write(tmp_path / "run.mcap"), T1)
    assert f'wrench_rotation_to_body = "{cure["wrench_rotation_to_body"]}"' in found.text
    assert 'imu_rotation_to_body = "y, -x, z"' in found.text


FORCE = {"calibration": np.diag([-1, -1, -1, 1, 1, 1]).tolist()}
DOWN = {"accelerometer_at_rest": "down"}


def force_or_accelerometer_reversed(name):
    run = good()
    force, imu = run.wrench.force, run.imu.linear_acceleration
    if name == "force":
        return dataclasses.replace(run, wrench=dataclasses.replace(run.wrench, force=-force))
    return dataclasses.replace(run, imu=dataclasses.replace(run.imu, linear_acceleration=-imu))


@pytest.mark.parametrize(("name", "cure"), [("force", FORCE), ("accelerometer", DOWN)])
def test_a_force_alone_reversed_or_an_accelerometer_downwards(tmp_path, name, cure):
    """No equation tells (F, f, r) from (-F, -f, -r): both are named, until a centre of gravity is declared."""
    path = force_or_accelerometer_reversed(name).write(tmp_path / "run.mcap")
    (either,) = inspect_run(path).findings
    assert either.kind == "sign"
    for part in (f"calibration = {FORCE['calibration']}", 'accelerometer_at_rest = "down"', "the same tensor"):
        assert part in either.text
    heights = {words: float(re.search(rf"{words}[^(]*\(centre of gravity at \(.*?([−\d.]+)\) mm", either.text)[1]
                            .replace("−", "-")) for words in ("force alone", "accelerometer")}  # fmt: skip
    assert heights == pytest.approx({words: 53 if name in words else -53 for words in heights}, abs=15)
    (decided,) = judged(path, T1)
    assert "fit only so, by the declared centre of gravity" in decided.text
    (key, value), other = *cure.items(), *({"calibration", "accelerometer_at_rest"} - set(cure))
    assert f"set {key} = {json.dumps(value)}" in decided.text
    assert other not in decided.text
    assert judged(path, declared(T1, cure)) == []


@pytest.mark.study
@pytest.mark.parametrize("name", ["opposite sign", "rotated IMU", "moment in N·mm"])
def test_identify_warns(tmp_path, name):
    path = SPOILED[name][1](good()).write(tmp_path / "run.mcap")
    result = identify_files([path], Experiment.from_dict(T1))
    assert [text for text in result.warnings if text.startswith("suspicious run.mcap: ")]


@pytest.mark.parametrize(
    "seed",
    [*range(2), *(pytest.param(k, marks=pytest.mark.slow if k < 4 else pytest.mark.study) for k in range(2, 20))],
)
def test_neither_says_a_word_of_a_clean_run(tmp_path, seed):
    """Two bodies, of slow tests four, in the study twenty, of 0.5 to 120 kg under T1 to T4, with IMUs off the point Q. By chance: below 1e-6 a run."""
    run = clean(seed)
    path = run.write(tmp_path / "run.mcap")
    assert inspect_run(path).findings == []
    assert experiment_findings(load_run(path, run.experiment.recording), run.experiment) == []


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.study)])
def test_identify_is_silent_on_clean_runs(tmp_path, seed):
    run = clean(seed)
    result = identify_files([run.write(tmp_path / "run.mcap")], run.experiment)
    assert not [text for text in result.warnings if "suspicious" in text]


def test_hands_on_the_body_are_not_judged(tmp_path, generator):
    """A force that no rigid body explains: nothing is said of signs and frames."""
    run = good()
    push = 200 * np.cumsum(generator.normal(size=run.wrench.force.shape), axis=0) / 60
    spoiled = run.without(-push, -0.3 * push[:, ::-1])
    assert experiment_findings(load_run(spoiled.write(tmp_path / "run.mcap")), run.experiment) == []


def test_without_an_accelerometer_nothing_is_found(tmp_path):
    run = SPOILED["opposite sign"][1](good()).of_imu(np.eye(3), 0 * np.eye(3))
    assert judged(run.write(tmp_path / "run.mcap"), T1) == []


def test_of_a_long_free_flight_nothing_is_said(generator):
    """Four seconds: an orbit, a parabola. The force is zero, the moment a flywheel's; the lever alone makes 2 m/s²."""
    judged_flights = 0
    for seed in range(5):
        imu = throw(seed, seconds=(4.0, 4.0), rate=200.0)
        moment = np.gradient(imu.angular_velocity, imu.time, axis=0) * [0.1, 0.2, 0.25]
        wrench = WrenchSignal(imu.time, 0.01 * generator.normal(size=moment.shape), moment)
        judged_flights += float(np.linalg.norm(imu.specific_force.mean(axis=0))) > 2
        assert wrench_findings(wrench, imu, DeclaredRig(mass=1.0), wrench_topic="w", imu_topic="i") == []
    assert judged_flights > 1


def test_the_command_takes_an_experiment(tmp_path, capsys):
    path = SPOILED["force in lbf"][1](good()).write(tmp_path / "run.mcap")
    text = (tmp_path / "e.toml", tmp_path / "none.toml")
    from tests.helpers.spoiled_runs import ROOT

    text[0].write_text((ROOT / "uq" / "examples" / "t1-10s.toml").read_text() + 'force_unit = "lbf"\n')
    assert main(["inspect", str(path)]) == 0  # nobody knows the mass
    assert main(["inspect", str(path), "--experiment", "uq/examples/t1-10s.toml"]) == 1
    assert 'force_unit = "lbf"' in capsys.readouterr().out
    assert main(["inspect", str(path), "--experiment", str(text[0])]) == 0
    assert main(["inspect", str(path), "--experiment", str(text[1])]) == 2
    assert capsys.readouterr().err.startswith("error: ")


def wrist_findings(change=lambda force, moment, specific: (force, moment)):
    """Of a payload that an arm turns all ways, with offsets of the sensor as large as a tenth of its weight."""
    of_run = wrist_runs.run(change)
    known = DeclaredRig(mass=wrist_runs.MASS, r_cg=wrist_runs.R_CG, sigma_r_cg=np.full(3, 1e-3))
    imu = ImuSignal(of_run.t, of_run.omega, of_run.specific_force)
    wrench = WrenchSignal(of_run.t, of_run.force, of_run.moment)
    return wrench_findings(wrench, imu, known, wrench_topic="wrench", imu_topic="imu")


def test_an_arm_that_turns_all_ways():
    """Neither the sensor's zero nor the small mean of gravity feigns another mass."""
    assert wrist_findings() == []
    (sign,) = wrist_findings(lambda force, moment, _: (-force, -moment))
    assert 'wrench = "on_sensor"' in sign.text
    kilograms = wrist_findings(lambda force, moment, _: (force / 9.80665, moment / 9.80665))
    assert 'force_unit = "kgf"' in kilograms[0].text
    weight = wrist_runs.MASS
    removed = wrist_findings(lambda force, moment, specific: (force - weight * specific, moment))
    assert [finding.label for finding in removed] == ["weight"]


def test_a_moments_unit_is_that_which_puts_the_centre_where_it_is_declared():
    """Ten times the moment is near kgf·cm, and neither N·mm nor N·cm; three times is near none."""
    (tenfold,) = wrist_findings(lambda force, moment, _: (force, 10 * moment))
    assert 'set moment_unit = "kgf*cm" in [recording]; or moment_unit = "lbf*inch", which fits as well' in tenfold.text
    (threefold,) = wrist_findings(lambda force, moment, _: (force, 3 * moment))
    assert threefold.label == "point"
