"""What is said against a result: the laboratory of tests/helpers/laboratory.py errs, and the engine must name or cover it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identify.errors.load_cell.filter import FILTER
from identify.errors.registry import ERRORS
from identify.exceptions import RunError
from identify.judge import judged_part
from identify.judge.finding_pages import all_findings
from identify.judge.run_findings.saturation import saturated
from identify.results.identification_result import MISFIT
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import identified, run_of
from tests.helpers.troubles import TROUBLES

SHORT = {"seconds": 15.0}


@pytest.mark.parametrize("seed", [11, pytest.param(12, marks=pytest.mark.study)])
@pytest.mark.parametrize(
    ("method", "still"),
    [
        ("source", False), ("joint", True), *(pytest.param(method, False, marks=pytest.mark.slow) for method in ("gls", "joint")),
        *(pytest.param(method, True, marks=pytest.mark.study) for method in ("source", "gls")),
    ],
)  # fmt: skip
def test_clean_runs_are_not_suspected(method, still, seed):
    measured = measure(seed, still=still, **SHORT)
    result = identified(measured, method)
    assert result.consistency == ()
    assert MISFIT not in result.contributions
    assert (np.abs(result.inertia - measured.truth) < 2 * np.ptp(result.interval95, axis=1) / 2).all()


NAMED = [
    ("gyro scale", 8e-3, "gyro scale"), ("cable", 1.5, "cable"), ("flexible mounting", 1.0, "flexible mounting"),
    ("cross-talk", 5e-3, "cross-talk"), ("gain drift", 6e-3, "gain drift"), ("ringing mounting", 0.7, "resonance"),
    ("slip", 6e-3, "slip"), ("clock", 4e-4, "clock"),
]  # fmt: skip


METHODS = ("joint", "source")
ALIKE = {"flexible mounting", "cross-talk", "gain drift"}
"""Named as the others are; what they do: runs/identification/test_error_models.py."""


@pytest.mark.parametrize(
    ("method", "trouble", "size", "name"),
    [
        pytest.param(METHODS[k % 2], *case, marks=pytest.mark.slow if case[0] in ALIKE else ())
        for k, case in enumerate(NAMED)
    ]
    + [pytest.param(METHODS[1 - k % 2], *case, marks=pytest.mark.study) for k, case in enumerate(NAMED)],
)
def test_a_trouble_is_named_and_covered(method, trouble, size, name):
    """Each moves some component by ten standard uncertainties of the joint estimate or more."""
    measured = measure(3, **TROUBLES[trouble].options(size, 3), **SHORT)
    result = identified(measured, method)
    assert name in {verdict.cause for verdict in result.consistency[: 1 + (name == "resonance")]}
    assert any(name in text for text in result.warnings)
    half = np.ptp(result.interval95, axis=1) / 2
    assert (np.abs(result.inertia - measured.truth) < 2 * half).all()
    assert MISFIT in result.contributions


def test_a_long_run_is_judged_by_its_first_part(monkeypatch):
    """The body slips midway, behind the part that is judged."""
    monkeypatch.setattr(judged_part, "PERIODS", (15, 15))
    result = identified(measure(3, **TROUBLES["slip"].options(6e-3, 3), **SHORT), "source")
    assert "slip" not in {verdict.cause for verdict in result.consistency}


@pytest.mark.parametrize(
    ("mass", "frequency"),
    [(0.3, 1.5), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.9, 4.0), (0.03, 1.5)))],
)
def test_what_has_no_name_is_said_first_and_widens_the_interval(mass, frequency):
    """Within the motion's band a liquid is imitated by gains, air and a cable, each of which explains little of it."""
    measured = measure(0, slosh_mass=mass, slosh_frequency=frequency, **SHORT)
    result = identified(measured)
    assert result.consistency[0].cause == "unexplained"
    assert (np.abs(result.inertia - measured.truth) < np.ptp(result.interval95, axis=1)).all()


@pytest.mark.slow  # of a file: runs/identification/test_judge.py
def test_the_end_of_a_sensors_range_is_said():
    measured = measure(0, **TROUBLES["clipping"].options(0.1, 0), **SHORT)
    assert {"saturation"} <= {verdict.cause for verdict in identified(measured).consistency}


@pytest.mark.parametrize(
    "values",
    [
        np.round(3 * np.sin(np.arange(4000.0))),  # the next value is as frequent
        np.repeat([0.0, 1.0], 200),  # no signal but a switch
        np.zeros(400),
        np.random.default_rng(0).normal(size=4000),
    ],
)
def test_a_coarse_or_constant_signal_does_not_end_a_range(values):
    run = run_of(measure(0, **SHORT))
    signal = np.resize(values, len(run.t))
    assert saturated(replace(run, omega=np.stack([signal] * 3, axis=1))) == []


def test_an_error_of_the_centre_within_its_uncertainty_is_no_news():
    measured = replace(measure(1, **SHORT))
    stated = identified(measured, r_cg=measured.r_cg + [3e-4, 0, 0])
    surprised = identified(measured, r_cg=measured.r_cg + [3e-4, 0, 0], sigma_r_cg=(1e-5,) * 3)
    assert stated.consistency == ()
    assert surprised.consistency[0].cause == "centre of gravity"


def test_a_cause_that_hides_behind_a_wide_interval_is_named():
    """A delay makes the residuals follow the motion: plain least squares' interval grows until it hides the shift."""
    measured = measure(3, **TROUBLES["delay"].options(6e-3, 3), **SHORT)
    assert [verdict.cause for verdict in identified(measured, "source").consistency] == ["delay"]


def test_a_gyro_that_is_turned_against_the_accelerometer():
    measured = measure(3, **TROUBLES["gyro axes"].options(1e-2, 3), **SHORT)
    result = identified(measured, "joint")
    assert result.consistency[0].cause == "gyro axes"
    assert (np.abs(result.inertia - measured.truth) < np.ptp(result.interval95, axis=1)).all()


@pytest.mark.parametrize("method", ["joint", pytest.param("source", marks=pytest.mark.slow)])
def test_an_axis_of_the_gyro_that_is_late_is_no_g_sensitivity(method):
    result = identified(measure(3, gyro_axis_delay=(0, 4e-3, 0), **SHORT), method)
    assert [verdict.cause for verdict in result.consistency] == ["delay"]
    delays = re.search(r"axes lagged by \((\S+) ± \S+, (\S+) ± \S+, (\S+) ±", result.warnings[-1]).groups()
    np.testing.assert_allclose([float(value.replace("−", "-")) for value in delays], [0, 4, 0], atol=0.3)


def test_stamps_that_jitter_are_the_reason_of_a_refusal():
    measured = measure(0, **TROUBLES["jitter"].options(1.5e-3, 0))
    with pytest.raises(RunError, match=r"does not identify .*: the stamps of the wrench jitter by 1\.\d+ ms"):
        identified(measured, "source")


@pytest.mark.parametrize("method", ["source", pytest.param("joint", marks=pytest.mark.slow)])
def test_least_squares_and_the_fit_of_force_and_moment_differ(method, monkeypatch):
    """What no cause would name moves the two apart."""
    monkeypatch.setattr("identify.judge.causes.ERRORS", {})
    monkeypatch.setattr("identify.judge.judged_result.UNEXPLAINED", np.inf)
    measured = measure(3, **TROUBLES["sloshing"].options(0.3, 3), **SHORT)
    result = identified(measured, method)
    assert [verdict.cause for verdict in result.consistency] == ["least squares"]
    assert "ordinary least squares and the fit of force and moment together differ by" in result.warnings[-1]
    assert MISFIT in result.contributions


@pytest.mark.parametrize(
    ("late", "words"),
    [
        (4e-3, "as if force and moment lagged by (4.00 ± 0.10, 4.00 ± 0.10) ms (filter)"),
        (-4e-3, "as if the IMU lagged force and moment by (4.00 ± 0.10, 4.00 ± 0.10) ms (filter)"),
    ],
)
def test_who_came_late_is_said_without_a_minus(late, words):
    assert FILTER.words.phrase(np.full(2, late), np.full(2, 1e-4)) == words
    assert "declare the delay, or let method joint estimate it" in FILTER.words.cure


def test_the_docs_name_every_finding():
    table = (Path(__file__).parents[3] / "docs" / "explanation" / "troubles.md").read_text("utf-8")
    labels = [
        *(error.label for error in ERRORS.values() if error.label),
        *(finding.label for finding in all_findings()),
    ]
    assert [label for label in labels if f"`{label}`" not in table] == []
