"""Distributions: moments against SciPy or closed forms, draws by Kolmogorov-Smirnov, the same from the same key."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from uq.sources.distributions import (
    Empirical,
    Normal,
    Rectangular,
    StudentT,
    Triangular,
    UShaped,
)


def draws(ours, key, shape, dtype="float64"):
    """Draws of a distribution, compiled as a whole."""
    return jax.jit(lambda key: ours.draw(key, shape, dtype))(jax.random.key(key))


CASES = {
    "normal": (Normal(1.0, 2.0), stats.norm(1, 2)),
    "rectangular": (Rectangular(-1.0, 3.0), stats.uniform(-1, 4)),
    "triangular": (Triangular(-1.0, 3.0), stats.triang(0.5, -1, 4)),
    "u_shaped": (UShaped(-1.0, 3.0), stats.arcsine(-1, 4)),
    "student_t": (StudentT(1.0, 2.0, 5.0), stats.t(5, 1, 2)),
}
LEAST = {"rectangular", "student_t"}
"""By one number, and by more: draws of the others are their values at points, too, of which each is tried below."""


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        *((name, "float64") for name in CASES),
        *(pytest.param(name, "float32", marks=() if name in LEAST else pytest.mark.slow) for name in CASES),
    ],
)
def test_moments_and_draws_are_scipys(name, dtype):
    """Ten Kolmogorov-Smirnov tests at a level of 1e-3, with fixed keys."""
    ours, reference = CASES[name]
    np.testing.assert_allclose([ours.mean, ours.standard_deviation], [reference.mean(), reference.std()], rtol=1e-12)
    drawn = draws(ours, 1, (20_000,), dtype)
    assert drawn.dtype == dtype
    assert stats.kstest(np.asarray(drawn, float), reference.cdf).pvalue > 1e-3


def test_draws_from_samples_are_these_samples_each_as_often():
    samples = np.array([0.1, 0.2, 0.2, 5.0])
    ours = Empirical(samples)
    drawn = np.asarray(draws(ours, 3, (40_000,)))
    assert set(drawn) == {0.1, 0.2, 5.0}
    assert abs(np.mean(drawn == 0.2) - 0.5) < 5 * 0.5 / 200  # 6e-7 false alarms
    np.testing.assert_allclose([ours.mean, ours.standard_deviation], [samples.mean(), samples.std()])
    assert ours.degrees_of_freedom == 3


def test_rows_of_samples_stay_together():
    samples = np.array([[1.0, 10.0, 100.0], [2.0, 20.0, 200.0], [3.0, 30.0, 300.0]])
    drawn = np.asarray(draws(Empirical(samples), 3, (500, 3)))
    np.testing.assert_array_equal(drawn[:, 1:], drawn[:, :1] * [10, 100])
    with pytest.raises(ValueError, match=r"Argument `shape` must end with \(3,\), but is \(5,\)"):
        Empirical(samples).draw(jax.random.key(3), (5,))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in LEAST else pytest.mark.slow) for name in CASES]
)
def test_draws_are_the_keys_own_in_any_batch(name):
    ours = CASES[name][0]
    draw = lambda key: ours.draw(key, (4,))  # noqa: E731
    keys = jax.random.split(jax.random.key(5), 3)
    many = jax.jit(jax.vmap(draw))(keys)
    np.testing.assert_allclose(many[1], jax.jit(draw)(keys[1]), rtol=1e-14)
    assert not np.any(many[0] == many[1])


def test_parameters_may_differ_by_axis_and_be_traced():
    widths = np.array([1.0, 2.0, 4.0])

    @eqx.filter_jit
    def drawn(widths):
        return Rectangular(-widths, widths).draw(jax.random.key(6), (30_000, 3))

    # kurtosis 1.8: relative standard error of a standard deviation is √(0.8/4n)
    np.testing.assert_allclose(drawn(widths).std(0), widths / np.sqrt(3), rtol=5 * np.sqrt(0.2 / 30_000))
    four = jax.jit(jax.value_and_grad(lambda w: jnp.sum(Rectangular(-w, w).draw(jax.random.key(6), (4, 3)))))
    total, slope = four(jnp.asarray(widths))
    np.testing.assert_allclose(slope @ widths, total, rtol=1e-12)  # draws are proportional to the widths


def test_student_t_says_when_it_has_no_standard_deviation():
    assert np.isinf(StudentT(0.0, 1.0, 2.0).standard_deviation)
    assert StudentT(0.0, 1.5, np.inf).standard_deviation == 1.5
    assert Normal(0.0, 1.0).degrees_of_freedom == np.inf
    assert StudentT(0.0, 1.0, 7).degrees_of_freedom == 7


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Normal(0.0, -1.0), "`standard_deviation` must be zero or more, but is -1.0"),
        (lambda: Rectangular(1.0, 0.0), "`high` must be low or more, but is 0.0"),
        (lambda: StudentT(0.0, 1.0, 0), "`degrees_of_freedom` must be above zero, but is 0"),
        (lambda: Empirical(np.array([1.0])), "`samples` must be two or more values"),
        (lambda: Empirical(np.array([1.0, np.nan])), "`samples` must be finite"),
    ],
)
def test_parameters_that_cannot_be_are_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()


@pytest.mark.parametrize("name", [*CASES, "normal_limit_of_t"])
def test_values_at_points_of_the_cube_have_the_distribution(name):
    """Kolmogorov-Smirnov at a level of 1e-3, with a fixed seed; Student's t of infinite freedom is normal."""
    more = {"normal_limit_of_t": (StudentT(1.0, 2.0, np.inf), stats.norm(1, 2))}
    ours, reference = (CASES | more)[name]
    points = np.random.default_rng(3).random(ours.coordinates((20_000,)))
    values = np.asarray(jax.jit(lambda points: ours.at(points, (20_000,)))(jnp.asarray(points)))
    assert stats.kstest(values, reference.cdf).pvalue > 1e-3


def test_samples_at_points_of_the_cube_are_equally_likely():
    rows = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]])
    ours = Empirical(rows)
    assert ours.coordinates((3, 2)) == 3
    np.testing.assert_array_equal(ours.at(jnp.asarray([0.01, 0.4, 0.99]), (3, 2)), rows)
