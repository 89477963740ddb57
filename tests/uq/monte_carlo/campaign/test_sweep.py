"""Sweeps: at each value the campaign itself, from the same draws; keys and values that cannot be are one line."""

import json

import numpy as np
import pytest

from tests.helpers.small_campaign import TRIALS, document
from uq import sweep
from uq.cli.main import main
from uq.cli.terminal.options import swept_values
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.campaign.campaign import montecarlo

KEY, VALUES = "source.M_precision.sigma", ("0.2 N*m", "0.8 N*m")


@pytest.fixture(scope="module")
def experiment():
    return Experiment.from_dict(document())


@pytest.fixture(scope="module")
def swept(experiment):
    return sweep(experiment, {KEY: VALUES, "body.inertia.I33": ["0.37 kg*m^2"]}, trials=TRIALS, trajectories="T1")


def test_a_value_is_its_own_campaign(experiment, swept):
    alone = montecarlo(experiment.with_source("M_precision", sigma="0.8 N*m"), trials=TRIALS, trajectories="T1")
    of_sweep = sweep(experiment, {KEY: VALUES[1:]}, trials=TRIALS, trajectories="T1")["0.8 N*m"]
    np.testing.assert_array_equal(of_sweep.errors["T1"], alone.errors["T1"])
    assert swept["0.8 N*m", "0.37 kg*m^2"].nominal[5] == 0.37


def test_the_same_draws_make_differences_sharp(swept):
    """With the moment's noise alone, four times sigma is four times every error."""
    by_value = [swept[value, "0.37 kg*m^2"]["T1", "central"].sources["M_precision"] for value in VALUES]
    np.testing.assert_allclose(by_value[1].three_sigma, 4 * by_value[0].three_sigma, rtol=1e-9)


def test_an_array_of_all_figures(swept):
    data = swept.to_xarray()
    assert data.three_sigma.dims == (KEY, "body.inertia.I33", "trajectory", "estimator", "case", "component")
    total = swept["0.2 N*m", "0.37 kg*m^2"]["T1", "central"].total
    chosen = data.sel({KEY: "0.2 N*m", "trajectory": "T1", "estimator": "central", "case": "total"})
    np.testing.assert_array_equal(chosen.mean_error_standard_error[0], total.mean_error_standard_error)
    frame = swept.to_frame().loc[("0.2 N*m", "0.37 kg*m^2", "T1", "central", "total", "I22")]
    assert frame["three_sigma [kg·m²]"] == total.three_sigma[3]


def test_values_are_compared_with_one_from_the_same_draws(swept):
    """Of the moment's noise alone 3σ would be fourfold; with all errors together less, and known the better."""
    compared = swept.against(("0.2 N*m", "0.37 kg*m^2"))
    (ratio,) = [ratio for names, ratio in compared.ratios.items() if names[-1] == "central"]
    totals = [swept[value, "0.37 kg*m^2"]["T1", "central"].total for value in VALUES]
    np.testing.assert_allclose(ratio.value, totals[1].three_sigma / totals[0].three_sigma, rtol=1e-12)
    apart = [np.square(t.three_sigma_standard_error / t.three_sigma) for t in totals]
    assert (ratio.standard_error < 0.8 * ratio.value * np.sqrt(np.sum(apart, axis=0))).all()
    with pytest.raises(KeyError, match=r"0\.3 N"):
        swept.against(("0.3 N*m", "0.37 kg*m^2"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--against", "T9"], "--against is 'T9': choose one of T1, T2, T3, T4"),
        (["--against", "T1", "--trajectory", "T1"], "--against T1 has nothing beside it: give another --trajectory"),
        (["--sweep", f"{KEY}=1 N*m,2 N*m", "--against", "3 N*m"], "--against is '3 N*m': did you mean 2 N*m? choose"),
    ],
)
def test_nothing_is_run_to_be_compared_with_nothing(options, words, capsys):
    assert main(["montecarlo", "barreto2016", "--trials", "1000000", *options]) == 2
    assert words in capsys.readouterr().err


def test_the_page_names_mean_errors_beyond_3_sigma(experiment):
    result = sweep(experiment, {KEY: VALUES}, trials=TRIALS, trajectories="T1")
    section = result.section()
    assert section.verdict == "Biased: central (T1). Unbiased within 3σ: smoothed (T1)."
    assert section.findings == ["T1, central: the mean error exceeds 3σ at 2 of 2 values."]
    assert section.assumptions


def test_the_command(tmp_path, results_follow_their_schema, blank_pictures):
    options = ["--trials", str(TRIALS), "--estimator", "central", "--trajectory", "T1", "--out", str(tmp_path / "out")]
    options += ["--against", "0.5 N*m"]
    assert main(["montecarlo", "barreto2016", "--sweep", f"{KEY}=0.2 N*m:0.8 N*m:3", *options]) == 0
    content = json.loads((tmp_path / "out" / "result.json").read_text("utf-8"))
    assert len(content["against"]["rows"]) == 2 * 6
    assert content["values"] == {KEY: ["0.2 N*m", "0.5 N*m", "0.8 N*m"]}
    assert {"sweep-T1-central.svg", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_its_figure_is_drawn(experiment):
    result = sweep(experiment, {KEY: VALUES}, trials=TRIALS, trajectories="T1", estimators="central")
    left, right = result.figures()["sweep-T1-central"].axes
    np.testing.assert_array_equal(left.lines[0].get_xdata(), [0.2, 0.8])
    assert left.get_xlabel() == f"{KEY} [N*m]"
    assert right.get_ylabel() == "mean error [g·m²]"


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "no values to sweep"),
        ({KEY: []}, "no values to sweep"),
        ({"sigma": ["1"]}, "unknown key 'sigma'"),
        ({"source.M_precision": ["1"]}, "unknown key 'source.M_precision'"),
        ({"source.nothing.sigma": ["1 N"]}, "unknown source 'nothing'"),
        ({KEY: ["1 kg"]}, "sigma"),
    ],
)
def test_what_cannot_be_swept_is_one_line(experiment, values, words):
    with pytest.raises(ExperimentError, match=words):
        sweep(experiment, values, trials=2)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("body.mass=1 kg:2 kg:3", ["1 kg", "1.5 kg", "2 kg"]),
        ("body.mass=1 kg:2:2", ["1 kg", "2 kg"]),
        ("trajectory.T1.precessions=8, 9", ["8", "9"]),
    ],
)
def test_values_on_the_command_line(text, values):
    assert swept_values(text)[1] == values


@pytest.mark.parametrize("text", ["body.mass", "body.mass=", "m=1 kg:2 kg", "m=a:b:3", "m=1 kg:2 N:3", "m=1:2:1"])
def test_a_range_that_is_none(text):
    with pytest.raises(ExperimentError, match="--sweep is"):
        swept_values(text)
