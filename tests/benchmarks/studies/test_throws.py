"""Intervals of thrown bodies: least squares on a flight without noise gives the tensor; the table counts."""

import numpy as np
import pytest

from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run

pytest.importorskip("mujoco")

from benchmarks.studies.throws import holds, lowpassed, plain, plain_lowpassed, summary

TENSOR = np.array([1.7e-3, 2e-5, -1e-5, 0.4e-3, 3e-5, 1.6e-3])


def rotating(rate=2000.0, seconds=1.0):
    """A body that an external moment turns by sines of 2, 3 and 5 Hz: its moment is Euler's equation, in closed form."""
    t = np.arange(round(rate * seconds)) / rate
    turns, phases = 2 * np.pi * np.array([2.0, 3.0, 5.0]), np.array([0.0, 1.0, 2.0])
    omega = 3 * np.sin(np.multiply.outer(t, turns) + phases)
    alpha = 3 * turns * np.cos(np.multiply.outer(t, turns) + phases)
    matrix = np.array([TENSOR[[0, 1, 2]], TENSOR[[1, 3, 4]], TENSOR[[2, 4, 5]]])
    moment = alpha @ matrix + np.cross(omega, omega @ matrix)
    return Run.from_arrays(t, np.zeros((len(t), 3)), moment, omega)


@pytest.mark.parametrize(
    "way", [plain, lambda runs: plain_lowpassed(runs, EstimatorSpec("low", "central", lowpass=30.0))]
)
def test_least_squares_is_right_where_nothing_errs(way):
    """Central differences err by (2π · 5 Hz / 2 kHz)² / 6 = 4e-5, at the ends of the run by more."""
    interval = way([rotating(), rotating()])
    np.testing.assert_allclose(interval.mean(axis=1), TENSOR, rtol=0, atol=1e-3 * TENSOR[0])
    assert (np.diff(interval) > 0).all()


def test_lowpass_leaves_slow_signals_and_takes_the_ends_off():
    run = rotating()
    low = lowpassed(run, EstimatorSpec("low", "central", lowpass=200.0))
    assert len(low.t) < len(run.t)
    first = np.argmin(np.abs(run.t - low.t[0]))
    np.testing.assert_allclose(low.omega, run.omega[first : first + len(low.t)], atol=1e-2)


def test_summary_counts_what_holds_the_truth_and_its_width():
    """Of two recordings the first misses I11 by half a width, 10 %: 40 times that and the width are its score."""
    half = 0.1 * np.abs(TENSOR)
    ends = np.stack([TENSOR - half, TENSOR + half], axis=1)
    missed = ends.copy()
    missed[0] += 2 * half[0]
    assert holds(missed, TENSOR).tolist() == [False, *[True] * 5]
    held, _, count, median, widest, score, ratio = summary(np.array([missed, ends]), TENSOR).split()
    assert (held, count, median, widest) == ("11", "12", "10", "10")
    assert float(score) == pytest.approx(20 + 40 * 10 / 6, rel=0.05)
    assert float(ratio) == pytest.approx(2 * 1.96 / np.sqrt(6), rel=0.05)
