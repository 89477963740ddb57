"""Trajectories of one rotation are run at once, to the same bits as one by one."""

import numpy as np
import pytest

from tests.conftest import lasting
from uq.campaign import trajectory_runs
from uq.campaign.campaign import montecarlo
from uq.trials.checkpoint import Checkpoint

OPTIONS = {"trials": 24, "batch": 4}


@pytest.fixture(scope="module")
def brief(preset):
    return lasting(preset, 4.0)


@pytest.fixture(scope="module")
def alone(brief):
    return {name: montecarlo(brief, trajectories=name, **OPTIONS).errors[name] for name in ("T1", "T2")}


@pytest.fixture
def loops(monkeypatch):
    """The trajectories' names and the trials that were done before, of every loop."""
    started = []
    original = trajectory_runs._loop

    def spy(names, setups, seed, done, *more):
        started.append((names, sum(len(part.ok) for part in done[0])))
        return original(names, setups, seed, done, *more)

    monkeypatch.setattr(trajectory_runs, "_loop", spy)
    return started


def same(result, alone):
    return all(np.array_equal(result.errors[name], alone[name]) for name in alone)


def test_together_as_alone(brief, alone, loops):
    """T2 is T1 about another point, T3 another rotation; results stand in the order asked for."""
    result = montecarlo(brief, trajectories=("T2", "T3", "T1"), **OPTIONS)
    assert loops == [(["T2", "T1"], 0), (["T3"], 0)]
    assert list(result.errors) == list(result.breakdowns) == ["T2", "T3", "T1"]
    assert same(result, alone)
    assert np.abs(alone["T1"] - alone["T2"]).max() > 1e-3 * np.abs(alone["T1"]).max()


@pytest.mark.parametrize("before", [("T1",), ("T1", "T2")])
def test_a_campaign_resumed_from_a_checkpoint_of_some_or_all_trajectories(brief, alone, loops, before, tmp_path):
    """Those that are equally far go on together, others alone."""
    montecarlo(brief, trajectories=before, checkpoint=Checkpoint(tmp_path / "c", every=0.0), **OPTIONS)
    loops.clear()
    result = montecarlo(brief, trajectories=("T1", "T2"), checkpoint=tmp_path / "c", **OPTIONS)
    assert loops == ([(["T1"], 24), (["T2"], 0)] if before == ("T1",) else [(["T1", "T2"], 24)])
    assert same(result, alone)
