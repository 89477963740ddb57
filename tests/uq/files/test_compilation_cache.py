"""Changing a number never compiles again; where compiled code is kept."""

import dataclasses
import os

import jax
import numpy as np
import pytest

from identify.compiled_program import CompiledProgram
from tests.small_campaign import document
from uq.campaign.campaign import montecarlo
from uq.campaign.trial_setup import _sampled
from uq.experiment.experiment import Experiment
from uq.files import compilation_cache
from uq.files.compilation_cache import MONTH, ProgramFolder, cache_folder, keep_compiled
from uq.propagation.experiment_law import law, prepare_law
from uq.trials.trial_loop import _sharded

EVENT = "/jax/core/compile/backend_compile_duration"


@pytest.fixture
def compilations():
    """A function that says how many compilations there have been."""
    counted = []

    def count(event, duration, **_):
        if event == EVENT:
            counted.append(duration)

    jax.monitoring.register_event_duration_secs_listener(count)
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
    sources = tuple(s.error_kind.resized(s, factor) if s.name == name else s for s in experiment.sources)
    return dataclasses.replace(experiment, sources=sources)


def test_a_law_of_other_numbers_compiles_nothing(brief, compilations):
    prepared = prepare_law(brief, "T1", "central")
    first = prepared.evaluate().breakdowns["T1"]["central"].total
    before = compilations()
    assert before > 0
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


@pytest.mark.parametrize("sampling", ["conditioned", pytest.param("collapsed", marks=pytest.mark.study)])
def test_a_campaign_of_other_numbers_compiles_nothing(brief, compilations, sampling):
    options = {"trials": 200, "estimators": "central", "sampling": sampling}
    montecarlo(brief, **options)
    before = compilations()
    assert before > 0
    for other in (louder(brief, 0.5), louder(brief, 2.0), *others(brief)):
        montecarlo(other, **options)
    assert compilations() == before


@pytest.mark.study
@pytest.mark.parametrize("sampling", ["conditioned", "collapsed"])
def test_a_hundred_noise_levels_of_a_thousand_trials(brief, compilations, sampling):
    options = {"trials": 1000, "estimators": "central", "sampling": sampling}
    montecarlo(brief, **options)
    before = compilations()
    for factor in LEVELS:
        montecarlo(louder(brief, factor), **options)
    print(f"{sampling}: {before} compilations at the first call, {compilations() - before} at 100 more")
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


def test_a_kept_program_is_read_whole_or_not_at_all(tmp_path):
    folder = ProgramFolder(tmp_path)
    folder.save("a", b"compiled")
    assert (folder.load("a"), folder.load("b")) == (b"compiled", None)
    (path,) = folder.folder.iterdir()
    content = path.read_bytes()
    for harm in (content[:-1], content[:10], b"", content.replace(b"m", b"n")):
        path.write_bytes(harm)
        assert folder.load("a") is None
    folder.save("a", b"again")
    assert folder.load("a") == b"again"
    assert [path.name for path in folder.folder.iterdir()] == ["a"]


def test_programs_of_other_code_stand_apart_and_go_when_unused(monkeypatch, tmp_path):
    folders = []
    for digest in ("old", "recent", "new"):
        monkeypatch.setattr(compilation_cache, "code_digest", lambda digest=digest: digest)
        folders.append(ProgramFolder(tmp_path))
    old, recent, new = folders
    old.save("a", b"old")
    recent.save("a", b"recent")
    unused = old.folder.stat().st_mtime - 1.1 * MONTH
    os.utime(old.folder, (unused, unused))
    new.save("a", b"new")
    assert [folder.load("a") for folder in folders] == [None, b"recent", b"new"]
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=true")
    assert ProgramFolder(tmp_path).load("a") is None


def test_programs_are_not_kept_where_nothing_can_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    folder = ProgramFolder(tmp_path / "file")
    folder.save("a", b"compiled")
    assert folder.load("a") is None


def test_a_campaign_of_kept_programs_gives_the_same_bits(brief, monkeypatch, tmp_path):
    """On two devices; the second time its programs are loaded, for which none is compiled."""
    options = {"trials": 60, "trajectories": "T1", "estimators": "central", "devices": jax.devices()}
    plain = montecarlo(brief, **options)
    jax.clear_caches()  # what JAX's own cache folder gave lacks functions when it is serialized
    monkeypatch.setattr(CompiledProgram, "store", ProgramFolder(tmp_path))
    for program in (_sampled, _sharded):
        monkeypatch.setattr(program, "loaded", {})
    kept = montecarlo(brief, **options)
    for program in (_sampled, _sharded):
        program.loaded.clear()
        monkeypatch.setattr(program, "_compiled", None)
    again = montecarlo(brief, **options)
    for result in (kept, again):
        np.testing.assert_array_equal(result.errors["T1"], plain.errors["T1"])
