"""Rounding in the law: of a signal that rests, of one that nothing random acts on; and what is said where it differs."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from tests.helpers.source_lab import BODY, BY_SAMPLES, ESTIMATORS, experiment, simulated, source, tensor_of
from uq.analysis.propagation.experiment_law import law
from uq.analysis.propagation.law_validation import standard_errors_apart, validate_law
from uq.analysis.propagation.uncovered_sources import BeyondLawError
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import montecarlo
from uq.report.tables.law_validation import findings, open_intervals
from uq.sources.kinds.quantisation import STEPS_OF_NOISE

STEP = 0.004
ROUNDING = source("w_step", "omega", "quantisation", step=[f"{STEP} rad/s"] * 3)
ONE_BY_ONE = {
    "kind": "harmonic", "still": "omb", "angular_velocity": "0.425 rad/s", "angular_acceleration": "4 rad/s^2",
    "duration": "12 s", "rate": "100 Hz", "ramp": "0.3 s",
}  # fmt: skip
"""About b1, then b2, then b3: each axis rests in two thirds of the run."""


def harmonic(*sources):
    tables = {"body": BODY, "platform": {"gravity": "9.81 m/s^2", "r_cg_from_omb": ["0 m", "0 m", "0.11 m"]}}
    return Experiment.from_dict(
        {**tables, "trajectory": {"T": ONE_BY_ONE}, "estimator": ESTIMATORS, "source": list(sources)}, "."
    )


def noise(sigma):
    return source("w_noise", "omega", "precision", sigma=[f"{sigma} rad/s"] * 3)


def least_squares(given, round_to):
    """The estimate of rounded readings, sample by sample in plain NumPy [kg·m²]."""
    wrench, omega = simulated(given)
    omega = round_to * np.round(omega / round_to) if round_to else omega
    alpha = (omega[2:] - omega[:-2]) / 2 * 100
    omega, force, moment = omega[1:-1], wrench[1:-1, :3], wrench[1:-1, 3:]
    columns = []
    for k in range(6):
        tensor = tensor_of(np.eye(6)[k])
        columns.append((alpha @ tensor + np.cross(omega, omega @ tensor)).ravel())
    about_cg = moment - np.cross(given.r_cg_from_q, force)
    return np.linalg.lstsq(np.stack(columns, axis=1), about_cg.ravel(), rcond=None)[0]


def test_rounding_alone_of_axes_that_rest_is_exact():
    """Once it was white noise of step²/12 all along: three times the mean error, and a dispersion that is not."""
    given = harmonic(ROUNDING)
    total = law(given, estimators="central")["T", "central"].total
    exact = least_squares(given, STEP) - given.inertia
    np.testing.assert_allclose(total.mean_error, exact, atol=1e-6 * np.abs(exact).max())
    assert not total.three_sigma.any()
    white = law(harmonic(noise(STEP / np.sqrt(12))), estimators="central")["T", "central"].total
    by_rounding = exact - (least_squares(given, 0) - given.inertia)
    assert 2 < (white.mean_error - white.textbook_value)[0] / by_rounding[0] < 5


def test_the_mean_error_of_rounding_is_added_to_what_other_signals_have():
    """The load cell's noise leaves the gyro's rounding as it is."""
    cell = source("M_noise", "M", "precision", sigma=["0.02 N*m"] * 3)
    both, alone, cell_alone = (law(harmonic(*x), estimators="central") for x in ([ROUNDING, cell], [ROUNDING], [cell]))
    ours = both["T", "central"]
    shift = alone["T", "central"].total.mean_error - cell_alone["T", "central"].total.textbook_value
    np.testing.assert_allclose(ours.total.mean_error - ours.sources["M_noise"].mean_error, shift, atol=1e-9)
    np.testing.assert_array_equal(ours.total.covariance, cell_alone["T", "central"].total.covariance)
    result = montecarlo(harmonic(ROUNDING, cell), trials=300, plan=BY_SAMPLES, estimators="central")
    for figure in ("mean_error", "three_sigma"):
        apart = standard_errors_apart(ours.total, result["T", "central"].total, figure)
        assert (np.abs(apart) < 4.5).all(), (figure, apart)  # 1e-4 false alarms


def test_with_noise_of_half_a_step_the_rounding_at_rest_is_white_noise():
    """In closed form for one sample at rest, and for the estimate against the Monte Carlo by samples."""
    sigma = STEPS_OF_NOISE * STEP
    places = np.arange(-9, 10)
    chance = np.diff(stats.norm.cdf((np.append(places, 10) - 0.5) * STEP, scale=sigma))
    assert (places * STEP) ** 2 @ chance == pytest.approx(sigma**2 + STEP**2 / 12, rel=0.03)
    given = harmonic(ROUNDING, noise(1.05 * sigma))
    predicted = law(given, estimators="central")["T", "central"].total
    result = montecarlo(given, trials=300, plan=BY_SAMPLES, estimators="central")["T", "central"].total
    for figure in ("mean_error", "three_sigma"):
        assert (np.abs(standard_errors_apart(predicted, result, figure)) < 4.5).all()  # 1e-4 false alarms


def test_with_less_noise_the_rounding_at_rest_is_refused():
    """Neither white nor the same in every trial; the line names axis, rest and what leaves it out."""
    with pytest.raises(
        BeyondLawError, match=r"rounds axis 1 to 0\.004, which rests in 6\d % of the run with noise below"
    ):
        law(harmonic(ROUNDING, noise(0.4 * STEP)))


@pytest.fixture(scope="module")
def compared():
    given = experiment(noise(2e-3), source("M_noise", "M", "precision", sigma=["0.02 N*m"] * 3))
    return law(given, estimators="central"), montecarlo(given, trials=200, estimators="central")


def shifted(predicted, errors):
    """The law, so many standard errors off in I11."""
    breakdown = predicted["T", "central"]
    total = breakdown.total.shifted(np.array([errors, 0, 0, 0, 0, 0]))
    changed = dataclasses.replace(breakdown, groups={**breakdown.groups, "total": total})
    return dataclasses.replace(predicted, breakdowns={"T": {"central": changed}})


def test_five_standard_errors_between_law_and_monte_carlo_are_said(compared):
    predicted, result = compared
    error = result["T", "central"].total.mean_error_standard_error[0]
    apart = predicted["T", "central"].total.mean_error[0] - result["T", "central"].total.mean_error[0]
    for errors, said in ((4.9, 0), (5.1, 1)):
        validation = validate_law(shifted(predicted, errors * error - apart), result)
        lines = [text for text in findings(validation) if "standard errors or more apart" in text]
        assert len(lines) == said
        assert all(
            f"attention: {line}" in validation.notes() and line in validation.section().findings for line in lines
        )
    assert "T, central: law and Monte Carlo are 5 standard errors or more apart" in lines[0]
    assert "mean error of I11" in lines[0]
    assert "I22" not in lines[0]


def test_rejected_intervals_are_one_line_with_sizes(compared):
    predicted, result = compared
    assert not [text for text in findings(validate_law(predicted, result)) if "rejected" in text]
    validation = validate_law(shifted(predicted, 1e-2), result)
    (line,) = [text for text in findings(validation) if "rejected" in text]
    assert "of the law's 95 % intervals are rejected (JCGM 101, 8.1): total (I11); the furthest, I11 of total" in line
    verdict = validation.verdicts[0].law
    assert f"the tolerance is {1e3 * verdict.tolerance[0]:.2g}" in line.replace("0.50", "0.5").replace("0.050", "0.05")
    assert f"off by {1e3 * verdict.distance[0]:.1f}" in line


def test_trials_that_do_not_decide_are_said(compared):
    """Of 200 trials an end is known to ± 0.4 u, more than half a digit of u where that begins with 1 or 2."""
    validation = validate_law(*compared)
    few = sum(word == "open" for row in validation.records() for word in [row["law"]])
    (line,) = open_intervals(validation)
    assert f"T, central: {few} of 30 of the law's intervals stay open" in line
    assert few
