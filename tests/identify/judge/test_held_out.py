"""Runs are predicted by the others as well as they should be, and no better: tests/helpers/laboratory.py has the truth."""

from dataclasses import replace

import numpy as np
import pytest

from identify.estimation.joint.priors import ConstantError
from identify.exceptions import RunError
from identify.identification import identify
from identify.judge import held_out
from identify.results.held_out_result import LEVEL
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.power_spectrum import motion_band
from tests.helpers.changed_result import changed
from tests.helpers.laboratory import NOISE, measure
from tests.helpers.laboratory_mechanics import INERTIA
from tests.helpers.laboratory_runs import identified, run_of

pytestmark = pytest.mark.usefixtures("unjudged")
GAINS = (0.0, 0, 0, 0.01, 0.01, 0.01)


def validated(measured, method="source", **options):
    return identified(measured, method, validate=True, **options).validation


@pytest.fixture(scope="module")
def three():
    return [measure(seed, seconds=10.0) for seed in range(3)]


def test_clean_runs_are_explained_by_noise_as_white_noise_has_it(three):
    """Of white noise so much is in the band: 2 · 1.2 B / rate of its variance, 1.2 B being what is compared."""
    validation = validated(three)
    assert validation.explained
    assert "1 %" in validation.tables()[0].note
    assert LEVEL == 0.01
    runs = [run_of(each) for each in three]
    share = 2.4 * max(motion_band(run.omega, run.rate) for run in runs) / runs[0].rate
    force = np.sqrt(share) * np.hypot(NOISE["force"], three[0].mass * NOISE["accelerometer"])
    for run in validation.runs:
        np.testing.assert_allclose(run.noise[:3], force, rtol=0.15)  # 260 degrees of freedom: four of 4.4 %, less taken
        assert (run.noise[3:] > 0.8 * np.sqrt(share) * NOISE["moment"]).all()
        assert (np.abs(run.ratio - 1) < 5 * np.sqrt(0.5 / run.degrees_of_freedom + 0.5 / 250)).all()


def test_the_estimates_part_is_its_covariance_through_the_motion(three):
    """Moments of an error of the tensor alone, Omega_R by hand: the offset takes the mean."""
    exact = [replace(each, r_cg=three[0].r_cg) for each in three]
    stated = {"sigma_r_cg": (0, 0, 0), "mass": None}  # without a mass, moments about the centre of gravity alone
    validation = validated(exact, **stated)
    covariance = identified(exact[1:], **stated).covariance
    omega = three[0].omega
    alpha = np.gradient(omega, 1 / 400, axis=0)
    rows = []
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0
        rows.append(alpha @ unit + np.cross(omega, omega @ unit))
    matrix = np.stack(rows, axis=2)[40:-40]
    matrix = matrix - matrix.mean(axis=0)
    expected = np.sqrt(np.einsum("nap,pq,naq->a", matrix, covariance, matrix) / len(matrix))
    assert validation.names == ("M1", "M2", "M3")
    np.testing.assert_allclose(validation.runs[0].of_estimate, expected, rtol=0.1)


OTHERS = {
    "another body": lambda each: measure(2, seconds=10.0, inertia=1.01 * INERTIA),
    "opposite moment": lambda each: replace(each, moment=-each.moment),
    "opposite rotation": lambda each: replace(each, omega=-each.omega),
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_run_that_is_not_of_the_others_is_named(three, name):
    result = identified([*three[:2], OTHERS[name](three[2])], validate=True)
    assert not result.validation.explained
    assert result.validation.text.startswith("run 2 is not predicted by the other runs")
    assert result.validation.text in result.warnings


WRONG = {
    "tensor": lambda estimate: changed(estimate, inertia=1.01 * estimate.inertia),
    "sign": lambda estimate: changed(estimate, inertia=-estimate.inertia),
    "mass": lambda estimate: changed(estimate, mass=1.01 * estimate.mass),
    "centre of gravity": lambda estimate: changed(estimate, r_cg=estimate.r_cg + [0.002, 0.0, 0.0]),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_prediction_is_seen(three, name, monkeypatch):
    right = held_out._estimate
    monkeypatch.setattr(held_out, "_estimate", lambda *given: WRONG[name](right(*given)))
    assert len(validated(three[:2]).failing) == 2


def test_a_declared_gain_explains_what_it_may(three):
    """One that all runs share is in the estimate too: it does not explain what one run has alone."""
    gain = ConstantError("cell_matrix", np.zeros(36), np.diag(np.diag(np.square(GAINS)).ravel()))
    mixed = [three[0], measure(1, seconds=10.0, cell_gain=GAINS)]
    assert len(validated(mixed, errors={"gain": gain}).failing) == 2
    assert validated(mixed, errors={"gain": gain._replace(shared=False)}).explained


def test_halves_of_a_run_in_which_the_body_slips():
    validation = validated(measure(3, seconds=20.0, slip=(0.0, 0.002, 0.0)))
    assert validation.halves
    assert not validation.explained
    assert "half is not predicted by the other half" in validation.text
    assert not [table for table in identified(measure(3, seconds=10.0)).tables() if "predicted" in table.caption]


def test_no_alarm_in_clean_halves_and_probabilities_are_uniform():
    """Of 3 runs' 36 probabilities 5 % lie below 0.05; 8 or more with a chance of 5e-4, were they independent."""
    every = [validated(measure(seed, seconds=10.0)) for seed in range(3)]
    assert all(validation.explained for validation in every)
    chances = np.array([run.probability for validation in every for run in validation.runs])
    assert (chances < 0.05).sum() < 8
    assert 0.3 < chances.mean() < 0.7


def test_too_short_a_run_is_a_line(three):
    run = run_of(three[0]).between(4.0, 5.5)
    spec = EstimatorSpec("smoothed", "savitzky-golay", 3.0)
    with pytest.raises(RunError, match="too short to be held out") as caught:
        identify(run, r_cg=three[0].r_cg, mass=three[0].mass, estimator=spec, validate=True)
    assert "give several runs" in str(caught.value)
    assert "\n" not in str(caught.value)


STUDIES = [("source", False, 1, 300), ("source", True, 1, 100), ("source", False, 3, 150), ("gls", False, 1, 200)]


@pytest.mark.study
@pytest.mark.parametrize(("method", "still", "count", "trials"), STUDIES)
def test_false_alarms_are_as_rare_as_stated(method, still, count, trials):
    """At most 1 %: more than the bound below has a chance of 1e-3 at that rate."""
    alarms = 0
    for trial in range(trials):
        runs = [measure(1000 * trial + k, seconds=10.0, still=still) for k in range(count)]
        alarms += not validated(runs, method).explained
    bound = {100: 6, 150: 7, 200: 8, 300: 10}[trials]
    print(f"{method}, {count} run(s), still {still}: {alarms} false alarms in {trials}")
    assert alarms < bound


@pytest.mark.study
@pytest.mark.parametrize("still", [False, True])
def test_the_joint_estimate_predicts(still):
    clean = [measure(seed, seconds=10.0, still=still) for seed in range(3)]
    assert validated(clean, "joint").explained
    other = [*clean[:2], measure(2, seconds=10.0, still=still, inertia=1.02 * INERTIA)]
    assert validated(other, "joint").text.startswith("run 2 is not predicted")
