"""The bound of a mean square by sums of squares: its identity at random points, signals that come near, limits."""

import numpy as np
import pytest
from scipy.optimize import linprog

from benchmarks.studies.sums_of_squares import WEIGHTS, _Programme, mean_square_bound
from identify.motion.largest_mean_square import largest_mean_square

RATIO = 3.3


@pytest.fixture(scope="module")
def solved():
    """A programme and its solution."""
    programme = _Programme(RATIO)
    return programme, programme.solved()


@pytest.fixture(scope="module")
def bound(solved):
    """What that solution proves: ``mean_square_bound(RATIO)``."""
    programme, unknowns = solved
    return programme.certified(unknowns)


@pytest.mark.slow
def test_the_identity_holds_at_random_points(generator, solved):
    """``ρ - z₁² - LV`` is not negative wherever Bernstein's inequalities hold, LV taken anew from V's gradient."""
    programme, unknowns = solved
    proved = programme.certified(unknowns)
    powers, weights = np.array(programme.functions), unknowns[1 : programme.free]
    angle, length = generator.uniform(0, 2 * np.pi, (500, len(WEIGHTS))), generator.uniform(0, 1, (500, len(WEIGHTS)))
    z = length * np.cos(angle)
    for k in range(2, len(WEIGHTS)):  # neighbours within the unit circle, often on it
        z[:, k] = np.sqrt(1 - z[:, k - 1] ** 2) * np.clip(2 * np.cos(angle[:, k]), -1, 1)
    moving = np.column_stack([z[:, 1] / RATIO, z[:, 2:]])
    slope = np.zeros_like(moving)
    for k in range(moving.shape[1]):
        lower = powers - np.eye(len(WEIGHTS), dtype=int)[k]
        terms = np.prod(z[:, None, :] ** np.maximum(lower, 0)[None], axis=2) * powers[:, k]
        slope[:, k] = terms @ weights
    left = proved - z[:, 1] ** 2 - (slope * moving).sum(axis=1)
    assert left.min() > -1e-6
    assert left.min() < 0.2  # the points come near


@pytest.mark.slow
def test_what_the_solver_leaves_is_added(solved):
    """A solution that has been spoiled proves less, by what the identity lacks."""
    programme, unknowns = solved
    spoiled = unknowns.copy()
    spoiled[1] += 0.01
    lacks = np.abs(programme.equations @ spoiled - programme.wanted).sum()
    assert programme.certified(spoiled) == pytest.approx(unknowns[0] + lacks, abs=1e-5)
    assert lacks > 0.01


@pytest.mark.slow
def test_the_best_periodic_signals_stay_below(generator, bound):
    """Found by linear programmes, each towards the last solution: 0.6 and more, close to the bound and never above."""
    harmonics, period = np.arange(1, 9), 1.6
    speed = 2 * np.pi * harmonics / period
    t = np.linspace(0, period, 320, endpoint=False)
    angle = speed * t[:, None]
    value, integral = (
        np.hstack([np.cos(angle), np.sin(angle)]),
        np.hstack([np.sin(angle) / speed, -np.cos(angle) / speed]),
    )
    rows = np.vstack([value, -value, integral / (RATIO / (10 * np.pi)), -integral / (RATIO / (10 * np.pi))])
    near = np.tile(np.exp(-2 * (harmonics / period - 1.9) ** 2), 2)  # close to the slowest that the integral allows
    best = 0.0
    for _ in range(12):
        found, before = near * generator.normal(size=16), 0.0
        while True:
            found = linprog(-found, A_ub=rows, b_ub=np.ones(len(rows)), bounds=(None, None)).x
            square = (found @ found) / 2
            if square < before + 1e-6:
                break
            before = square
        best = max(best, before)
    assert 0.6 < best < bound < 0.73


@pytest.mark.study
def test_limits(bound):
    """With the tightest integral a sine; it grows with the integral, and improves on single excursions."""
    least = mean_square_bound(1.0)
    assert 0.5 <= least < 0.52
    assert least <= bound <= mean_square_bound(8.0)
    assert bound < largest_mean_square(1.0, RATIO / (10 * np.pi), 5.0) - 0.07


@pytest.mark.study
@pytest.mark.parametrize("ratio", [1 - 1e-12, 1e6])
def test_extreme_integrals_give_a_bound(ratio):
    """Nothing fails there; a free integral allows a square wave, whose mean square is one."""
    assert 0.5 <= mean_square_bound(ratio) <= 1.0
    assert mean_square_bound(ratio) > 0.99 or ratio < 2
