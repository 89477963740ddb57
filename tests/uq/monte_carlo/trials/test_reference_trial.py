"""Every engine against the reference trial of the docs: exactly where its draws can be fed in, else in distribution."""

import dataclasses
import importlib.util
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.helpers.source_lab import one_trial
from uq.analysis.propagation.experiment_law import law
from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo
from uq.monte_carlo.campaign.statistics import Statistics
from uq.monte_carlo.campaign.trial_setup import prepare_engine
from uq.monte_carlo.trials.samples_engine import draw_noise
from uq.sources.draws import draw_constants

SCRIPT = Path(__file__).parents[4] / "docs" / "reference_trial.py"
TRIALS = 200
KEY, INDEX = jax.random.key(5), jnp.asarray(3)
CONSTANT = ("F_bias", "M_bias", "r_cg", "omega_bias")


@pytest.fixture(scope="module")
def reference():
    spec = importlib.util.spec_from_file_location("reference_trial", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def truth(reference, brief):
    return reference.true_signals(brief, "T1")


def only(experiment, *names):
    return dataclasses.replace(experiment, sources=tuple(s for s in experiment.sources if s.name in names))


def engine_of(experiment, name):
    """What runs trials of T1 by central differences."""
    chosen = [experiment.estimator("central")]
    return prepare_engine(experiment, experiment.trajectories["T1"], chosen, engine=name)[0]


def engines_draws(setup):
    """What the engine draws in one trial, as the reference takes it: (n, 3) of noise, (1, 3) of a bias."""
    constants = draw_constants(setup.sources, setup.mixing, KEY, INDEX, float)
    noise = draw_noise(setup, KEY, INDEX)
    return {name: value[None] for name, value in constants.items()} | {name: value.T for name, value in noise.items()}


@pytest.mark.parametrize(("name", "names"), [("samples", None), pytest.param("sums", CONSTANT, marks=pytest.mark.slow)])
def test_fed_with_an_engines_draws_the_estimates_are_its_own(reference, truth, brief, name, names):
    """All cases of a trial; another arithmetic (QR of 9,300 rows against sums) differs by rounding alone.

    Of trials on sums without noise, which they draw as sums.
    """
    experiment = brief if names is None else only(brief, *names)
    engine = engine_of(experiment, name)
    estimates = eqx.filter_jit(one_trial)(engine, KEY, INDEX)
    draws = engines_draws(engine_of(experiment, "samples"))
    rate = experiment.trajectories["T1"].rate
    expected = [reference.estimate(truth, rate, experiment.sources, draws, case.sources) for case in engine.cases]
    np.testing.assert_allclose(estimates[0], expected, atol=1e-11 * experiment.inertia.max())
    assert np.ptp(expected, axis=0).min() > 1e-6  # the cases differ


@pytest.fixture(scope="module")
def groups(brief):
    names = ["total", *dict.fromkeys(source.group for source in brief.sources)]
    return {name: {s.name for s in brief.sources if name in ("total", s.group)} for name in names}


@pytest.fixture(scope="module")
def statistics(reference, truth, brief, groups):
    """Of the reference's own campaign, by group."""
    errors = reference.campaign(truth, 400.0, brief.sources, list(groups.values()), trials=TRIALS, seed=1)
    errors = np.asarray(errors) - brief.inertia
    return {name: Statistics.of(errors[:, k]) for k, name in enumerate(groups)}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["sums", pytest.param("samples", marks=pytest.mark.study)])
def test_an_engines_campaign_has_the_references_distribution(statistics, brief, engine):
    """4 groups, 6 components, 2 figures, 2 engines: 96 comparisons at 4.5 standard errors, a false alarm in 1,500."""
    trials, plan = {"sums": 20_000, "samples": TRIALS}[engine], SamplingPlan(engine=engine)
    result = montecarlo(brief, trials=trials, trajectories="T1", estimators="central", plan=plan)
    for name, expected in statistics.items():
        of_engine = result["T1", "central"].groups[name]
        for figure in ("mean_error", "three_sigma"):
            value, reference = (getattr(of, figure) for of in (of_engine, expected))
            error = np.hypot(*(getattr(of, f"{figure}_standard_error") for of in (of_engine, expected)))
            assert (np.abs(value - reference) <= 4.5 * error + 1e-14).all(), (name, figure, (value - reference) / error)


@pytest.mark.study
def test_the_law_predicts_the_references_trials(statistics, brief):
    """48 comparisons at 4.5 standard errors of the trials: a false alarm in 3,000. Against an engine's trials:
    ``propagation/test_experiment_law.py``."""
    predicted = law(brief, "T1", "central")["T1", "central"].groups
    for name, measured in statistics.items():
        for figure in ("mean_error", "three_sigma"):
            difference = np.abs(getattr(predicted[name], figure) - getattr(measured, figure))
            error = getattr(measured, f"{figure}_standard_error")
            assert (difference <= 4.5 * error + 1e-14).all(), (name, figure, difference / error)


def test_the_script_runs_from_any_folder_and_prints_no_negative_zero(reference, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    nearly = jnp.tile(jnp.array([0.3813, 0, 0, 0.0185, 0, 0.3791]) - 1e-9, (2, 4, 1))  # two trials, four groups
    monkeypatch.setattr(reference, "campaign", lambda *_, trials: nearly)
    reference.main()
    assert "-0.00" not in capsys.readouterr().out
