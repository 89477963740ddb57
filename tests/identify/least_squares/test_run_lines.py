"""The samples of which a run's lines are made."""

import numpy as np
import pytest
import scipy

from identify.least_squares import run_lines
from identify.least_squares.run_lines import rows_of
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run

SPEC = EstimatorSpec("central", "central")


@pytest.mark.parametrize("gap", [False, True])
def test_long_segments_are_as_long_as_a_fast_transform(gap, monkeypatch):
    n = 2003  # less two that have no derivative: 2001, which is 3 × 23 × 29
    signals = np.random.default_rng(1).normal(size=(3, n, 3))
    run = Run.from_arrays(np.arange(n) / 100, *signals)
    if gap:
        run = run.within([(0.0, 6.0), (6.5, 20.02)])
    every = rows_of(run, SPEC)
    sizes = [segment.stop - segment.start for segment in every.segments]
    monkeypatch.setattr(run_lines, "LONG", 1000)
    fast = rows_of(run, SPEC)
    expected = [scipy.fft.prev_fast_len(size) if size > 1000 else size for size in sizes]
    assert [segment.stop - segment.start for segment in fast.segments] == expected
    assert expected != sizes
    *_, last = fast.segments
    start = every.segments[-1].start
    assert np.array_equal(fast.signals[:, last], every.signals[:, start : start + last.stop - last.start])
    assert np.array_equal(fast.omega[last], every.omega[start : start + last.stop - last.start])
