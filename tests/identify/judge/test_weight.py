"""A body that turns all ways is judged like any other; one that falls is not."""

from dataclasses import replace

import numpy as np
import pytest

from identify.estimation.joint.priors import Alignment
from identify.identification import identify
from identify.judge.judged_fits import lasting
from tests.helpers import wrist_runs
from tests.helpers.wrist_runs import MASS, R_CG, TENSOR, G, run


def identified(of_run):
    alignment = Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=0.0, sigma_accelerometer_bias=0.0)
    return identify(of_run, r_cg=R_CG, sigma_r_cg=(0.05,) * 3, method="joint", gravity=G, alignment=alignment)


def test_gravity_lasts_where_its_mean_in_the_body_does_not():
    of_run = run()
    assert np.linalg.norm(of_run.specific_force.mean(axis=0)) < 0.3 * G
    assert lasting(of_run, of_run.specific_force) == pytest.approx(G, rel=0.01)
    assert lasting(of_run, of_run.force) == pytest.approx(MASS * G, rel=0.2)  # the mean acceleration of the centre adds


def test_a_throw_has_no_lasting_force():
    """What a lever's end reads in flight is large, and its mean in kept axes is a difference of speeds over time."""
    t, _, _, omega, _ = wrist_runs.signals()
    alpha = np.gradient(omega, t, axis=0)
    lever = np.array([0.3, 0, 0])
    in_flight = np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
    assert np.sqrt(np.mean(in_flight**2)) > 0.3 * G / np.sqrt(3)
    about = attitude_mean(t, in_flight)
    assert about < 0.05 * G


def attitude_mean(t, vectors):
    return np.linalg.norm(wrist_runs.attitude(t).apply(vectors).mean(axis=0))


def test_a_sound_run_is_not_suspected():
    result = identified(run())
    assert result.warnings == ()
    truth = TENSOR[np.triu_indices(3)]
    assert (np.abs(result.inertia - truth) < np.ptp(result.interval95, axis=1)).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda force, moment, specific: (force, -moment), "no mass distribution"),
        (lambda force, moment, specific: (force, moment / 10), "look as if"),
    ],
    ids=["moment reversed", "moment in daN·m"],
)
def test_a_wrong_wrench_is_warned_of(change, said):
    result = identified(run(change))
    assert any(said in text for text in result.warnings)
    assert result.consistency


def test_a_gyro_in_degrees_per_second_is_no_fall():
    """Its axes keep nothing, so gravity does not last in them; yet no lever explains the specific force."""
    of_run = run()
    wrong = replace(of_run, omega=np.degrees(of_run.omega))
    assert lasting(wrong, wrong.specific_force) < 0.3 * G
    assert any(text for text in identified(wrong).warnings if "noise" in text or "look as if" in text)
