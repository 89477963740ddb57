"""Tensors that bodies can have: the parametrisation, how far components reach, and intervals at the edge that hold."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from identify.least_squares.admissible_tensor import Data, admissible, distance_from_bodies, ends, fit, margin, nearest
from identify.rigid_body.inertia import parallel_axis, unpack
from identify.rigid_body.principal_axes import is_admissible
from identify.rigid_body.pseudo_inertia import free_of, log_cholesky, of_second_moment, pseudo_inertia, second_moment

PLATE = np.array([0.19, 0.0, 0.0, 0.19, 0.0, 0.38])
"""On the edge: I11 + I22 = I33."""
CUBE = np.array([0.38, 0.01, -0.02, 0.2, 0.005, 0.37])
"""Far inside, in standard uncertainties of a thousandth."""
SIGMA = 5e-3


def test_any_six_numbers_are_a_body_and_every_body_has_them(generator):
    for free in generator.normal(scale=1.5, size=(50, 6)):
        inertia = np.asarray(log_cholesky(jnp.asarray(free)))
        assert bool(is_admissible(jnp.asarray(inertia)))
        np.testing.assert_allclose(free_of(inertia), free, atol=1e-6)
    with pytest.raises(ValueError, match="must be a physically possible tensor"):
        free_of(np.array([1.0, 0, 0, 1.0, 0, 3.0]))


def test_second_moments_are_those_of_point_masses(generator):
    points = generator.normal(size=(7, 3))
    tensor = sum(np.dot(p, p) * np.eye(3) - np.outer(p, p) for p in points)
    inertia = tensor[np.triu_indices(3)]
    np.testing.assert_allclose(second_moment(inertia), points.T @ points, atol=1e-12)
    np.testing.assert_allclose(of_second_moment(second_moment(inertia)), inertia, atol=1e-12)


def test_ten_parameters_are_a_pseudo_inertia(generator):
    """J = [[Σ_Q, m r], [m rᵀ, m]] of the ten is U Uᵀ, written out here from its definition."""
    free = generator.normal(scale=0.6, size=10)
    alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3 = free
    upper = np.exp(alpha) * np.array(
        [[np.exp(d1), s12, s13, t1], [0, np.exp(d2), s23, t2], [0, 0, np.exp(d3), t3], [0, 0, 0, 1]]
    )
    ten = np.asarray(pseudo_inertia(jnp.asarray(free)))
    mass, r = ten[0], ten[1:4]
    about_q = np.asarray(unpack(parallel_axis(jnp.asarray(ten[4:]), jnp.asarray(mass), jnp.asarray(r))))
    expected = upper @ upper.T
    np.testing.assert_allclose(0.5 * np.trace(about_q) * np.eye(3) - about_q, expected[:3, :3], atol=1e-12)
    np.testing.assert_allclose([*(mass * r), mass], expected[:, 3], atol=1e-12)


def test_the_nearest_body_and_the_reach_are_scipys(generator):
    """A general solver on the same convex problem, from the same start: to a thousandth of the size."""
    root = generator.normal(size=(6, 6))
    data = Data(PLATE + [0, 0, 0, 0, 0, 0.02], np.linalg.inv(SIGMA**2 * (root @ root.T / 6 + np.eye(6))))
    body = [{"type": "ineq", "fun": lambda x: np.linalg.eigvalsh(second_moment(x))[0]}]
    inner = np.asarray(of_second_moment(np.diag([0.17, 0.17, 0.02])))
    best = minimize(lambda x: data.distance(x) * 1e-2, inner, constraints=body, method="SLSQP",
                    options={"ftol": 1e-10, "maxiter": 500})  # fmt: skip
    least = data.distance(nearest(data))
    assert least == pytest.approx(100 * best.fun, rel=1e-2, abs=1e-3)
    most = least + 4.0
    reach = ends(data, np.full(6, most))
    close = [*body, {"type": "ineq", "fun": lambda x: most - data.distance(x)}]
    for k, sign in ((0, 1), (3, -1), (5, 1), (5, -1)):
        optimum = minimize(lambda x, k=k, sign=sign: -sign * x[k], nearest(data), constraints=close, method="SLSQP",
                         options={"ftol": 1e-12, "maxiter": 500})  # fmt: skip
        assert reach[k, (sign + 1) // 2] == pytest.approx(optimum.x[k], abs=1e-3)


def test_far_inside_the_reach_is_the_plain_interval():
    data = Data(CUBE, np.eye(6) / 1e-3**2)
    expected = np.stack([CUBE - 1.96e-3, CUBE + 1.96e-3], axis=1)
    np.testing.assert_allclose(ends(data, np.full(6, 1.96**2)), expected, atol=1e-9)
    assert admissible(CUBE, np.eye(6) * 1e-6, np.full(6, 1.96)) is None


def test_thin_bodies_of_any_size_have_ends_about_the_nearest(generator):
    """Moments and standard uncertainties over six decades; the same to the bit when it is computed again."""
    for _ in range(40):
        shape = generator.normal(size=(3, 3)) * 10.0 ** -generator.uniform(0, [0.1, 2, 5])
        body = of_second_moment(shape @ shape.T) * 10 ** generator.uniform(-6, 3)
        size = np.abs(body).max()
        root = generator.normal(size=(6, 6)) * 10 ** generator.uniform(-2, 0, size=6)
        root *= size * 10 ** generator.uniform(-6, 0.5) / np.linalg.norm(root)
        covariance = root @ root.T + (1e-6 * size) ** 2 * np.eye(6)
        estimate = body + root @ generator.normal(size=6)
        data = Data(estimate, np.linalg.inv(covariance))
        closest = nearest(data)
        assert np.linalg.eigvalsh(second_moment(closest))[0] > 0
        least = data.distance(closest)
        assert least <= data.distance(body * (1 + 1e-9)) + 1e-3
        low, high = ends(data, np.full(6, least + 4.0)).T
        sigma = np.sqrt(np.diag(covariance))
        assert (np.isfinite([low, high])).all()
        assert (low < closest + 1e-6 * sigma).all()
        assert (closest < high + 1e-6 * sigma).all()
        np.testing.assert_array_equal(ends(data, np.full(6, least + 4.0)), np.stack([low, high], axis=1))


def test_a_contradiction_is_not_weak_data():
    wrong = CUBE * [-1, 1, 1, 1, 1, 1]
    assert admissible(wrong, np.eye(6) * 1e-6, np.full(6, 1.96)) is None
    assert margin(wrong, np.eye(6) * 1e-6) < -100


def test_where_the_fit_does_not_converge_it_is_the_nearest_body(monkeypatch):
    """As it happens with figures that are nearly exact: the answer is on the edge, its intervals are the same."""
    flat, covariance = PLATE + [0.01, 0, 0, 0, 0, 0], 0.01**2 * np.eye(6)
    outside = flat - [0.02, 0, 0, 0, 0, 0]
    rounded = admissible(outside, covariance, np.full(6, 1.96))

    def diverges(*_):
        raise ValueError("did not converge")

    monkeypatch.setattr("identify.least_squares.admissible_tensor.fit", diverges)
    nearest_body = admissible(outside, covariance, np.full(6, 1.96))
    np.testing.assert_allclose(nearest_body.interval95, rounded.interval95)
    assert np.linalg.eigvalsh(second_moment(nearest_body.inertia)).min() == pytest.approx(0, abs=1e-4)
    # the plane of I11 + I22 = I33 is 0.01 / √3 away
    assert np.linalg.norm(nearest_body.inertia - outside) == pytest.approx(0.01 / np.sqrt(3), rel=0.02)


@pytest.mark.parametrize("off", [0.5, 2.5, 6.0])
def test_the_distance_from_every_body(off):
    """From diag(a, b, a + b + d) to the triangle's plane it is d / √3; equal standard uncertainties."""
    sigma = 1e-3
    outside = np.array([0.1, 0, 0, 0.2, 0, 0.3 + np.sqrt(3) * off * sigma])
    assert distance_from_bodies(outside, sigma**2 * np.eye(6)) == pytest.approx(off, rel=1e-3)
    weak = admissible(outside, sigma**2 * np.eye(6), np.full(6, 1.96))
    assert weak is None if off > 4 else weak.distance == pytest.approx(off, rel=1e-3)


def test_a_body_is_at_no_distance():
    assert distance_from_bodies(CUBE, 1e-6 * np.eye(6)) == 0


def test_the_fit_leaves_alone_what_is_known_and_rounds_what_is_not():
    """Without I22, I23, I33: a body that turned about b1 only. Roundest is I22 = I33 = I11, where products vanish."""
    estimate = np.array([0.38, 0.0, 0.0, 0.0, 0.0, 0.0])
    weight = np.diag([1e6, 1e6, 1e6, 0, 0, 0])
    fitted = fit(log_cholesky, estimate, weight, free_of(0.38 * np.array([1, 0, 0, 0.9, 0, 0.8])))
    np.testing.assert_allclose(fitted, 0.38 * np.array([1, 0, 0, 1, 0, 1]), atol=2e-4)
    inside = fit(log_cholesky, CUBE, np.eye(6) * 1e6, free_of(CUBE + [0.02, 0, 0, 0.01, 0, 0]))
    np.testing.assert_allclose(inside, CUBE, atol=0.05e-3)


def test_ten_parameters_are_fitted_alike(generator):
    """An estimate whose tensor is no body's, its mass and centre correlated with it: the nearest body's."""
    true = np.array([19.7, 0.01, -0.02, 0.053, *PLATE])
    root = np.diag([0.02, *[1e-4] * 3, *[SIGMA] * 6]) @ (np.eye(10) + 0.2 * generator.normal(size=(10, 10)))
    covariance = root @ root.T
    estimate = true + [0.01, 1e-4, 0, 0, 0, 0, 0, 0, 0, 0.01]
    start = np.array([0.5 * np.log(19.7), *free_of(np.array([0.2, 0, 0, 0.2, 0, 0.37]) / 19.7), *true[1:4]])
    fitted = fit(pseudo_inertia, estimate, np.linalg.inv(covariance), start)
    assert bool(is_admissible(jnp.asarray(fitted[4:])))
    correction = fitted - estimate
    error = estimate - true
    assert correction @ np.linalg.solve(covariance, correction) < error @ np.linalg.solve(covariance, error)


def coverage(true, trials, seed, sigma=SIGMA):
    """Share of trials whose intervals hold the truth, by component, and the intervals' mean width over the plain one's."""
    rng, held, width = np.random.default_rng(seed), [], []
    for _ in range(trials):
        estimate = true + sigma * rng.standard_normal(6)
        weak = admissible(estimate, np.eye(6) * sigma**2, np.full(6, 1.96))
        plain = np.stack([estimate - 1.96 * sigma, estimate + 1.96 * sigma], axis=1)
        low, high = (plain if weak is None else weak.interval95).T
        held.append((low <= true + 1e-9) & (true - 1e-9 <= high))
        width.append((high - low) / (2 * 1.96 * sigma))
    return np.mean(held, axis=0), np.mean(width, axis=0)


EDGES = {
    "on the edge": PLATE,
    "one sigma inside": PLATE + [SIGMA, 0, 0, SIGMA, 0, 0],
    "a small thing": SIGMA * np.array([1, 0, 0, 1, 0, 1.0]),
    "a needle": np.array([0.371, 0, 0, 0, 0, 0.371]),
}


@pytest.mark.parametrize("name", ["on the edge", pytest.param("a needle", marks=pytest.mark.study)])
def test_intervals_hold_at_the_edge(name):
    """10 trials: at 95 % fewer than 7 hold once in 1,000 for each component."""
    held, width = coverage(EDGES[name], 10, 3)
    assert held.min() > 0.65
    assert (width < 1.2).all()


@pytest.mark.study
@pytest.mark.parametrize("name", EDGES)
def test_coverage_at_the_edge(name):
    """800 trials: standard error 0.8 % at 95 %."""
    held, width = coverage(EDGES[name], 800, 4)
    print(f"\n{name}: coverage {np.round(held, 3)}, width over the plain one {np.round(width, 2)}")
    assert held.min() > 0.925
