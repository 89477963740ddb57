"""Type A of pooled runs: closed forms of balanced repeats, coverage by simulation, and what a user can do wrong."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import t as student

from tests.helpers.equal_runs import OWN, pooled

THREE_BY_THREE = ["A", "A", "A", "B", "B", "B", "C", "C", "C"]


def test_equal_runs_scatter_as_their_mean_does(generator):
    tensors = generator.normal(0, 3, (5, 6))
    _, pooling = pooled(tensors, [None] * 5)
    deviation = tensors.std(axis=0, ddof=1)
    np.testing.assert_allclose(pooling.from_scatter, deviation / np.sqrt(5))
    np.testing.assert_allclose(pooling.between_runs, deviation)
    assert (pooling.repeat_degrees_of_freedom, pooling.scatter_degrees_of_freedom, pooling.mountings) == (4, 4, 0)
    assert pooling.between_mountings is None
    np.testing.assert_allclose(pooling.half_width, student.ppf(0.975, 4) * deviation / np.sqrt(5))


def test_mountings_scatter_as_their_means_do(generator):
    tensors = generator.normal(0, 1, (9, 6)) + np.repeat(generator.normal(0, 5, (3, 6)), 3, axis=0)
    _, pooling = pooled(tensors, THREE_BY_THREE)
    groups = tensors.reshape(3, 3, 6)
    means = groups.mean(axis=1).std(axis=0, ddof=1)
    np.testing.assert_allclose(pooling.between_mountings, means)
    np.testing.assert_allclose(pooling.from_scatter, means / np.sqrt(3))
    np.testing.assert_allclose(pooling.between_runs, np.sqrt(groups.var(axis=1, ddof=1).mean(axis=0)))
    assert (pooling.repeat_degrees_of_freedom, pooling.scatter_degrees_of_freedom, pooling.mountings) == (6, 2, 3)
    content = pooling.to_dict()
    assert content["between_mountings"]["I11"] == pytest.approx(means[0])
    assert content["coverage_factor"]["I11"] == pytest.approx(student.ppf(0.975, 2))


def test_one_mounting_of_all_runs_is_none(generator):
    tensors = generator.normal(0, 3, (4, 6))
    _, named = pooled(tensors, ["A"] * 4)
    _, plain = pooled(tensors, [None] * 4)
    np.testing.assert_array_equal(named.half_width, plain.half_width)


@pytest.mark.parametrize("laboratories", [200, pytest.param(1000, marks=pytest.mark.study)])
@pytest.mark.parametrize(("of_mounting", "of_run", "most"), [(5.0, 2.0, 0.95), (0.0, 0.0, 1.0)])
def test_intervals_of_three_mountings_of_three_runs_cover(of_mounting, of_run, most, laboratories):
    """Six components each, which are independent here: of 1,000 laboratories the binomial standard error is 0.28 %.

    With scatter 95 % exactly, but for the residuals' floor: the limits are five standard errors off, a false alarm of
    1e-6. Where nothing lies between runs and mountings, the interval is the wider of two and covers more.
    """
    rng, covered, ignored = np.random.default_rng(11), [], []
    within = 5 * np.sqrt(0.95 * 0.05 / (6 * laboratories))
    for _ in range(laboratories):
        tensors = rng.normal(0, np.hypot(OWN, of_run), (9, 6)) + np.repeat(
            rng.normal(0, of_mounting, (3, 6)), 3, axis=0
        )
        mean, pooling = pooled(tensors, THREE_BY_THREE)
        covered.append(np.abs(mean) <= pooling.half_width)
        ignored.append(np.abs(mean) <= pooled(tensors, [None] * 9)[1].half_width)
    assert 0.95 - within < np.mean(covered) <= most + within
    if of_mounting:
        assert np.mean(ignored) < 0.85  # the same runs without the labels: repeats are no remountings


@pytest.mark.parametrize("names", [[None] * 4, list("AABB"), THREE_BY_THREE])
def test_scatter_by_chance_is_no_warning(names):
    """None or one of 300 clean pools, of the stated level 0.001; two are passed by chance once in 250 times."""
    rng = np.random.default_rng(len(names))
    warned = [bool(pooled(rng.normal(0, OWN, (len(names), 6)), names)[1].warnings) for _ in range(300)]
    assert np.sum(warned) <= 2


def test_scatter_beyond_chance_is_one_warning_that_what_each_mounting_draws_explains(generator):
    tensors = generator.normal(0, OWN, (9, 6)) + np.repeat(generator.normal(0, 30 * OWN, (3, 6)), 3, axis=0)
    (runs,), (mountings,) = (pooled(tensors, names)[1].warnings for names in ([None] * 9, THREE_BY_THREE))
    assert runs.startswith("the runs scatter ")
    assert "name the mountings" in runs
    assert mountings.startswith("the mountings scatter ")
    assert "list it in drawn_by_mounting" in mountings
    pooling = pooled(tensors, THREE_BY_THREE)[1]
    assert dataclasses.replace(pooling, from_redrawn_sources=30 * OWN / np.sqrt(3)).warnings == ()
