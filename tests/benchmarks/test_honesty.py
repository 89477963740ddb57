"""Honesty counts what it says: wrong answers, those without a warning, refusals, how wide intervals are; plain least squares are right without noise."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.honesty import CLEAN, Judged, Stated, judged, plain, row
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, write
from uq.experiment.experiment import Experiment


def test_row_counts_wrong_and_silent_answers():
    """One clean run of two is warned; of four troubles one is silent, one warned of, one right, one refused."""
    clean = [Judged(CLEAN, 0, "p", 6, 0.5, 0.6, 2.0, False, 1.0), Judged(CLEAN, 1, "p", 3, 1.5, 0.8, 4.0, True, 1.0)]
    troubled = [
        Judged("a", 0, "p", 0, 9.0, 9.0, 30.0, False, 1.0), Judged("b", 0, "p", 3, 20.0, 12.0, 20.0, True, 1.0),
        Judged("c", 0, "p", 6, 1.0, 0.0, 10.0, False, 3.0), Judged("d", 0, "p", 0, np.nan, np.nan, np.nan, True, 3.0),
    ]  # fmt: skip
    assert row("p", clean + troubled) == "| p | 75 | 0.71 | 3 | 1 of 2 | 50 | 8.7 | 20 | 2 of 4 | 1 of 4 | 9 | 1.0 |"


def test_plain_least_squares_are_right_where_nothing_errs(tmp_path):
    """Central differences at 400 Hz of a motion below 3 Hz err by (2π · 3 Hz / 400 Hz)² / 6 = 4e-4."""
    measured = measure(noise=0.0, drawn=0.0, seconds=4.0)
    stated = plain(write(tmp_path / "run.mcap", measured), Experiment.from_dict(document(measured)))
    np.testing.assert_allclose(stated.intervals.mean(axis=1), measured.truth, atol=1e-3 * np.abs(measured.truth).max())


def test_every_program_is_asked_about_the_same_file(tmp_path, monkeypatch):
    """A program that states the truth is never off; a half-width away, its intervals just hold it."""
    truth = measure().truth
    said = np.stack([truth - 1.0, truth + 0.5], axis=1)
    seen = []
    monkeypatch.setattr(
        "benchmarks.honesty.PEERS", {"p": lambda path, experiment: (seen.append(path), Stated(said, False))[1]}
    )
    (answer,) = judged("cable", 500, tmp_path)
    assert seen == [tmp_path / "run.mcap"]
    assert (answer.covered, answer.silent) == (6, False)
    assert answer.half_widths == pytest.approx(0.25 / 0.75)
