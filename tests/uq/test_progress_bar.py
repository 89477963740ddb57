"""A progress bar: what it shows of the steps, on demand; one at a time, and gone at its end."""

import pytest
import tqdm.auto

from tests.helpers.small_campaign import TRIALS, document
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import RunOptions, montecarlo
from uq.progress_bar import ProgressBar, progress_of


@pytest.fixture
def bars(monkeypatch):
    """Every bar that is made, with what it was told."""
    made = []

    class Bar:
        def __init__(self, *, desc, total, unit, leave, file):
            self.desc, self.total, self.unit, self.n, self.closed = desc, total, unit, 0, False
            assert not leave
            made.append(self)

        def update(self, steps):
            self.n += steps

        def close(self):
            self.closed = True

    monkeypatch.setattr(tqdm.auto, "tqdm", Bar)
    return made


def test_each_name_has_a_bar_and_the_one_before_is_closed(bars):
    with ProgressBar(unit="steps") as bar:
        bar("T1", 10, 100)
        bar("T1", 40, 100)
        bar("T2", 5, 20)
        assert [(each.desc, each.total, each.n, each.closed) for each in bars] == [
            ("T1", 100, 40, True),
            ("T2", 20, 5, False),
        ]
    assert bars[1].closed
    assert {each.unit for each in bars} == {" steps"}


def test_a_bar_is_shown_where_it_is_asked_for(bars):
    called = []
    progress_of(lambda *step: called.append(step))("T1", 1, 2)
    assert called == [("T1", 1, 2)]
    progress_of(None)("T1", 1, 2)
    progress_of(False)("T1", 1, 2)
    progress_of(True)("T1", 1, 2)
    assert [each.desc for each in bars] == ["T1"]
    ProgressBar(silent=True)("T1", 1, 2)
    assert len(bars) == 1


def test_a_campaign_shows_one(bars):
    montecarlo(Experiment.from_dict(document()), trials=TRIALS, trajectories="T1", options=RunOptions(progress=True))
    assert [(each.desc, each.n, each.total) for each in bars] == [("T1", TRIALS, TRIALS)]
