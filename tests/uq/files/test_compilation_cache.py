"""Changing a number never compiles again; where compiled code is kept."""

import dataclasses

import jax
import numpy as np
import pytest

from tests.helpers.small_campaign import TRIALS, document
from uq.analysis.propagation.experiment_law import law, prepare_law
from uq.experiment.experiment import Experiment
from uq.files.compilation_cache import cache_folder, keep_compiled
from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo

EVENT = "/jax/core/compile/backend_compile_duration"


@pytest.fixture
def compilations():
    """A function that says how many compilations there have been."""
    counted = []

    def count(event, duration, **_):
        if event == EVENT:
            counted.append(duration)

    jax.monitoring.register_event_duration_secs_listener(count)
    jax.jit(lambda: 1.0)()
    assert counted  # a new function is compiled, whatever earlier tests have left
    counted.clear()
    yield lambda: len(counted)
    jax.monitoring.unregister_event_duration_listener(count)


@pytest.fixture(scope="module")
def brief():
    """The preset's T1 of one second."""
    content = document()
    content["trajectory"] = {"T1": content["trajectory"]["T1"] | {"duration": "1 s", "ramp": "0.15 s"}}
    return Experiment.from_dict(content)


def louder(experiment, factor):
    """The same experiment with errors times a factor."""
    sources = tuple(dataclasses.replace(s, sigma=factor * np.asarray(s.sigma)) for s in experiment.sources)
    return dataclasses.replace(experiment, sources=sources)


def others(experiment):
    """The same experiment with another body, centre of gravity, amplitude; one number each."""
    spec = experiment.trajectories["T1"]
    faster = dataclasses.replace(spec.trajectory, angular_velocity=1.1 * spec.trajectory.angular_velocity)
    yield dataclasses.replace(experiment, inertia=1.1 * experiment.inertia)
    yield dataclasses.replace(experiment, mass=1.1 * experiment.mass)
    yield dataclasses.replace(experiment, r_cg_from_q=1.1 * experiment.r_cg_from_q)
    yield dataclasses.replace(experiment, gravity=1.001 * experiment.gravity)
    yield dataclasses.replace(experiment, trajectories={"T1": dataclasses.replace(spec, trajectory=faster)})


LEVELS = np.geomspace(0.1, 2.0, 100)


def only(experiment, name, factor):
    """The same experiment with one source's errors times a factor."""
    sources = tuple(s.resized(factor) if s.name == name else s for s in experiment.sources)
    return dataclasses.replace(experiment, sources=sources)


def test_a_law_of_other_numbers_compiles_nothing(brief, compilations):
    prepared = prepare_law(brief, "T1", "central")
    first = prepared.evaluate().breakdowns["T1"]["central"].total
    before = compilations()
    swept = [prepared.evaluate(louder(brief, factor).sources) for factor in LEVELS[::10]]
    for other in others(brief):
        law(other, "T1", "central")
    for source in brief.sources:  # each alone, and switched off
        law(only(brief, source.name, 2.0), "T1", "central")
        law(only(brief, source.name, 0.0), "T1", "central")
    assert compilations() == before
    spread = [result.breakdowns["T1"]["central"].total.three_sigma[0] for result in swept]
    assert (np.diff(spread) > 0).all()
    assert spread[0] < first.three_sigma[0] < spread[-1]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["sums", pytest.param("samples", marks=pytest.mark.study)])
def test_a_campaign_of_other_numbers_compiles_nothing(brief, compilations, engine):
    options = {"trials": TRIALS, "plan": SamplingPlan(engine=engine)}
    montecarlo(brief, **options)
    before = compilations()
    for other in (louder(brief, 0.5), louder(brief, 2.0), *others(brief)):
        montecarlo(other, **options)
    assert compilations() == before


@pytest.mark.study
def test_a_hundred_noise_levels_of_a_thousand_trials(compilations):
    """On a run so long that sums tell every case at every level: the engine that is chosen is always the same."""
    content = document()
    experiment = Experiment.from_dict(content | {"trajectory": {"T1": content["trajectory"]["T1"]}})
    options = {"trials": 1000, "estimators": "central"}
    montecarlo(experiment, **options)
    before = compilations()
    for factor in LEVELS:
        montecarlo(louder(experiment, factor), **options)
    print(f"{before} compilations at the first call, {compilations() - before} at 100 more")
    assert compilations() == before


def test_the_cache_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("INERTIA_CACHE", "off")
    assert cache_folder() is None
    monkeypatch.delenv("INERTIA_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder().parent == tmp_path / "inertia-uq"
    monkeypatch.setenv("INERTIA_CACHE", str(tmp_path / "mine"))
    assert cache_folder().parent == tmp_path / "mine"


def test_a_folder_that_cannot_be_written_is_done_without(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("INERTIA_CACHE", str(tmp_path / "file"))
    before = jax.config.jax_compilation_cache_dir
    keep_compiled()
    assert jax.config.jax_compilation_cache_dir == before
