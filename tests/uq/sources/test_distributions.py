"""Distributions: moments against SciPy or closed forms, draws by Kolmogorov-Smirnov, the same from the same key."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from uq.sources.distributions import (
    CurvilinearTrapezoid,
    Empirical,
    MultivariateNormal,
    Normal,
    Rectangular,
    StudentT,
    Triangular,
    UShaped,
)


def trapezoid_cdf(low, high, d):
    """Averaged over the limits: JCGM 101's own definition, by quadrature over the lower limit."""
    grid = np.linspace(low - d, high + d, 2001)
    lower = low - d + 2 * d * (np.arange(2000) + 0.5) / 2000
    upper = low + high - lower
    values = np.clip((grid[:, None] - lower) / (upper - lower), 0, 1).mean(axis=1)
    return lambda x: np.interp(x, grid, values)


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


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", CASES)
def test_moments_and_draws_are_scipys(name, dtype):
    """Ten Kolmogorov-Smirnov tests at a level of 1e-3, with fixed keys."""
    ours, reference = CASES[name]
    np.testing.assert_allclose([ours.mean, ours.standard_deviation], [reference.mean(), reference.std()], rtol=1e-12)
    drawn = draws(ours, 1, (20_000,), dtype)
    assert drawn.dtype == dtype
    assert stats.kstest(np.asarray(drawn, float), reference.cdf).pvalue > 1e-3


def test_curvilinear_trapezoid_has_its_moments_and_its_draws():
    ours = CurvilinearTrapezoid(-1.0, 3.0, 0.8)
    cdf = trapezoid_cdf(-1, 3, 0.8)
    x = np.linspace(1, 3.8, 20_001)
    variance = 2 * np.trapezoid(2 * (x - 1) * (1 - cdf(x)), x)
    np.testing.assert_allclose(ours.standard_deviation, np.sqrt(variance), rtol=1e-5)
    assert ours.mean == 1
    assert stats.kstest(np.asarray(draws(ours, 2, (20_000,))), cdf).pvalue > 1e-3


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


def test_multivariate_normal_has_its_covariance():
    covariance = np.array([[4.0, 1.8, 0.0], [1.8, 1.0, 0.2], [0.0, 0.2, 0.25]])
    ours = MultivariateNormal(np.array([1.0, -1.0, 0.0]), covariance)
    n = 40_000
    drawn = np.asarray(draws(ours, 4, (n, 3)))
    np.testing.assert_allclose(ours.standard_deviation, [2, 1, 0.5])
    error = np.sqrt((np.outer(np.diag(covariance), np.diag(covariance)) + covariance**2) / n)
    assert (np.abs(np.cov(drawn.T) - covariance) < 5 * error).all()  # 6 entries: 4e-6 false alarms
    assert (np.abs(drawn.mean(0) - ours.mean) < 5 * ours.standard_deviation / np.sqrt(n)).all()
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), (drawn - ours.mean).T)
    assert stats.kstest((whitened**2).sum(0), stats.chi2(3).cdf).pvalue > 1e-3


def test_values_that_go_together_wholly_can_be_drawn():
    singular = MultivariateNormal(np.zeros(2), np.array([[1.0, 2.0], [2.0, 4.0]]))
    drawn = draws(singular, 0, (50, 2))
    np.testing.assert_allclose(drawn[:, 1], 2 * drawn[:, 0], atol=1e-12)


@pytest.mark.parametrize("name", CASES)
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
        (lambda: CurvilinearTrapezoid(0.0, 1.0, 0.6), "`limit_half_width` must be between zero and half"),
        (lambda: Empirical(np.array([1.0])), "`samples` must be two or more values"),
        (lambda: Empirical(np.array([1.0, np.nan])), "`samples` must be finite"),
        (lambda: MultivariateNormal(np.zeros(2), np.array([[1.0, 2.0], [2.0, 1.0]])), "`covariance` must be symmetric"),
    ],
)
def test_parameters_that_cannot_be_are_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()


@pytest.mark.parametrize("name", [*CASES, "curvilinear_trapezoid", "normal_limit_of_t"])
def test_values_at_points_of_the_cube_have_the_distribution(name):
    """Kolmogorov-Smirnov at a level of 1e-3, with a fixed seed; Student's t of infinite freedom is normal."""
    more = {
        "curvilinear_trapezoid": (CurvilinearTrapezoid(-1.0, 3.0, 0.8), None),
        "normal_limit_of_t": (StudentT(1.0, 2.0, np.inf), stats.norm(1, 2)),
    }
    ours, reference = (CASES | more)[name]
    points = np.random.default_rng(3).random(ours.coordinates((20_000,)))
    values = np.asarray(jax.jit(lambda points: ours.at(points, (20_000,)))(jnp.asarray(points)))
    cdf = trapezoid_cdf(-1, 3, 0.8) if reference is None else reference.cdf
    assert stats.kstest(values, cdf).pvalue > 1e-3


def test_samples_at_points_of_the_cube_are_equally_likely():
    rows = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]])
    ours = Empirical(rows)
    assert ours.coordinates((3, 2)) == 3
    np.testing.assert_array_equal(ours.at(jnp.asarray([0.01, 0.4, 0.99]), (3, 2)), rows)


def test_joint_normals_at_points_of_the_cube_have_their_covariance():
    covariance = np.array([[2.0, 0.6, 0.0], [0.6, 1.0, -0.3], [0.0, -0.3, 0.5]])
    ours = MultivariateNormal(np.array([1.0, 2.0, 3.0]), covariance)
    points = jnp.asarray(stats.qmc.Sobol(3, rng=1).random(2**14))
    values = np.asarray(jax.jit(jax.vmap(lambda point: ours.at(point, (3,))))(points))
    np.testing.assert_allclose(np.cov(values, rowvar=False), covariance, atol=0.01)
