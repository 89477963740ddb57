"""What a user of Python writes at the first try gives an answer, or one line that says what is meant."""

import json
import subprocess
import sys

import numpy as np
import pytest

import uq
from identify.estimation.static_poses.centre import centre
from identify.identification import identify
from identify.signals.run import Run
from tests.helpers.pose_lab import directions, wrench_of
from tests.helpers.small_campaign import document
from uq.experiment.experiment import Experiment
from uq.runs.identification.centre_prior import centre_provenance, load_centre

CALLS = {
    'Experiment.load("nope.toml")': "No experiment file, and no preset of the name: 'nope.toml'",
    'uq.montecarlo(experiment, trials="100")': "Argument `trials` must be a whole number, but is '100'",
    "uq.montecarlo(experiment, trials=2, seed=0.5)": "Argument `seed` must be a whole number, but is 0.5",
    'identify.identify(run, r_cg=[0, 0, 0.05], estimator="smoothed")': "must be an EstimatorSpec, but is 'smoothed'",
    'uq.identify_files("run.mcap", experiment, centre=identify.Centre)': "must be a Centre or the path of its centre.json",
    "identify.identify(run, r_cg=[0, 0, 53])": "r_cg is [0, 0, 53]: give it in metres",
    "identify.identify(replace(run, t=1e3 * run.t), r_cg=[0, 0, 0.05])": "give its times in seconds",
    "identify.identify(uq.simulate(experiment), r_cg=[0, 0, 0.05])": "has a SimulatedRun: give its .run",
    "identify.identify([run, replace(run, name='again')], r_cg=[0, 0, 0.05])": "again is given twice: give each run once",
    "identify.identify(replace(run, omega=0 * run.omega + 0.3), r_cg=[0, 0, 0.05])": "never changes: record a body that turns to and fro",
    'identify.identify(run, r_cg="0 0 53 mm")': "r_cg must be an array of numbers in SI, but is '0 0 53 mm'",
    'identify.EstimatorSpec("a", "savitzky-golay", band="1.5 Hz")': "`band` must be a number, of hertz or of points",
    "identify.Run.from_arrays(run.t.astype('datetime64[s]'), run.force, run.moment, run.omega)": "is a date: give seconds",
    "uq.montecarlo(experiment, trials=2, seed=None)": "Argument `seed` must be a whole number, but is None",
    "identify.omega_r(np.ones((9, 3)), np.ones((9, 3)))": "omega_r takes one sample, (3,), but has (9, 3), (9, 3)",
}
SCRIPT = """
import json, sys
from dataclasses import replace
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
import identify, uq
from uq import Experiment
experiment = Experiment.load("barreto2016")
t = np.arange(400) / 100
run = identify.Run.from_arrays(t, *np.random.default_rng(0).normal(size=(3, 400, 3)))
for call in json.load(sys.stdin):
    try:
        eval(call)
    except (ValueError, TypeError, OSError) as error:
        print(json.dumps(str(error)))
"""
"""In a process of its own, since the tests check the types of arguments before the functions do."""


def test_a_mistake_is_said_in_the_words_of_the_call():
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, input=json.dumps(list(CALLS)), capture_output=True, text=True, check=True)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(messages) == len(CALLS)
    for message, words in zip(messages, CALLS.values(), strict=True):
        assert words in message
        assert "\n" not in message


def test_one_path_is_a_run(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"run\.mcap"):
        uq.identify_files(str(tmp_path / "run.mcap"), Experiment.from_dict(document()))


def test_a_centre_counts_as_its_file_does():
    up = directions(np.random.default_rng(1), 12, None)
    poses = centre(*wrench_of(up), up)
    assert load_centre(poses) is poses
    assert "file" not in centre_provenance(poses, poses)


@pytest.mark.parametrize(
    ("moment_unit", "angular_unit", "words"),
    [(1.0, 1.0, []), (1e3, 1.0, ["the moment in N·mm"]), (1.0, np.degrees(1.0), ["omega in deg/s"])],
)
def test_arrays_in_another_unit_are_named(moment_unit, angular_unit, words):
    """A sphere of 20 kg and 0.2 m radius, 0.32 kg·m², held by its centre."""
    t = np.arange(0, 10, 0.005)
    omega = 2 * np.sin(np.outer(t, [9.0, 8.0, 7.0]))
    moment = 0.32 * 2 * np.cos(np.outer(t, [9.0, 8.0, 7.0])) * [9.0, 8.0, 7.0]
    run = Run.from_arrays(t, np.full_like(omega, 20 * 9.81 / 3**0.5), moment_unit * moment, angular_unit * omega)
    named = [text for text in identify(run, r_cg=(0, 0, 0)).warnings if text.startswith("the tensor is too ")]
    assert len(named) == len(words)
    assert all(word in text for text, word in zip(named, words, strict=True))
