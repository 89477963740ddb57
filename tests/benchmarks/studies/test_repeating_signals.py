"""The largest mean square of signals that repeat, against what linear programmes and other signals find."""

import numpy as np
import pytest
from scipy.optimize import linprog

from benchmarks.studies.repeating_signals import ramp_mean_square, repeating_mean_square

RATIO = 3.3


def harmonics_at(period, angle):
    """What each amplitude adds to a signal and to its integral, times the band's edge, whose frequency is one."""
    number = np.arange(1, int(period + 1e-9) + 1)
    turns = angle[:, None] * number
    signal = np.hstack([np.cos(turns), np.sin(turns)])
    return signal, np.hstack([np.sin(turns), -np.cos(turns)]) * period / np.tile(number, 2)


def best_found(period, ratio, generator, tries=12):
    """Ascent by linear programmes: each takes the signal that is most like the last one (a convex function's slope).

    The best one is made smaller by what it exceeds between the instants.
    """
    rows, integral = harmonics_at(period, np.linspace(0, 2 * np.pi, 241))
    limits = np.concatenate([rows, -rows, integral / ratio, -integral / ratio])
    best = 0.0
    for _ in range(tries):
        amplitude, old = generator.normal(size=rows.shape[1]), 0.0
        for _ in range(40):
            amplitude = linprog(-amplitude, A_ub=limits, b_ub=np.ones(len(limits)), bounds=(None, None)).x
            mean = (amplitude**2).sum() / 2
            if mean - old < 1e-6:
                break
            old = mean
        finer = [x @ amplitude for x in harmonics_at(period, np.linspace(0, 2 * np.pi, 7201))]
        best = max(best, mean / max(1.0, np.abs(finer[0]).max(), np.abs(finer[1]).max() / ratio) ** 2)
    return best


@pytest.mark.parametrize(("harmonics", "expected"), [(1, 0.5), (2, 0.501), (3, 0.581)])
def test_the_bound_is_reached_and_not_exceeded(harmonics, expected, generator):
    bound = repeating_mean_square(RATIO, harmonics)
    assert bound == pytest.approx(expected, rel=2e-3)
    found = max(best_found(number, RATIO, generator) for number in range(1, harmonics + 1))
    assert 0.997 * bound < found <= bound * (1 + 1e-9)


@pytest.mark.parametrize("period", [1.3, 1.9, 2.4, 2.9, 3.3, 3.7, 3.99])
def test_no_shorter_period_allows_more(period, generator):
    """At any period, whole or not, that is below four of the band's edge."""
    assert best_found(period, RATIO, generator, tries=6) <= repeating_mean_square(RATIO, 3)


def test_no_motion_does_more_in_a_ramp(generator):
    """Random sines within their bounds, times a window that rises as a sine; those that exceed one are left out."""
    t = np.arange(1, 501) / 500
    window = np.array(
        [np.sin(np.pi / 2 * t), np.pi / 2 * np.cos(np.pi / 2 * t), -((np.pi / 2) ** 2) * np.sin(np.pi / 2 * t)]
    )
    turns = 2 * np.pi * np.array([2.0, 4.0, 6.0])
    speed, stroke, seen = 0.06, 0.004, 0.0
    bound = ramp_mean_square(window, speed, stroke)
    for _ in range(2000):
        phase, size = generator.uniform(0, 2 * np.pi, 3), generator.exponential(size=3) / turns**2
        angle = turns * t[:, None] + phase
        q = [np.sin(angle) @ size, np.cos(angle) @ (size * turns), -np.sin(angle) @ (size * turns**2)]
        scale = min(bound / np.abs(x).max() for x, bound in zip(q, (stroke, speed, 1.0), strict=True))
        found = scale * (window[0] * q[2] + 2 * window[1] * q[1] + window[2] * q[0])
        if np.abs(found).max() <= 1:
            seen = max(seen, (found**2).mean())
    assert 0.2 < seen < bound < 1


def test_a_tight_integral_allows_less():
    assert repeating_mean_square(1.0, 3) == pytest.approx(0.5, rel=0.02)
    assert repeating_mean_square(1.5, 3) < repeating_mean_square(3.0, 3)
    assert repeating_mean_square(np.inf, 3) <= 1.0
