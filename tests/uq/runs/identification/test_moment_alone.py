"""What the moment alone tells: each cause, put alone into a simulated run, is named and it alone; clean runs say nothing."""

import dataclasses
import re
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from identify.identification import identify
from identify.rigid_body.inertia import pack
from identify.signals.run import Run
from tests.helpers import posed_runs
from tests.helpers.recordings import silenced
from uq.monte_carlo.campaign.simulation import simulate

SIGMA = {"force": 0.1 * np.array([5.0, 5, 10]), "moment": 0.1 * np.array([0.38, 0.46, 0.46]), "omega": np.full(3, 4e-4)}
"""A load cell ten times quieter than the preset's, so that small causes tell."""


@pytest.fixture(scope="module")
def silent(short):
    return simulate(silenced(short), "T1")


def noisy(run, seed, scale=1.0):
    rng = np.random.default_rng(seed)
    return dataclasses.replace(
        run,
        **{name: getattr(run, name) + scale * s * rng.standard_normal(run.t.shape + (3,)) for name, s in SIGMA.items()},
    )


def judged(short, run):
    spec = short.estimator("smoothed")
    return identify(run, r_cg=short.r_cg_from_q, mass=short.mass, estimator=spec).consistency


def _moment(run, more):
    return dataclasses.replace(run, moment=run.moment + more)


CAUSES = {
    "delay": lambda run, up: dataclasses.replace(run, omega=CubicSpline(run.t, run.omega)(run.t - 0.004)),
    "rotation": lambda run, up: dataclasses.replace(
        run, omega=run.omega @ Rotation.from_rotvec([0.02, 0.03, -0.02]).as_matrix()
    ),
    "air": lambda run, up: _moment(run, 0.05 * run.omega + 0.1 * np.abs(run.omega) * run.omega),
    "drift": lambda run, up: _moment(run, np.outer(run.t / run.t[-1], [0.1, 0, -0.05])),
    "centre of gravity": lambda run, up: _moment(run, np.cross([0.004, -0.003, 0.002], run.force)),
    "cable": lambda run, up: _moment(run, np.outer(up[:, 0], [4.0, 0, 4.0])),
    "tensor": lambda run, up: _moment(
        run, 0.01 * (run.t / run.t[-1])[:, None] * np.gradient(run.omega, run.t, axis=0) * [1, 0, 1]
    ),
    "resonance": lambda run, up: _moment(run, np.outer(np.sin(2 * np.pi * 23.4 * run.t), [0.03, 0, 0])),
}


@pytest.fixture(scope="module")
def verdicts_of(short, silent):
    """What is said of a run with a cause."""
    return cache(lambda cause: judged(short, noisy(CAUSES[cause](silent.run, silent.rotation[:, 2, :]), 5)))


@pytest.mark.parametrize("cause", CAUSES)
def test_each_cause_is_named_and_it_alone(verdicts_of, cause):
    verdicts = verdicts_of(cause)
    assert len(verdicts) == 1, verdicts
    assert verdicts[0].cause == cause or cause in verdicts[0].text  # as probable as the one that is named
    assert 1e-3 < verdicts[0].share < 1
    assert verdicts[0].text.startswith("simulated T1: ")


@pytest.mark.parametrize(
    ("scale", "runs"), [(10.0, 2), *(pytest.param(scale, 100, marks=pytest.mark.study) for scale in (1.0, 10.0))]
)
def test_clean_runs_say_nothing(short, silent, scale, runs):
    """Twenty-four tests at 1e-4 a run, and a more probable cause than none."""
    assert [judged(short, noisy(silent.run, seed, scale)) for seed in range(runs)] == [()] * runs


def test_figures_are_those_that_were_put_in(verdicts_of):
    delay = verdicts_of("delay")[0]
    late = float(delay.text.split("lagged by ")[1].split(" ±")[0])
    assert late == pytest.approx(4.0, abs=0.3)
    tone = verdicts_of("resonance")[0]
    assert "a line at 23.4 Hz" in tone.text
    assert tone.axis == "b1"
    turned = verdicts_of("rotation")[0]
    degrees = [abs(float(text.replace("−", "-"))) for text in re.findall(r"([−.\d]+) ±", turned.text)]
    np.testing.assert_allclose(degrees, np.degrees([0.02, 0.03, 0.02]), atol=0.2)
    drift = verdicts_of("drift")[0]
    assert drift.axis == "b1"


def test_a_centre_that_is_declared_far_off_is_no_cause():
    """On an arm, whose acceleration nothing tells: the moment about the centre that was estimated is judged."""
    clean = posed_runs.measured(3, seconds=8.0, rate=100.0)
    run = Run.from_arrays(clean.t, clean.force, clean.moment, clean.omega)
    result = identify([run], r_cg=np.array([0.0, 0.0, 0.05]), sigma_r_cg=np.full(3, 0.1), method="joint")
    assert result.mass is None
    assert result.consistency == ()
    assert (np.abs(result.inertia - pack(posed_runs.TENSOR)) < 4 * result.standard_uncertainty).all()
    np.testing.assert_allclose(result.r_cg, posed_runs.R_CG, atol=1e-3)
    assert (result.standard_uncertainty < 1e-3).all()
